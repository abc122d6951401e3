-- The traces that jobs belong to.

-- The span of the request that asked for the job, as a traceparent; empty when nobody has told one.
ALTER TABLE jobs ADD COLUMN trace TEXT;

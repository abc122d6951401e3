-- Changes that callers have named by an Idempotency-Key, so that a request that comes again changes nothing again.

-- A change that was asked for under a name of the caller's.
CREATE TABLE calls (
    -- The id of the key that the caller shows, or "anyone".
    owner TEXT NOT NULL,
    -- The name that the caller gave it.
    name TEXT NOT NULL,
    -- What was asked for: method, path and query.
    target TEXT NOT NULL,
    -- The digest of the request's body.
    digest TEXT NOT NULL,
    -- The id of what it makes, the same for each attempt.
    makes TEXT NOT NULL,
    -- Grows with every attempt; only the newest may give the name back.
    token INTEGER NOT NULL,
    -- When others may attempt it, unless it is answered.
    lease_until INTEGER NOT NULL,
    -- From when on the name is free again.
    expires_at INTEGER NOT NULL,
    -- The status of the answer; empty until it is answered.
    status INTEGER,
    -- The headers of the answer: a list of pairs.
    headers TEXT,
    -- The body of the answer.
    body TEXT,
    CONSTRAINT calls_pk PRIMARY KEY (owner, name),
    CONSTRAINT calls_answer_is_whole CHECK (
        (status IS NULL) = (headers IS NULL) AND (status IS NULL) = (body IS NULL)
    )
) STRICT;

-- What a sweep looks for.
CREATE INDEX calls_by_end ON calls (expires_at);

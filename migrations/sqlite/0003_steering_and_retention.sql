-- What operators say about merges, which versions are kept, and which blobs are on their way out.

-- A rule that holds for all merges of a session until it is removed. Never changed.
CREATE TABLE constraints (
    -- Its id; later ones have greater ones.
    id TEXT NOT NULL,
    -- The session.
    session TEXT NOT NULL,
    -- What it says: an object.
    rule TEXT NOT NULL,
    -- Who said it, if that is known.
    author TEXT,
    -- Why.
    note TEXT,
    -- When.
    created_at INTEGER NOT NULL,
    CONSTRAINT constraints_pk PRIMARY KEY (id),
    CONSTRAINT constraints_session_fk FOREIGN KEY (session) REFERENCES sessions (id) ON DELETE CASCADE
) STRICT;

-- What a session's merges look for.
CREATE INDEX constraints_of_session ON constraints (session, id);

-- The version whose content this one repeats; empty for a merge.
ALTER TABLE versions ADD COLUMN restored_from INTEGER;

-- How many versions of the session are kept, the newest ones; empty for as many as the server keeps.
ALTER TABLE sessions ADD COLUMN keep_versions INTEGER
CONSTRAINT sessions_keep_versions_from_one CHECK (keep_versions >= 1);

-- A blob that no record needed when it was marked, and that is removed, or was. Who wants to keep the same bytes again
-- takes the mark away first, once they are gone.
CREATE TABLE blob_removals (
    -- The digest of the blob's bytes.
    blob TEXT NOT NULL,
    -- When it was marked.
    marked_at INTEGER NOT NULL,
    -- When its bytes were gone; empty while somebody removes them.
    removed_at INTEGER,
    CONSTRAINT blob_removals_pk PRIMARY KEY (blob)
) STRICT;

-- What is looked for before a blob is removed.
CREATE INDEX maps_of_blob ON maps (blob);
-- What is looked for before a blob is removed.
CREATE INDEX versions_of_grid_blob ON versions (grid_blob);
-- What is looked for before a blob is removed.
CREATE INDEX versions_of_png_blob ON versions (png_blob);
-- What is looked for before a blob is removed.
CREATE INDEX versions_of_overlay_blob ON versions (overlay_blob);

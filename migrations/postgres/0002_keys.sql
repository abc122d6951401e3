-- A key that callers show. Kept for good, also when it is revoked or expired: as long as there is one, the service is
-- closed to whoever shows none.
CREATE TABLE api_keys (
    -- Its id, which is no secret.
    id TEXT COLLATE "C" NOT NULL,
    -- What its owner calls it.
    name TEXT NOT NULL,
    -- What it is good for.
    scope TEXT NOT NULL,
    -- The session that a robot's key is good for. No reference: the first push makes the session.
    session TEXT,
    -- The robot that a robot's key is good for.
    robot TEXT,
    -- The digest of its secret.
    digest TEXT NOT NULL,
    -- When it was made.
    created_at BIGINT NOT NULL,
    -- From when on it is not good any more; empty: never.
    expires_at BIGINT,
    -- When it was taken back.
    revoked_at BIGINT,
    CONSTRAINT api_keys_pk PRIMARY KEY (id),
    CONSTRAINT api_keys_digest_once UNIQUE (digest),
    CONSTRAINT api_keys_scope_is_known CHECK (scope IN ('admin', 'operator', 'robot', 'read')),
    CONSTRAINT api_keys_robot_is_whole CHECK (
        (scope = 'robot') = (session IS NOT NULL) AND (scope = 'robot') = (robot IS NOT NULL)
    )
);

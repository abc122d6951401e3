-- The records of mapweld. Times are microseconds since 1970-01-01T00:00:00Z; ids are UUIDs in text; digests are SHA-256
-- in 64 small hexadecimal digits; lists and documents are JSON in text, kept byte for byte. The folder of SQLite has the
-- same tables, columns and constraint names. Whatever is ordered by is compared byte by byte (COLLATE "C"), so that lists
-- come in one order everywhere.

-- A session: a place and a time that robots map together.
CREATE TABLE sessions (
    -- The name that its first caller chose.
    id TEXT COLLATE "C" NOT NULL,
    -- A title for people.
    title TEXT,
    -- Labels to find it by: an object of texts.
    labels TEXT NOT NULL,
    -- The robot whose map frame is the session frame; empty until it is said or the first robot pushes.
    anchor TEXT COLLATE "C",
    -- Whether an upload starts a merge by itself.
    auto_merge BOOLEAN NOT NULL,
    -- The registration method and its parameters: an object.
    method TEXT NOT NULL,
    -- Metres a cell of the fused map; empty for the finest of the maps.
    resolution DOUBLE PRECISION,
    -- When it was made.
    created_at BIGINT NOT NULL,
    -- When its settings last changed.
    updated_at BIGINT NOT NULL,
    CONSTRAINT sessions_pk PRIMARY KEY (id),
    CONSTRAINT sessions_auto_merge_is_a_truth CHECK (auto_merge IN (FALSE, TRUE))
);

-- A job: work that is queued, leased to one worker at a time, and remembered.
CREATE TABLE jobs (
    -- Its id; later jobs have greater ones.
    id TEXT COLLATE "C" NOT NULL,
    -- The session that it works on.
    session TEXT COLLATE "C" NOT NULL,
    -- What kind of work it is.
    kind TEXT NOT NULL,
    -- What is to be done: an object.
    request TEXT NOT NULL,
    -- Of the queued jobs of a session with the same key there is only one, and it does the work of all that ask.
    dedup_key TEXT COLLATE "C",
    -- How far it has come.
    state TEXT NOT NULL,
    -- How often it was begun.
    attempt BIGINT NOT NULL,
    -- How often it may be begun before it is parked as failed.
    max_attempts BIGINT NOT NULL,
    -- Not to be begun earlier than this.
    run_after BIGINT NOT NULL,
    -- The worker that has leased it.
    lease_owner TEXT,
    -- When others may claim it, unless the lease is renewed.
    lease_until BIGINT,
    -- Grows with every claim; only the worker that shows the newest may write.
    lease_token BIGINT NOT NULL,
    -- What is being done right now.
    stage TEXT,
    -- How much of the work is done, in [0, 1].
    progress DOUBLE PRECISION NOT NULL,
    -- Whether somebody has asked for it to end.
    cancel_requested BOOLEAN NOT NULL,
    -- Why the last attempt failed: an object of code and message.
    error TEXT,
    -- The version that it published.
    version BIGINT,
    -- What a dry run found: a document.
    result TEXT,
    -- How long each stage took: a list.
    timings TEXT NOT NULL,
    -- When it was asked for.
    created_at BIGINT NOT NULL,
    -- When the last attempt was begun.
    started_at BIGINT,
    -- When it ended.
    finished_at BIGINT,
    CONSTRAINT jobs_pk PRIMARY KEY (id),
    CONSTRAINT jobs_session_fk FOREIGN KEY (session) REFERENCES sessions (id) ON DELETE CASCADE,
    CONSTRAINT jobs_state_is_known CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    CONSTRAINT jobs_running_is_leased CHECK ((state = 'running') = (lease_until IS NOT NULL)),
    CONSTRAINT jobs_ended_has_a_time CHECK ((state IN ('queued', 'running')) = (finished_at IS NULL)),
    CONSTRAINT jobs_cancel_requested_is_a_truth CHECK (cancel_requested IN (FALSE, TRUE))
);

-- What a worker looks for.
CREATE INDEX jobs_due ON jobs (run_after, id) WHERE state IN ('queued', 'running');
-- What a session's page looks for.
CREATE INDEX jobs_of_session ON jobs (session, id);
-- Jobs of one session run one after the other, so that a later version never has older maps.
CREATE UNIQUE INDEX jobs_one_running_per_session ON jobs (session) WHERE state = 'running';
-- Uploads while a job waits share it.
CREATE UNIQUE INDEX jobs_one_queued_per_dedup_key ON jobs (session, dedup_key)
WHERE state = 'queued' AND dedup_key IS NOT NULL;

-- A map that a robot has pushed. Never changed.
CREATE TABLE maps (
    -- Its id; later maps have greater ones.
    id TEXT COLLATE "C" NOT NULL,
    -- The session that it belongs to.
    session TEXT COLLATE "C" NOT NULL,
    -- The robot that pushed it.
    robot TEXT COLLATE "C" NOT NULL,
    -- 1 for the first map of this robot in this session, then 2, 3 ...; a merge takes the highest.
    sequence BIGINT NOT NULL,
    -- The digest of its lattice and cells.
    digest TEXT NOT NULL,
    -- The digest of the blob that holds its cells.
    blob TEXT NOT NULL,
    -- Columns of cells.
    width BIGINT NOT NULL,
    -- Rows of cells.
    height BIGINT NOT NULL,
    -- Metres a cell.
    resolution DOUBLE PRECISION NOT NULL,
    -- Metres along x of the lower-left corner in the robot's map frame.
    origin_x DOUBLE PRECISION NOT NULL,
    -- Metres along y of the lower-left corner in the robot's map frame.
    origin_y DOUBLE PRECISION NOT NULL,
    -- Radians that the lattice is turned in the robot's map frame.
    origin_yaw DOUBLE PRECISION NOT NULL,
    -- How many cells are unknown or undecided.
    unknown_cells BIGINT NOT NULL,
    -- How many cells are free.
    free_cells BIGINT NOT NULL,
    -- How many cells are occupied.
    occupied_cells BIGINT NOT NULL,
    -- The name of the robot's map frame, if it was said.
    frame_id TEXT,
    -- What was odd about the upload: a list of texts.
    warnings TEXT NOT NULL,
    -- The job that takes it in; empty when the session does not merge by itself.
    job TEXT COLLATE "C",
    -- When it was received.
    received_at BIGINT NOT NULL,
    CONSTRAINT maps_pk PRIMARY KEY (id),
    CONSTRAINT maps_session_fk FOREIGN KEY (session) REFERENCES sessions (id) ON DELETE CASCADE,
    CONSTRAINT maps_sequence_once UNIQUE (session, robot, sequence),
    CONSTRAINT maps_content_once UNIQUE (session, robot, digest)
);

-- What a session's list of maps looks for.
CREATE INDEX maps_of_session ON maps (session, id);

-- A version: the answer of one merge. Never changed.
CREATE TABLE versions (
    -- The session.
    session TEXT COLLATE "C" NOT NULL,
    -- Its number in the session: 1, 2, 3 ... without gaps.
    number BIGINT NOT NULL,
    -- The version before it.
    parent BIGINT,
    -- The job that made it; no job makes two.
    job TEXT COLLATE "C" NOT NULL,
    -- The robot whose map frame it is told in.
    anchor TEXT COLLATE "C" NOT NULL,
    -- What is placed where and why: a document, kept byte for byte.
    result TEXT NOT NULL,
    -- The digest of the blob with the fused cells.
    grid_blob TEXT NOT NULL,
    -- The digest of the blob with the picture for map servers.
    png_blob TEXT NOT NULL,
    -- The digest of the blob with each robot in its own colour.
    overlay_blob TEXT NOT NULL,
    -- The digest of the fused map's lattice and cells.
    digest TEXT NOT NULL,
    -- When it was published.
    created_at BIGINT NOT NULL,
    CONSTRAINT versions_pk PRIMARY KEY (session, number),
    CONSTRAINT versions_session_fk FOREIGN KEY (session) REFERENCES sessions (id) ON DELETE CASCADE,
    CONSTRAINT versions_job_once UNIQUE (job),
    CONSTRAINT versions_number_from_one CHECK (number >= 1)
);

-- The maps that went into a version, one a robot.
CREATE TABLE version_inputs (
    -- The session.
    session TEXT COLLATE "C" NOT NULL,
    -- The version.
    number BIGINT NOT NULL,
    -- The robot.
    robot TEXT COLLATE "C" NOT NULL,
    -- Its map.
    map TEXT COLLATE "C" NOT NULL,
    -- The digest of the map's lattice and cells.
    digest TEXT NOT NULL,
    CONSTRAINT version_inputs_pk PRIMARY KEY (session, number, robot),
    CONSTRAINT version_inputs_version_fk FOREIGN KEY (session, number) REFERENCES versions (session, number)
    ON DELETE CASCADE,
    CONSTRAINT version_inputs_map_fk FOREIGN KEY (map) REFERENCES maps (id)
);

-- What the check looks for when a map is deleted.
CREATE INDEX version_inputs_of_map ON version_inputs (map);

//! A map that a robot has pushed.

use serde::{Deserialize, Serialize};

use super::{BlobKey, Digest, JobId, MapId, RobotId, SessionId, Timestamp};
use crate::grid::{Lattice, OccupancyGrid, StateCounts};

/// A map as it is kept. Immutable.
#[derive(Debug, Clone, PartialEq)]
pub struct MapRecord {
    /// Its id.
    pub id: MapId,
    /// The session that it belongs to.
    pub session: SessionId,
    /// The robot that pushed it.
    pub robot: RobotId,
    /// 1 for the first map of this robot in this session, then 2, 3 ... without gaps. A merge takes the highest.
    pub sequence: u32,
    /// What was pushed.
    pub map: NewMap,
    /// The job that takes it in; none when the session does not merge by itself.
    pub job: Option<JobId>,
    /// When it was received.
    pub received_at: Timestamp,
}

/// What is known of a map before it has a place in a session.
#[derive(Debug, Clone, PartialEq)]
pub struct NewMap {
    /// [`Digest::of_grid`]: the same content again is the same map.
    pub digest: Digest,
    /// Where its cells are kept.
    pub blob: BlobKey,
    /// Where its cells lie in the robot's map frame.
    pub lattice: Lattice,
    /// How many cells are in each state.
    pub counts: StateCounts,
    /// The name of the robot's map frame, if it was said.
    pub frame_id: Option<String>,
    /// What was odd about the upload, for people.
    pub warnings: Vec<String>,
}

impl NewMap {
    /// The record of a decoded map whose cells are kept under `blob`.
    #[must_use]
    pub fn of(grid: &OccupancyGrid, blob: BlobKey) -> Self {
        Self {
            digest: Digest::of_grid(grid),
            blob,
            lattice: *grid.lattice(),
            counts: grid.state_counts(),
            frame_id: None,
            warnings: Vec::new(),
        }
    }

    /// Area of the free and occupied cells, in square metres.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "cell counts stay far below 2^52")]
    pub fn known_area_m2(&self) -> f64 {
        self.counts.known() as f64 * self.lattice.resolution().powi(2)
    }
}

/// A robot's maps in a session, in short.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RobotSummary {
    /// The robot.
    pub robot: RobotId,
    /// How many maps it has pushed.
    pub maps: u32,
    /// The newest of them.
    pub newest: MapId,
    /// When that one was received.
    pub newest_at: Timestamp,
}

//! Uploaded maps on the wire.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{CellCounts, Pose};
use crate::model::{Digest, JobId, MapId, MapRecord, RobotId, SessionId, Timestamp};

/// A map that a robot has pushed. Immutable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Map {
    /// Its id.
    pub id: MapId,
    /// The session that it belongs to.
    pub session: SessionId,
    /// The robot that pushed it.
    pub robot: RobotId,
    /// 1 for the first map of this robot in this session, then 2, 3 ...; a merge takes the highest.
    pub sequence: u32,
    /// SHA-256 of the content: the same content again is the same map, whatever file it comes in.
    pub digest: Digest,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Side of a cell in metres.
    pub resolution: f64,
    /// Pose of the lower-left corner of cell (0, 0) in the robot's map frame.
    pub origin: Pose,
    /// Area of the free and occupied cells, in square metres.
    pub known_area_m2: f64,
    /// How many cells are in each state.
    pub counts: CellCounts,
    /// The name of the robot's map frame, if it was said.
    pub frame_id: Option<String>,
    /// What was odd about the upload, for people.
    pub warnings: Vec<String>,
    /// When it was received.
    pub received_at: Timestamp,
}

impl From<MapRecord> for Map {
    fn from(record: MapRecord) -> Self {
        let lattice = record.map.lattice;
        Self {
            id: record.id,
            session: record.session,
            robot: record.robot,
            sequence: record.sequence,
            digest: record.map.digest,
            width: lattice.width(),
            height: lattice.height(),
            resolution: lattice.resolution(),
            origin: lattice.origin().into(),
            known_area_m2: record.map.known_area_m2(),
            counts: record.map.counts.into(),
            frame_id: record.map.frame_id,
            warnings: record.map.warnings,
            received_at: record.received_at,
        }
    }
}

/// The answer to an upload. When it arrives, the map is on disk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Pushed {
    /// Whether the content is new; `false`: the session had this map of this robot, nothing was stored.
    pub created: bool,
    /// The map.
    pub map: Map,
    /// The merge that takes it in, or took it in; absent when the session does not merge by itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub job: Option<JobId>,
}

//! Sessions and their robots on the wire. A session is made with [`SessionSettings`](crate::model::SessionSettings)
//! and changed with a [`SessionPatch`](crate::model::SessionPatch).

use std::num::NonZeroU32;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::model::{Labels, MapId, MethodSpec, Resolution, RobotId, RobotSummary, SessionId, Timestamp, Title};

/// A place and a time that robots map together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Session {
    /// Its name.
    pub id: SessionId,
    /// A title for people.
    pub title: Option<Title>,
    /// Labels to find it by.
    pub labels: Labels,
    /// The robot whose map frame is the session frame; none before the first map.
    pub anchor: Option<RobotId>,
    /// Whether an upload starts a merge by itself.
    pub auto_merge: bool,
    /// How maps are registered.
    pub method: MethodSpec,
    /// Resolution of the fused map in metres a cell; `null`: as the anchor's map.
    pub resolution: Option<Resolution>,
    /// How many versions are kept; `null`: as many as the server keeps.
    #[schema(value_type = Option<u32>, minimum = 1)]
    #[serde(default)]
    pub keep_versions: Option<NonZeroU32>,
    /// When it was made.
    pub created_at: Timestamp,
    /// When its settings last changed.
    pub updated_at: Timestamp,
}

impl From<crate::model::Session> for Session {
    fn from(session: crate::model::Session) -> Self {
        let settings = session.settings;
        Self {
            id: session.id,
            title: settings.title,
            labels: settings.labels,
            anchor: settings.anchor,
            auto_merge: settings.auto_merge,
            method: settings.method,
            resolution: settings.resolution,
            keep_versions: settings.keep_versions,
            created_at: session.created_at,
            updated_at: session.updated_at,
        }
    }
}

/// A robot of a session.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Robot {
    /// Its name.
    pub robot: RobotId,
    /// How many maps it has pushed.
    pub maps: u32,
    /// The newest of them: the one that the next merge takes.
    pub newest: MapId,
    /// When that one was received.
    pub newest_at: Timestamp,
}

impl From<RobotSummary> for Robot {
    fn from(robot: RobotSummary) -> Self {
        Self {
            robot: robot.robot,
            maps: robot.maps,
            newest: robot.newest,
            newest_at: robot.newest_at,
        }
    }
}

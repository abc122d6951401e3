//! Versions on the wire.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{MergeResult, Verbatim};
use crate::model::{Digest, JobId, MapId, RobotId, SessionId, Timestamp, VersionNumber};

/// One fused map of a session, in short. Immutable.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct VersionSummary {
    /// The session.
    pub session: SessionId,
    /// Its number in the session: 1, 2, 3 ... without gaps.
    pub number: VersionNumber,
    /// The version before it.
    pub parent: Option<VersionNumber>,
    /// The job that made it.
    pub job: JobId,
    /// The robot whose map frame it is told in.
    pub anchor: RobotId,
    /// The maps that went in, one a robot, ordered by robot.
    pub inputs: Vec<VersionInput>,
    /// SHA-256 of the fused map's content.
    pub digest: Digest,
    /// The version whose content this one repeats; absent for a merge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub restored_from: Option<VersionNumber>,
    /// When it was published.
    pub created_at: Timestamp,
}

/// One map that went into a version.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct VersionInput {
    /// The robot.
    pub robot: RobotId,
    /// Its map.
    pub map: MapId,
    /// SHA-256 of the map's content.
    pub digest: Digest,
}

/// One fused map of a session with everything that explains it. Immutable.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
pub struct Version {
    /// The session.
    pub session: SessionId,
    /// Its number in the session: 1, 2, 3 ... without gaps.
    pub number: VersionNumber,
    /// The version before it.
    pub parent: Option<VersionNumber>,
    /// The job that made it.
    pub job: JobId,
    /// The robot whose map frame it is told in.
    pub anchor: RobotId,
    /// The maps that went in, one a robot, ordered by robot.
    pub inputs: Vec<VersionInput>,
    /// SHA-256 of the fused map's content.
    pub digest: Digest,
    /// The version whose content this one repeats; absent for a merge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub restored_from: Option<VersionNumber>,
    /// When it was published.
    pub created_at: Timestamp,
    /// For each robot: placed or not placed, and why.
    #[schema(value_type = MergeResult)]
    pub result: Verbatim<MergeResult>,
}

impl From<crate::model::VersionInput> for VersionInput {
    fn from(input: crate::model::VersionInput) -> Self {
        Self {
            robot: input.robot,
            map: input.map,
            digest: input.digest,
        }
    }
}

impl From<crate::model::Version> for VersionSummary {
    fn from(version: crate::model::Version) -> Self {
        Self {
            session: version.session,
            number: version.number,
            parent: version.parent,
            job: version.job,
            anchor: version.anchor,
            inputs: version.inputs.into_iter().map(VersionInput::from).collect(),
            digest: version.digest,
            restored_from: version.restored_from,
            created_at: version.created_at,
        }
    }
}

impl From<crate::model::Version> for Version {
    fn from(version: crate::model::Version) -> Self {
        let result = Verbatim::new(version.result.raw().to_owned());
        let summary = VersionSummary::from(version);
        Self {
            session: summary.session,
            number: summary.number,
            parent: summary.parent,
            job: summary.job,
            anchor: summary.anchor,
            inputs: summary.inputs,
            digest: summary.digest,
            restored_from: summary.restored_from,
            created_at: summary.created_at,
            result,
        }
    }
}

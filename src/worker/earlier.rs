//! Where the version before placed the maps: what a merge looks at first.
//!
//! Only a merge of other maps than those of the version before starts from there. A merge of the very same maps looks
//! everywhere again, so that a place once found is never beyond doubt, and the same maps give the same answer.

use std::collections::BTreeMap;
use std::sync::Arc;

use tracing::warn;

use super::merge::Merges;
use super::work::Failure;
use crate::api::{MapPlacement, MergeResult};
use crate::codec::decode_cells;
use crate::fusion::{Earlier, Prior, WeldInput};
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;
use crate::model::{MapId, MapRecord, RobotId, SessionId, Version, VersionSelector};
use crate::store::{Missing, StoreError};

/// What the version before says.
#[derive(Debug, Default)]
pub(super) struct EarlierPlaces {
    /// Poses of the robots' map frames in that of the anchor.
    pub(super) poses: BTreeMap<RobotId, Pose2>,
    /// The maps of then.
    maps: BTreeMap<RobotId, MapId>,
    /// Whether a merge starts from there.
    starts_there: bool,
}

impl EarlierPlaces {
    /// What a version says, told in the frame of `anchor`; nothing when it did not place it.
    fn of(version: &Version, result: &MergeResult, maps: &[MapRecord], anchor: &RobotId) -> Self {
        let told = |map: &MapPlacement| {
            let pose = map.pose?.to_pose2()?;
            Some((RobotId::parse(&map.name).ok()?, pose))
        };
        let mut poses: BTreeMap<RobotId, Pose2> = result.maps.iter().filter_map(told).collect();
        let Some(&pose_before_anchor) = poses.get(anchor) else {
            return Self::default();
        };
        for pose in poses.values_mut() {
            *pose = pose_before_anchor.inverse() * *pose;
        }
        let before = version.inputs.iter().map(|input| (&input.robot, input.map));
        let now = maps.iter().map(|map| (&map.robot, map.id));
        Self {
            poses,
            starts_there: !before.eq(now),
            maps: version
                .inputs
                .iter()
                .map(|input| (input.robot.clone(), input.map))
                .collect(),
        }
    }
}

impl Merges {
    /// Where the version before placed the maps.
    pub(super) async fn earlier(
        &self,
        session: &SessionId,
        maps: &[MapRecord],
        anchor: &RobotId,
    ) -> Result<EarlierPlaces, Failure> {
        let version = match self.store.get_version(session, VersionSelector::Latest).await {
            Ok(version) => version,
            Err(StoreError::NotFound(Missing::Version(..))) => return Ok(EarlierPlaces::default()),
            Err(error) => return Err(error.into()),
        };
        match serde_json::from_str(version.result.as_str()) {
            Ok(result) => Ok(EarlierPlaces::of(&version, &result, maps, anchor)),
            Err(error) => {
                // all maps are searched for: slower, and as good
                warn!(%session, version = %version.number, %error, "the version before cannot be read");
                Ok(EarlierPlaces::default())
            }
        }
    }

    /// Puts earlier poses on the maps that nothing else is said about.
    pub(super) async fn put_earlier(
        &self,
        earlier: &EarlierPlaces,
        records: &[MapRecord],
        inputs: &mut [WeldInput],
    ) -> Result<(), Failure> {
        if !earlier.starts_there {
            return Ok(());
        }
        for (record, input) in records.iter().zip(inputs) {
            let place = earlier.poses.get(&record.robot).zip(earlier.maps.get(&record.robot));
            let (Some((&pose_anchor_map, &map)), None) = (place, &input.prior) else {
                continue;
            };
            let previous = if map == record.id {
                None
            } else if let Some(grid) = self.map_of_then(&record.session, map).await? {
                Some(grid)
            } else {
                // without it nobody can tell whether the robot's frame is still the same
                continue;
            };
            input.prior = Some(Prior::Earlier(Earlier {
                pose_anchor_map,
                previous,
            }));
        }
        Ok(())
    }

    /// The map of an earlier version; none when it is not kept any more.
    async fn map_of_then(&self, session: &SessionId, map: MapId) -> Result<Option<Arc<OccupancyGrid>>, Failure> {
        let record = match self.store.get_map(session, map).await {
            Ok(record) => record,
            Err(StoreError::NotFound(Missing::Map(..))) => return Ok(None),
            Err(error) => return Err(error.into()),
        };
        let bytes = self.blobs.get(record.map.blob).await?;
        let grid = self.compute.run(move || decode_cells(&bytes)).await?;
        let damaged = |error| Failure::for_good("store_damaged", format!("map {map}: {error}"));
        Ok(Some(Arc::new(grid.map_err(damaged)?)))
    }
}

//! What is counted of the versions that this worker publishes.

use crate::api::{MergeResult, PlacementStatus};
use crate::meters;
use crate::model::StageSeconds;
use crate::store::NewVersion;

/// A version was published.
pub(super) fn published(version: &NewVersion) {
    stages(&version.timings);
    if version.restored_from.is_some() {
        return; // nothing was found: it is told again
    }
    let Ok(result) = serde_json::from_str::<MergeResult>(version.result.as_str()) else {
        return; // tests publish less than a result
    };
    for map in result.maps {
        let placed = map.status == PlacementStatus::Placed;
        let reason = map.reason.map(|reason| reason.code.as_str());
        meters::robot((!placed).then(|| reason.unwrap_or_default()));
    }
}

/// A job has succeeded.
pub(super) fn stages(timings: &[StageSeconds]) {
    for stage in timings {
        meters::stage(&stage.stage, stage.seconds);
    }
}

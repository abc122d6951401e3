//! `mapweld evaluate --growth`: the maps of several robots as they grow, each snapshot with what the one before it taught.

use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;
use serde_json::json;

use super::{Sum, judge, map, read, stages, timed};
use crate::cli::{Failure, say};
use crate::fusion::{Basis, Earlier, Moments, Prior, RegisteredSet, WeldInput, WeldOptions};
use crate::geometry::Pose2;
use crate::registration::Method;

/// Maps of several robots as they grow.
#[derive(Debug, Deserialize)]
struct Sequence {
    id: String,
    robots: Vec<Robot>,
}

/// A robot's successive maps, all in one frame.
#[derive(Debug, Deserialize)]
struct Robot {
    name: String,
    snapshots: Vec<String>,
    pose: Pose2,
}

/// Registers each snapshot of each sequence twice: knowing the poses of the snapshot before, and knowing nothing.
pub(in crate::cli) fn growth(file: &Path, only: Option<&str>, method: &Arc<dyn Method>) -> Result<(), Failure> {
    let mut sum = Sum::default();
    for sequence in read::<Sequence>(file)? {
        if only.is_some_and(|only| !sequence.id.contains(only)) {
            continue;
        }
        let snapshots = sequence
            .robots
            .iter()
            .map(|robot| robot.snapshots.len())
            .min()
            .unwrap_or(0);
        let world_anchor = sequence.robots.first().map_or(Pose2::IDENTITY, |robot| robot.pose);
        let mut before: Option<(Vec<WeldInput>, RegisteredSet)> = None;
        for snapshot in 0..snapshots {
            let mut inputs = Vec::new();
            for (index, robot) in sequence.robots.iter().enumerate() {
                let grid = map(file, &robot.snapshots[snapshot])?;
                let features = Some(method.features(&grid));
                let prior = before.as_ref().and_then(|(inputs, answer)| {
                    answer.placements[index].placed().map(|placed| {
                        Prior::Earlier(Earlier {
                            pose_anchor_map: placed.pose_anchor_map,
                            previous: Some(inputs[index].grid.clone()),
                        })
                    })
                });
                let name = robot.name.clone();
                inputs.push(WeldInput {
                    name,
                    grid,
                    features,
                    prior,
                });
            }
            let options = WeldOptions::new(method.clone());
            let (answer, fast) = timed(&inputs, &options)?;
            let unaided: Vec<WeldInput> = inputs
                .iter()
                .map(|input| WeldInput {
                    prior: None,
                    ..input.clone()
                })
                .collect();
            let (_, full) = timed(&unaided, &options)?;
            let mut maps = Vec::new();
            for (index, robot) in sequence.robots.iter().enumerate() {
                let truth = world_anchor.inverse() * robot.pose;
                let mut map = judge(&answer, &inputs[index], index, Some(truth));
                map.line.insert("map".into(), json!(robot.name));
                map.jump_m = before.as_ref().and_then(|(_, before)| {
                    let (earlier, now) = (before.placements[index].placed()?, answer.placements[index].placed()?);
                    let moments = Moments::of(&inputs[index].grid);
                    Some(moments.distance(earlier.pose_anchor_map, now.pose_anchor_map))
                });
                map.line.insert("jump_m".into(), json!(map.jump_m));
                let was_placed = before
                    .as_ref()
                    .is_some_and(|(_, before)| before.placements[index].placed().is_some());
                map.line.insert("lost".into(), json!(was_placed && !map.placed));
                maps.push(map);
            }
            let known = maps.iter().skip(1).all(|map| map.basis == Some(Basis::KnownPose));
            let ratio = known.then(|| full.as_secs_f64() / fast.as_secs_f64());
            sum.add(&maps);
            sum.ratios.extend(ratio);
            say(&json!({
                "id": sequence.id,
                "snapshot": snapshot,
                "maps": maps.iter().map(|map| &map.line).collect::<Vec<_>>(),
                "seconds": fast.as_secs_f64(),
                "full_seconds": full.as_secs_f64(),
                "ratio": ratio,
                "stages": stages(&answer),
            })
            .to_string())?;
            before = Some((inputs, answer));
        }
    }
    say(&sum.line().to_string())
}

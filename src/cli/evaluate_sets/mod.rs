//! `mapweld evaluate --sets` and `--growth`: whole sets of maps against their known poses, one JSON object a line.

mod growth;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use serde::Deserialize;
use serde_json::{Map, Value, json};

pub(super) use growth::growth;

use super::files::MapFiles;
use super::{BadInput, Failure, Stopwatch, say};
use crate::codec::Limits;
use crate::fusion::{
    Basis, Moments, PairCheck, PairRole, Placement, RegisteredSet, WeldInput, WeldOptions, register_set,
};
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;
use crate::registration::{Method, Reason, Registration};

/// A placement that is off by more is wrong, in metres: the tolerance of single pairs.
const WRONG_M: f64 = 0.5;
/// A placement that is off by no more is good, in metres.
const GOOD_M: f64 = 0.1;

/// Maps of one place with their poses in a common world frame; a map of another place has none.
#[derive(Debug, Deserialize)]
struct LabelledSet {
    id: String,
    maps: Vec<String>,
    poses: Vec<Option<Pose2>>,
}

/// Registers each set of a list; the anchor is the first map that has a pose.
pub(super) fn sets(file: &Path, only: Option<&str>, method: &Arc<dyn Method>) -> Result<(), Failure> {
    let mut sum = Sum::default();
    for set in read::<LabelledSet>(file)? {
        if only.is_some_and(|only| !set.id.contains(only)) {
            continue;
        }
        if set.maps.len() != set.poses.len() {
            let message = format!("{}: {} maps, but {} poses", set.id, set.maps.len(), set.poses.len());
            return Err(Failure::bad_input(message));
        }
        let inputs = set
            .maps
            .iter()
            .map(|name| Ok(WeldInput::new(name.as_str(), map(file, name)?)))
            .collect::<Result<Vec<_>, Failure>>()?;
        let mut options = WeldOptions::new(method.clone());
        options.anchor = set.poses.iter().position(Option::is_some).unwrap_or(0);
        let (answer, time) = timed(&inputs, &options)?;
        let world_anchor = set.poses[options.anchor].unwrap_or(Pose2::IDENTITY);
        let truth: Vec<Option<Pose2>> = set
            .poses
            .iter()
            .map(|pose| pose.map(|world_map| world_anchor.inverse() * world_map))
            .collect();
        let maps: Vec<Judged> = (0..inputs.len())
            .map(|map| judge(&answer, &inputs[map], map, truth[map]))
            .collect();
        sum.add(&maps);
        say(&json!({
            "id": set.id,
            "anchor": inputs[options.anchor].name,
            "placed": maps.iter().filter(|map| map.placed).count(),
            "maps": maps.iter().map(|map| &map.line).collect::<Vec<_>>(),
            "groups": groups(&answer),
            "pairs": pair_counts(&answer, &inputs, &set.poses),
            "seconds": time.as_secs_f64(),
            "stages": stages(&answer),
        })
        .to_string())?;
    }
    say(&sum.line().to_string())
}

fn read<T: for<'de> Deserialize<'de>>(file: &Path) -> Result<Vec<T>, Failure> {
    let text = std::fs::read(file).bad_input(|| file.display().to_string())?;
    serde_json::from_slice(&text).bad_input(|| file.display().to_string())
}

fn map(file: &Path, name: &str) -> Result<Arc<OccupancyGrid>, Failure> {
    let limits = Limits::default();
    let path = file.parent().unwrap_or(Path::new("")).join(name);
    Ok(Arc::new(MapFiles::read(&path, &limits)?.decode(&limits)?.grid))
}

fn timed(inputs: &[WeldInput], options: &WeldOptions) -> Result<(RegisteredSet, Duration), Failure> {
    let watch = Stopwatch::start();
    let answer = register_set(inputs, options, &watch).bad_input(|| "cannot register the set")?;
    Ok((answer, watch.elapsed()))
}

/// What is right or wrong about one map.
struct Judged {
    placed: bool,
    basis: Option<Basis>,
    stranger: bool,
    error_m: Option<f64>,
    jump_m: Option<f64>,
    line: Map<String, Value>,
}

/// `truth` is the map's true pose in the anchor's frame; a stranger has none.
fn judge(answer: &RegisteredSet, input: &WeldInput, map: usize, truth: Option<Pose2>) -> Judged {
    let placement = &answer.placements[map];
    let placed = placement.placed();
    let error_m = placed.and_then(|placed| {
        let moments = Moments::of(&input.grid);
        truth.map(|truth| moments.distance(placed.pose_anchor_map, truth))
    });
    let mut line = Map::new();
    line.insert("map".into(), json!(input.name));
    line.insert("placed".into(), json!(placed.is_some()));
    line.insert("stranger".into(), json!(truth.is_none()));
    line.insert("error_m".into(), json!(error_m));
    match placement {
        Placement::Placed(placed) => {
            line.insert("basis".into(), json!(format!("{:?}", placed.basis)));
            line.insert("supporting_pairs".into(), json!(placed.supporting_pairs.len()));
            line.insert("verification_index".into(), json!(placed.verification_index));
            line.insert("overlap".into(), json!(placed.overlap));
            line.insert(
                "frame_jump".into(),
                json!(placed.frame_jump.map(|jump| jump.distance_m)),
            );
        }
        Placement::NotPlaced(not_placed) => {
            line.insert("reason".into(), json!(format!("{:?}", not_placed.reason)));
            line.insert(
                "frame_jump".into(),
                json!(not_placed.frame_jump.map(|jump| jump.distance_m)),
            );
        }
    }
    Judged {
        placed: placed.is_some(),
        basis: placed.map(|placed| placed.basis),
        stranger: truth.is_none(),
        error_m,
        jump_m: None,
        line,
    }
}

fn groups(answer: &RegisteredSet) -> Vec<Vec<usize>> {
    let members = |group: &crate::fusion::Group| group.members.iter().map(|member| member.map).collect();
    answer.groups.iter().map(members).collect()
}

/// How the pairs went, and how many of them are wrong by the true poses.
fn pair_counts(answer: &RegisteredSet, inputs: &[WeldInput], poses: &[Option<Pose2>]) -> Value {
    let mut counts: Map<String, Value> = Map::new();
    let mut count = |key: &str| {
        let seen = counts.get(key).and_then(Value::as_u64).unwrap_or(0);
        counts.insert(key.to_owned(), json!(seen + 1));
    };
    for pair in &answer.pairs {
        match (&pair.registration, pair.role) {
            (Some(Registration::Accepted(_)), PairRole::Support) => count("accepted"),
            (Some(Registration::Accepted(_)), PairRole::Unconfirmed) => count("unconfirmed"),
            (Some(Registration::Accepted(_)), _) => count("outvoted"),
            (Some(Registration::Rejected(_)), PairRole::JointSupport(_)) => count("joint"),
            (Some(Registration::Rejected(rejection)), _) => count(reason_name(rejection.reason)),
            (None, _) => count(if pair.check == PairCheck::Forbidden {
                "forbidden"
            } else {
                "not_needed"
            }),
        }
        if let Some(found) = pair.pose_fixed_moving() {
            let right = poses[pair.fixed]
                .zip(poses[pair.moving])
                .is_some_and(|(fixed, moving)| {
                    let moments = Moments::of(&inputs[pair.moving].grid);
                    moments.distance(found, fixed.inverse() * moving) <= WRONG_M
                });
            if !right {
                count("wrong");
            }
        }
    }
    for bridge in &answer.bridges {
        count(if bridge.joined {
            "bridges_joined"
        } else {
            "bridges_refused"
        });
    }
    Value::Object(counts)
}

fn reason_name(reason: Reason) -> &'static str {
    match reason {
        Reason::NoStructure { .. } => "no_structure",
        Reason::NoOverlap { .. } => "no_overlap",
        Reason::Ambiguous { .. } => "ambiguous",
        Reason::UnderConstrained { .. } => "under_constrained",
        Reason::VerificationFailed { .. } => "verification_failed",
        Reason::Deadline => "deadline",
        Reason::Cancelled => "cancelled",
    }
}

fn stages(answer: &RegisteredSet) -> Value {
    let stages = answer.stages.iter();
    Value::Object(
        stages
            .map(|stage| (stage.stage.to_owned(), json!(stage.duration.as_secs_f64())))
            .collect(),
    )
}

/// What the last line tells.
#[derive(Default)]
struct Sum {
    maps: usize,
    placed: usize,
    good: usize,
    wrong: usize,
    strangers: usize,
    refused: usize,
    worst_m: f64,
    jump_m: f64,
    ratios: Vec<f64>,
}

impl Sum {
    fn add(&mut self, maps: &[Judged]) {
        for map in maps {
            self.jump_m = self.jump_m.max(map.jump_m.unwrap_or(0.0));
            if map.stranger {
                self.strangers += 1;
                self.refused += usize::from(!map.placed);
                self.wrong += usize::from(map.placed);
                continue;
            }
            self.maps += 1;
            self.placed += usize::from(map.placed);
            if let Some(error) = map.error_m {
                self.good += usize::from(error <= GOOD_M);
                self.wrong += usize::from(error > WRONG_M);
                self.worst_m = self.worst_m.max(error);
            }
        }
    }

    fn line(&self) -> Value {
        let mut ratios = self.ratios.clone();
        ratios.sort_by(f64::total_cmp);
        json!({
            "summary": true,
            "maps": self.maps,
            "placed": self.placed,
            "within_0.1_m": self.good,
            "wrong": self.wrong,
            "strangers": self.strangers,
            "strangers_refused": self.refused,
            "worst_error_m": self.worst_m,
            "largest_jump_m": self.jump_m,
            "least_ratio": ratios.first(),
            "median_ratio": ratios.get(ratios.len() / 2),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(error_m: Option<f64>, stranger: bool) -> Judged {
        Judged {
            placed: error_m.is_some(),
            basis: None,
            stranger,
            error_m: error_m.filter(|_| !stranger),
            jump_m: None,
            line: Map::new(),
        }
    }

    #[test]
    fn the_last_line_counts_good_wrong_and_refused() {
        let mut sum = Sum::default();
        sum.add(&[
            judged(Some(0.0), false),
            judged(Some(0.3), false),
            judged(Some(3.0), false),
            judged(None, false),
        ]);
        sum.add(&[judged(None, true), judged(Some(1.0), true)]);
        let line = sum.line();
        let count = |key: &str| line[key].as_u64().expect("a count");
        assert_eq!((count("maps"), count("placed"), count("within_0.1_m")), (4, 3, 1));
        assert_eq!(
            (count("wrong"), count("strangers"), count("strangers_refused")),
            (2, 2, 1)
        );
    }

    #[test]
    fn a_map_of_another_place_has_no_pose() {
        let set: LabelledSet = serde_json::from_str(
            r#"{"id": "a", "maps": ["x", "y"], "poses": [{"x": 1, "y": 2, "yaw": 3}, null], "overlaps": []}"#,
        )
        .expect("a set");
        assert!(set.poses[0].is_some() && set.poses[1].is_none());
    }
}

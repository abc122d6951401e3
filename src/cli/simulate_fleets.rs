//! Simulated fleets for `mapweld evaluate --sets` and `--growth`: lists in the format that it reads, and their maps.

use std::path::Path;

use rayon::prelude::*;
use serde_json::{Value, json};

use super::Failure;
use super::files::write;
use super::terminal::{say, tell};
use crate::codec::{encode_png, encode_yaml};
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;
use crate::simulation::{Fleet, FleetRequest, SimulationError, WorldKind, compare, generate_fleet};

/// Maps of each robot in a growth sequence.
const SNAPSHOTS: usize = 6;

/// What fleets are made with.
pub(super) struct Fleets<'a> {
    /// Where to write.
    pub(super) out: &'a Path,
    /// Seed of everything.
    pub(super) seed: u64,
    /// Kinds to go round.
    pub(super) kinds: &'a [WorldKind],
    /// Robots of a fleet.
    pub(super) robots: usize,
    /// Robots of another building.
    pub(super) strangers: usize,
}

impl Fleets<'_> {
    /// Writes sets.json and its maps, unless no set is asked for.
    pub(super) fn sets(&self, count: u64) -> Result<(), Failure> {
        self.list("sets.json", count, self.strangers, 1, |id, fleet| {
            let names = self.write_maps(id, fleet)?;
            let maps: Vec<&String> = names.iter().filter_map(|robot| robot.last()).collect();
            let poses: Vec<Option<Value>> = fleet.robots.iter().map(|r| r.pose_world_map.map(pose)).collect();
            Ok(json!({"maps": maps, "poses": poses, "overlaps": overlaps(fleet, 0)}))
        })
    }

    /// Writes growth.json and its maps, unless no sequence is asked for.
    pub(super) fn growth(&self, count: u64) -> Result<(), Failure> {
        self.list("growth.json", count, 0, SNAPSHOTS, |id, fleet| {
            let names = self.write_maps(id, fleet)?;
            let robots: Vec<Value> = (fleet.robots.iter().zip(names).enumerate())
                .map(|(number, (robot, snapshots))| {
                    json!({"name": format!("r{number}"), "snapshots": snapshots, "pose": robot.pose_world_map.map(pose)})
                })
                .collect();
            let overlaps: Vec<_> = (0..SNAPSHOTS).map(|snapshot| overlaps(fleet, snapshot)).collect();
            Ok(json!({"robots": robots, "overlaps": overlaps}))
        })
    }

    fn list(
        &self,
        file: &str,
        count: u64,
        strangers: usize,
        snapshots: usize,
        tell_of: impl Fn(&str, &Fleet) -> Result<Value, Failure> + Sync,
    ) -> Result<(), Failure> {
        if count == 0 {
            return Ok(());
        }
        let rounds = (0..).flat_map(|number| self.kinds.iter().map(move |&kind| (kind, number)));
        let wanted: Vec<(WorldKind, u64)> = rounds.zip(0..count).map(|(wanted, _)| wanted).collect();
        let made: Vec<Result<Value, SimulationError>> = wanted
            .par_iter()
            .map(|&(kind, number)| {
                let request = FleetRequest {
                    seed: self.seed,
                    kind,
                    number,
                    robots: self.robots,
                    strangers,
                    snapshots,
                };
                let fleet = match generate_fleet(&request) {
                    Ok(fleet) => fleet,
                    Err(missing) => return Ok(Err(missing)),
                };
                let what = if snapshots == 1 { "set" } else { "growth" };
                let id = format!("sim{}_{what}_{kind}_{number:03}", self.seed);
                let mut entry = json!({"id": id, "source": kind.name(), "building": fleet.building});
                let Value::Object(more) = tell_of(&id, &fleet)? else {
                    unreachable!("invariant: the entry of a fleet is an object")
                };
                entry["tags"] = json!(fleet.tags);
                for (key, value) in more {
                    entry[key] = value;
                }
                Ok(Ok(entry))
            })
            .collect::<Result<_, Failure>>()?;
        let mut entries = Vec::new();
        for entry in made {
            match entry {
                Ok(entry) => entries.push(entry),
                Err(missing) => tell(&format!("left out: {missing}"))?,
            }
        }
        let text = serde_json::to_string(&entries).map_err(anyhow::Error::from)?;
        write(self.out, file, text.as_bytes())?;
        let path = self.out.join(file);
        say(&format!(
            "{} fleets of {count} asked for in {}",
            entries.len(),
            path.display()
        ))
    }

    /// The maps' YAML files by robot and snapshot.
    fn write_maps(&self, id: &str, fleet: &Fleet) -> Result<Vec<Vec<String>>, Failure> {
        let names = fleet.robots.iter().enumerate().map(|(number, robot)| {
            let names = robot.maps.iter().enumerate().map(|(snapshot, map)| {
                let stem = format!("{id}_r{number}_s{snapshot}");
                write(self.out, &format!("maps/{stem}.png"), &encode_png(map))?;
                let yaml = encode_yaml(map.lattice(), &format!("{stem}.png"));
                write(self.out, &format!("maps/{stem}.yaml"), yaml.as_bytes())?;
                Ok(format!("maps/{stem}.yaml"))
            });
            names.collect()
        });
        names.collect()
    }
}

fn pose(pose: Pose2) -> Value {
    json!({"x": pose.x(), "y": pose.y(), "yaw": pose.yaw().radians()})
}

/// The matrix of overlaps at a snapshot; 0 with robots of another building.
fn overlaps(fleet: &Fleet, snapshot: usize) -> Vec<Vec<f64>> {
    let map = |robot: usize| -> &OccupancyGrid { &fleet.robots[robot].maps[snapshot] };
    let overlap = |a: usize, b: usize| {
        if a == b {
            return 1.0;
        }
        let [pose_a, pose_b] = [a, b].map(|robot| fleet.robots[robot].pose_world_map);
        let at = pose_a.zip(pose_b).map(|(pose_a, pose_b)| pose_a.inverse() * pose_b);
        at.map_or(0.0, |pose_a_b| compare(map(a), map(b), pose_a_b).overlap)
    };
    let all = 0..fleet.robots.len();
    all.clone()
        .map(|a| all.clone().map(|b| overlap(a, b)).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::files::MapFiles;
    use crate::codec::Limits;

    #[test]
    fn the_written_sets_and_sequences_can_be_read_and_name_a_pose_for_all_but_strangers() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::create_dir(folder.path().join("maps")).expect("a folder in it");
        let fleets = Fleets {
            out: folder.path(),
            seed: 5,
            kinds: &[WorldKind::Blocks],
            robots: 2,
            strangers: 1,
        };
        fleets.sets(1).expect("a set");
        fleets.growth(1).expect("a sequence");
        let read = |name: &str| -> Value {
            let text = std::fs::read(folder.path().join(name)).expect("the list");
            serde_json::from_slice(&text).expect("JSON")
        };
        let set = &read("sets.json")[0];
        let poses = set["poses"].as_array().expect("poses");
        assert_eq!(poses.iter().filter(|pose| pose.is_null()).count(), 1);
        let sequence = &read("growth.json")[0];
        let snapshots = sequence["robots"][1]["snapshots"].as_array().expect("snapshots");
        assert_eq!(
            (sequence["robots"].as_array().map(Vec::len), snapshots.len()),
            (Some(2), 6)
        );
        let areas: Vec<f64> = (snapshots.iter())
            .map(|path| {
                let path = folder.path().join(path.as_str().expect("a path"));
                let files = MapFiles::read(&path, &Limits::default()).expect("both files");
                files.decode(&Limits::default()).expect("a map").grid.known_area()
            })
            .collect();
        assert!(areas[0] < areas[5], "{areas:?}");
    }
}

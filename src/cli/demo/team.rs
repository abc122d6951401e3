//! The robots of the demo: who they are, the maps that they push, and where they truly are.

use crate::cli::Failure;
use crate::client::{FilePart, Upload};
use crate::codec;
use crate::geometry::Pose2;
use crate::model::RobotId;
use crate::simulation::{self, Exploration, Snapshot};

/// How many maps each robot pushes, each with more of the building than the one before.
pub(super) const PUSHES: usize = 4;

/// Their names, in the order in which they push; the first is the anchor.
const NAMES: [&str; 3] = ["ada", "bob", "cyd"];

/// A simulated robot and its growing map.
pub(super) struct Robot {
    pub(super) name: RobotId,
    exploration: Exploration,
}

/// Simulates the building and the robots.
pub(super) fn explore(seed: u64) -> Result<Vec<Robot>, Failure> {
    let building = simulation::demo_building(seed);
    let team = simulation::demo_robots(&building, NAMES.len(), PUSHES, seed)
        .map_err(|error| anyhow::Error::new(error).context(format!("cannot simulate robots with seed {seed}")))?;
    let robot = |(name, exploration): (&str, Exploration)| Robot {
        name: RobotId::parse(name).expect("invariant: the robots' names are allowed"),
        exploration,
    };
    Ok(NAMES.into_iter().zip(team).map(robot).collect())
}

impl Robot {
    /// Its map after its n-th part of the way, as a map saver writes it.
    pub(super) fn upload(&self, push: usize) -> Upload {
        let grid = &self.snapshot(push).grid;
        let image = format!("{}.png", self.name);
        Upload {
            map: FilePart::new(
                format!("{}.yaml", self.name),
                codec::encode_yaml(grid.lattice(), &image),
            ),
            image: FilePart::new(image, codec::encode_png(grid)),
        }
    }

    /// The n-th state of its map.
    pub(super) fn snapshot(&self, push: usize) -> &Snapshot {
        &self.exploration.snapshots[push]
    }

    /// Its last map.
    pub(super) fn last(&self) -> &Snapshot {
        self.snapshot(PUSHES - 1)
    }

    /// The true pose of its map's frame in the map frame of the anchor.
    pub(super) fn pose_in(&self, anchor: &Robot) -> Pose2 {
        anchor.exploration.pose_world_map.inverse() * self.exploration.pose_world_map
    }
}

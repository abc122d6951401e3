//! How the two robots of a pair differ: lidar, cells, errors, visits. Drawn once a pair.

use std::f64::consts::PI;

use super::lidar::Lidar;
use super::mapper::MapperParams;
use super::odometry::Drift;
use super::{Random, SimulationError, WorldKind};
use crate::geometry::Angle;

/// What a pair of maps is made with.
#[derive(Debug, Clone, PartialEq)]
pub struct Recipe {
    /// Both robots' lidar.
    pub lidar: Lidar,
    /// How each robot draws its map: the fixed one, the moving one.
    pub mappers: [MapperParams; 2],
    /// How both robots' beliefs go astray.
    pub drift: Drift,
    /// Share of the furniture that has moved before the second visit.
    pub moved_share: f64,
    /// Metres between scans.
    pub spacing: f64,
    /// Least and greatest way from the start that a tour goes, in metres.
    pub reach: [f64; 2],
    /// What is out of the ordinary about the pair.
    pub tags: Vec<&'static str>,
}

impl Recipe {
    /// Draws a recipe: most pairs have one or two difficulties, a third has none.
    ///
    /// # Errors
    /// Never with the ranges used here; the lidar's own check is passed on.
    pub fn draw(kind: WorldKind, random: &mut Random) -> Result<Self, SimulationError> {
        let mut tags = Vec::new();
        let noise = random.uniform(0.005, 0.03);
        let lidar = match random.below(4) {
            0 => Lidar::new(181, PI, random.uniform(10.0, 25.0), noise)?,
            1 => Lidar::new(360, 2.0 * PI, random.uniform(6.0, 10.0), noise)?,
            2 => Lidar::new(720, 2.0 * PI, random.uniform(10.0, 20.0), noise)?,
            _ => Lidar::new(361, 1.5 * PI, 12.0, noise)?,
        };
        let mut mapper = MapperParams::default();
        if random.chance(0.25) {
            tags.push("probabilistic");
            (mapper.hit, mapper.miss) = (1.0, 0.75);
        }
        if random.chance(0.15) {
            tags.push("blurred");
            mapper.blur = random.uniform(0.5, 0.9);
        }
        if random.chance(0.2) {
            tags.push("clears-without-return");
            mapper.clear_without_return = random.uniform(4.0, 8.0);
        }
        let mut mappers = [mapper; 2];
        match random.below(20) {
            0..=2 => {
                tags.push("resolution");
                mappers[random.below(2)].resolution = 0.1;
            }
            3..=4 => {
                tags.push("coarse");
                mappers = mappers.map(|m| MapperParams { resolution: 0.1, ..m });
            }
            5 => {
                tags.push("origin-yaw");
                mappers[random.below(2)].lattice_yaw = Angle::from_radians(random.uniform(-PI, PI));
            }
            _ => {}
        }
        let mut drift = Drift {
            jitter: random.uniform(0.0, 0.01),
            ..Drift::default()
        };
        if random.chance(0.2) {
            tags.push("drift");
            drift.heading = random.uniform(0.006, 0.015);
            drift.position = random.uniform(0.08, 0.25);
        }
        let moved_share = if random.chance(0.4) {
            tags.push("dynamic");
            random.uniform(0.1, 0.6)
        } else {
            0.0
        };
        let spacing = if random.chance(0.12) {
            tags.push("few-scans");
            random.uniform(1.0, 2.0)
        } else {
            random.uniform(0.3, 0.5)
        };
        let reach = match kind {
            WorldKind::Flat => [4.0, 11.0],
            WorldKind::Corridors => [8.0, 22.0],
            WorldKind::Campus => [12.0, 24.0],
            _ => [6.0, 18.0],
        };
        Ok(Self {
            lidar,
            mappers,
            drift,
            moved_share,
            spacing,
            reach,
            tags,
        })
    }
}

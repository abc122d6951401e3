//! Simulation: seeded worlds, robots that drive through them with a lidar, the maps that they draw, and labelled pairs
//! of such maps for tests and experiments.
//!
//! Imports `geometry` and `grid`. Pure: the same seed gives the same bytes.
//!
//! The way of a map: [`World`] (what stands where) -> [`Scene`] (one visit of it, as a lidar meets it) -> [`Tour`]
//! (where a robot drives) -> [`DriveLog`] (what it saw, and where it believed to be) -> [`draw`] (its map).
//! [`explore`] goes the whole way and tells where the map's frame truly is.

mod buildings;
mod compare;
mod drive;
mod explore;
mod fleet;
mod furniture;
mod lidar;
mod mapper;
mod numbers;
mod odometry;
mod pairs;
mod preview;
mod recipe;
mod scene;
mod shape;
mod tour;
mod world;

pub use crate::random::Random;
pub use compare::{Comparison, compare};
pub use drive::DriveLog;
pub use explore::{Exploration, Robot, Snapshot, demo_building, demo_robots, explore};
pub use fleet::{Fleet, FleetRequest, FleetRobot, generate_fleet};
pub use lidar::{Lidar, Observation};
pub use mapper::{Mapper, MapperParams, draw};
pub use odometry::Drift;
pub use pairs::{MapPair, PairRequest, Relation, Truth, generate_pair};
pub use recipe::Recipe;
pub use scene::Scene;
pub use shape::Shape;
pub use tour::{Planner, Region, Tour};
pub use world::{World, WorldKind};

/// Why a simulation cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// No kind of world has this name.
    #[error(
        "there is no kind of world called {0:?}; there are office, repetitive, hall, angled, clutter, flat, corridors, \
         blocks and campus"
    )]
    UnknownKind(String),
    /// A parameter is out of range.
    #[error("{field} {value} is out of range: it must lie within {low} and {high}{unit}")]
    OutOfRange {
        /// Which parameter.
        field: &'static str,
        /// What was given.
        value: f64,
        /// The least that is allowed.
        low: f64,
        /// The greatest that is allowed.
        high: f64,
        /// Unit, with a space before it; empty for counts and shares.
        unit: &'static str,
    },
    /// Nowhere to drive from there.
    #[error("a robot of radius {radius} m cannot stand at or near ({x}, {y}) m")]
    NoRoom {
        /// Metres along x.
        x: f64,
        /// Metres along y.
        y: f64,
        /// Metres.
        radius: f64,
    },
    /// A robot that has not moved or has seen nothing has no map.
    #[error("a drive without any lidar return gives no map")]
    NothingSeen,
    /// No tour was found that overlaps an earlier one.
    #[error("world {world} has no room for {robots} robots: after {tours} tours none of many overlaps an earlier one")]
    NoFleet {
        /// Where.
        world: String,
        /// How many robots were asked for.
        robots: usize,
        /// How many tours were found.
        tours: usize,
    },
    /// No pair of maps was found that is as asked for.
    #[error("no {relation} pair in world {world} after {tries} tries")]
    NoPair {
        /// What was looked for.
        relation: Relation,
        /// Where.
        world: String,
        /// How often.
        tries: usize,
    },
}

/// Refuses a value outside of [low, high], and what is no number.
fn within(field: &'static str, value: f64, low: f64, high: f64, unit: &'static str) -> Result<f64, SimulationError> {
    if (low..=high).contains(&value) {
        Ok(value)
    } else {
        Err(SimulationError::OutOfRange {
            field,
            value,
            low,
            high,
            unit,
        })
    }
}

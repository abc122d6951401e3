//! Angles and rigid poses in the plane.
//!
//! Imports nothing of the crate; every other room may import it. Metres and radians, x right, y up, counter-clockwise
//! (REP 103).

mod angle;
mod pose;

pub use angle::Angle;
pub use pose::{Motion, Pose2};

/// A point or vector in the plane: `[x, y]` in metres.
pub type Point = [f64; 2];

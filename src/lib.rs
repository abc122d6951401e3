//! mapweld welds the occupancy grid maps of many robots into one.

pub mod api;
pub mod cli;
#[cfg(feature = "client")]
pub mod client;
pub mod clock;
pub mod codec;
pub mod compute;
pub mod fusion;
pub mod geometry;
pub mod grid;
pub mod model;
pub mod registration;
pub mod simulation;
#[cfg(feature = "server")]
pub mod store;

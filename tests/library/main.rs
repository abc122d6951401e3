//! The library through its public doors, without any feature: known transforms, refusals, determinism, files.

mod departures;
mod map_files;
mod shared;

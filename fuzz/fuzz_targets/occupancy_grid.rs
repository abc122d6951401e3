//! `nav_msgs/OccupancyGrid` as JSON.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| mapweld_fuzz::occupancy_grid(bytes));

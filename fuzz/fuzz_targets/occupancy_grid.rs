//! `nav_msgs/OccupancyGrid` as JSON: read, kept, written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mapweld::codec::{Decoded, decode_occupancy_grid, encode_occupancy_grid};
use mapweld_fuzz::{limits, must_be_kept};

fuzz_target!(|bytes: &[u8]| {
    let Ok(grid) = decode_occupancy_grid(bytes, &limits()) else {
        return;
    };
    let again = decode_occupancy_grid(&encode_occupancy_grid(&grid, "map"), &limits()).expect("our own message");
    assert_eq!(again.cells(), grid.cells());
    must_be_kept(&Decoded {
        grid,
        warnings: Vec::new(),
    });
});

//! Map files: read, and what is read can be written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mapweld::codec::{MapYaml, encode_yaml};
use mapweld::grid::Lattice;
use mapweld_fuzz::limits;

fuzz_target!(|bytes: &[u8]| {
    let Ok(map) = MapYaml::parse(bytes, &limits()) else {
        return;
    };
    let Ok(lattice) = Lattice::new(2, 2, map.meta.resolution(), map.meta.origin()) else {
        return;
    };
    let again = MapYaml::parse(encode_yaml(&lattice, &map.image).as_bytes(), &limits()).expect("our own file");
    assert_eq!(again.image, map.image);
    assert_eq!(again.meta.origin(), map.meta.origin());
});

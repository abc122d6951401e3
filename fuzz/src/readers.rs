//! The readers of strangers' bytes, and what must hold of all that they take.

use mapweld::codec::{
    Decoded, Limits, MapMeta, MapMode, MapYaml, decode_cells, decode_image, decode_occupancy_grid, encode_cells,
    encode_occupancy_grid, encode_yaml,
};
use mapweld::geometry::Pose2;
use mapweld::grid::Lattice;

/// Small limits: what is slow or large at most is found all the same, and sooner.
#[must_use]
pub fn limits() -> Limits {
    Limits {
        bytes: 1 << 20,
        cells: 1 << 16,
        ..Limits::default()
    }
}

/// What was taken in can be kept and read back, and is within the limits.
pub fn must_be_kept(decoded: &Decoded) {
    let lattice = decoded.grid.lattice();
    assert!(lattice.cell_count() as u64 <= limits().cells, "over the limit of cells");
    let back = decode_cells(&encode_cells(&decoded.grid)).expect("what is kept can be read");
    assert_eq!(back, decoded.grid);
}

/// Map files: read, and what is read can be written and read again.
pub fn yaml(bytes: &[u8]) {
    let Ok(map) = MapYaml::parse(bytes, &limits()) else {
        return;
    };
    let Ok(lattice) = Lattice::new(2, 2, map.meta.resolution(), map.meta.origin()) else {
        return;
    };
    let again = MapYaml::parse(encode_yaml(&lattice, &map.image).as_bytes(), &limits()).expect("our own file");
    assert_eq!(again.image, map.image);
    assert_eq!(again.meta.origin(), map.meta.origin());
}

/// Pictures of maps, PNG or PGM. The first byte picks how grey values are read.
pub fn picture(bytes: &[u8]) {
    let Some((&pick, picture)) = bytes.split_first() else {
        return;
    };
    let mode = [MapMode::Trinary, MapMode::Scale, MapMode::Raw][usize::from(pick % 3)];
    let meta = MapMeta::new(0.05, Pose2::IDENTITY).expect("a resolution within its range");
    let meta = meta.with_mode(mode).with_negate(pick & 0x80 != 0);
    if let Ok(decoded) = decode_image(picture, &meta, &limits()) {
        must_be_kept(&decoded);
    }
}

/// `nav_msgs/OccupancyGrid` as JSON: read, kept, written and read again.
pub fn occupancy_grid(bytes: &[u8]) {
    let Ok(grid) = decode_occupancy_grid(bytes, &limits()) else {
        return;
    };
    let again = decode_occupancy_grid(&encode_occupancy_grid(&grid, "map"), &limits()).expect("our own message");
    assert_eq!(again.cells(), grid.cells());
    must_be_kept(&Decoded {
        grid,
        warnings: Vec::new(),
    });
}

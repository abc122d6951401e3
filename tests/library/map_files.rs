//! Map files: hand-written ones against what they mean, written ones against their bytes, real ones read and written.

use std::fs;
use std::path::Path;

use mapweld::codec::{
    CodecError, Limits, MapMeta, MapYaml, Warning, decode_image, decode_map, decode_occupancy_grid,
    encode_occupancy_grid, encode_pgm, encode_png, encode_yaml,
};
use mapweld::geometry::{Angle, Pose2};
use mapweld::grid::{CellState, Lattice, LogOdds, OccupancyGrid};
use mapweld::model::Digest;

use crate::shared::shared_maps;

fn golden(name: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/library/golden")
        .join(name);
    fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Rows from the top, as people read pictures: # occupied, . free, ? unknown.
fn drawn(grid: &OccupancyGrid) -> String {
    let line = |row| {
        let letters = grid.row(row).iter().map(|cell| match cell.state() {
            CellState::Occupied => '#',
            CellState::Free => '.',
            CellState::Unknown => '?',
        });
        letters.chain(['\n']).collect::<String>()
    };
    (0..grid.lattice().height()).rev().map(line).collect()
}

const L_SHAPE: &str = "#####?\n#...#?\n#...##\n#....#\n######\n";

/// The map of the golden files, made here cell by cell.
fn l_shaped() -> OccupancyGrid {
    let lattice = Lattice::new(6, 5, 0.25, Pose2::new(-1.5, 2.0, Angle::from_radians(0.5))).expect("valid");
    let cells = L_SHAPE.lines().rev().flat_map(str::chars).map(|letter| match letter {
        '#' => LogOdds::OCCUPIED,
        '.' => LogOdds::FREE,
        _ => LogOdds::UNKNOWN,
    });
    OccupancyGrid::new(lattice, cells.collect()).expect("30 cells")
}

#[test]
fn a_hand_written_map_reads_as_it_is_drawn() {
    let map = decode_map(&golden("l.yaml"), &golden("l.pgm"), &Limits::default()).expect("a good map");
    assert_eq!(drawn(&map.grid), L_SHAPE);
    assert_eq!(map.grid, l_shaped());
    assert_eq!(map.warnings, []);
}

#[test]
fn a_hand_written_message_reads_as_the_same_map() {
    let grid = decode_occupancy_grid(&golden("l.json"), &Limits::default()).expect("a good message");
    assert_eq!(drawn(&grid), L_SHAPE);
    assert_eq!(grid.cells(), l_shaped().cells());
    assert!((grid.lattice().origin().yaw() - Angle::from_radians(0.5)).magnitude() < 1e-7);
}

#[test]
fn what_is_written_keeps_its_bytes() {
    let yaml = "image: l.pgm\nmode: trinary\nresolution: 0.25\norigin: [-1.5, 2, 0.5]\nnegate: 0\n\
                occupied_thresh: 0.65\nfree_thresh: 0.196\n";
    assert_eq!(encode_yaml(l_shaped().lattice(), "l.pgm"), yaml);
    let pgm = encode_pgm(&l_shaped());
    assert!(pgm.starts_with(b"P5\n6 5\n255\n\x00\x00\x00\x00\x00\xcd\x00\xfe\xfe\xfe\x00\xcd"));
    assert_eq!(encode_png(&l_shaped()), encode_png(&l_shaped()));
    assert_eq!(
        Digest::of_grid(&l_shaped()).to_string(),
        "9fcfb748fee277b9040603c1e54eee6a2f8026928d607e9868adcdb66cefd79a"
    );
}

#[test]
fn a_map_keeps_its_states_through_every_format() {
    let grid = l_shaped();
    let yaml = encode_yaml(grid.lattice(), "l.png");
    for picture in [encode_png(&grid), encode_pgm(&grid)] {
        let back = decode_map(yaml.as_bytes(), &picture, &Limits::default()).expect("our own map");
        assert_eq!(back.grid, grid);
    }
    let json = encode_occupancy_grid(&grid, "map");
    assert_eq!(
        drawn(&decode_occupancy_grid(&json, &Limits::default()).expect("our own message")),
        L_SHAPE
    );
}

#[test]
fn a_raw_upload_needs_only_resolution_and_origin() {
    let meta = MapMeta::new(0.25, Pose2::new(-1.5, 2.0, Angle::from_radians(0.5))).expect("valid");
    let map = decode_image(&encode_png(&l_shaped()), &meta, &Limits::default()).expect("a good picture");
    assert_eq!(Digest::of_grid(&map.grid), Digest::of_grid(&l_shaped()));
}

#[test]
fn an_old_free_threshold_is_followed_and_told() {
    let yaml = String::from_utf8(golden("l.yaml"))
        .expect("text")
        .replace("0.196", "0.25");
    let map = decode_map(yaml.as_bytes(), &golden("l.pgm"), &Limits::default()).expect("a good map");
    assert_eq!(drawn(&map.grid), L_SHAPE.replace('?', "."));
    assert!(matches!(map.warnings[..], [Warning::UnknownReadsFree { cells: 2, .. }]));
}

#[test]
fn limits_can_be_set_by_the_caller() {
    let limits = Limits {
        cells: 29,
        ..Limits::default()
    };
    let error = decode_map(&golden("l.yaml"), &golden("l.pgm"), &limits).expect_err("30 cells");
    assert!(matches!(
        error,
        CodecError::TooManyCells {
            width: 6,
            height: 5,
            limit: 29
        }
    ));
}

#[test]
fn real_maps_are_read_and_written_without_a_change() {
    let Some(maps) = shared_maps("real_maps_are_read_and_written_without_a_change") else {
        return;
    };
    let mut files: Vec<_> = fs::read_dir(maps.join("maps"))
        .expect("the folder of maps")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "yaml"))
        .collect();
    files.sort();
    assert!(!files.is_empty());
    for path in files.iter().step_by(files.len().div_ceil(20)) {
        let yaml = fs::read(path).expect("a map file");
        let name = path.display();
        let image = MapYaml::parse(&yaml, &Limits::default())
            .unwrap_or_else(|e| panic!("{name}: {e}"))
            .image;
        let picture = fs::read(path.with_file_name(image)).expect("its picture");
        let map = decode_map(&yaml, &picture, &Limits::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(map.warnings, [], "{name}");
        let counts = map.grid.state_counts();
        assert!(
            counts.free > 0 && counts.occupied > 0 && counts.unknown > 0,
            "{name}: {counts:?}"
        );
        let yaml = encode_yaml(map.grid.lattice(), "map.png");
        let back = decode_map(yaml.as_bytes(), &encode_png(&map.grid), &Limits::default()).expect("our own map");
        assert_eq!(Digest::of_grid(&back.grid), Digest::of_grid(&map.grid), "{name}");
    }
}

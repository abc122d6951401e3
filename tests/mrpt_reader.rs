//! What mapweld writes is what another program reads: Debian's MRPT (`libmrpt-maps-dev`) as the independent reader.

use std::path::{Path, PathBuf};
use std::process::Command;

use mapweld::codec::{encode_pgm, encode_png, encode_yaml};
use mapweld::geometry::{Angle, Pose2};
use mapweld::grid::{CellState, Lattice, LogOdds, OccupancyGrid};

/// A map without any symmetry, so that no flip or shift can hide, with every kind of cell.
fn map() -> OccupancyGrid {
    let lattice = Lattice::new(61, 37, 0.05, Pose2::new(-12.5, 3.25, Angle::ZERO)).expect("valid");
    let cells = (0..lattice.cell_count()).map(|i| match (i * i / 7 + i / 61) % 11 {
        0 | 1 => LogOdds::OCCUPIED,
        2..=6 => LogOdds::FREE,
        7 => LogOdds::from_value(0.1),  // known, but undecided
        8 => LogOdds::from_value(30.0), // a sum of many maps
        _ => LogOdds::UNKNOWN,
    });
    OccupancyGrid::new(lattice, cells.collect()).expect("as many cells")
}

#[test]
fn an_independent_reader_sees_every_cell_that_was_written() {
    let Some(reader) = build_reader() else {
        return;
    };
    let grid = map();
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, picture) in [("map.png", encode_png(&grid)), ("map.pgm", encode_pgm(&grid))] {
        std::fs::write(folder.path().join(name), picture).expect("the picture is written");
        let yaml = folder.path().join("map.yaml");
        std::fs::write(&yaml, encode_yaml(grid.lattice(), name)).expect("the YAML is written");
        let output = Command::new(&reader).arg(&yaml).output().expect("the reader runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let seen = String::from_utf8(output.stdout).expect("text");
        let (place, rows) = seen.split_once('\n').expect("a first line");
        assert_eq!(place, "61 37 0.050000 -12.500000 3.250000", "{name}");
        let counts = grid.state_counts();
        for (letter, count) in [('F', counts.free), ('O', counts.occupied), ('U', counts.unknown)] {
            assert!(count > 100, "the map has enough of {letter}");
            assert_eq!(rows.matches(letter).count(), count, "cells {letter} of {name}");
        }
        let written: Vec<String> = (0..37)
            .map(|row| grid.row(row).iter().copied().map(letter).collect())
            .collect();
        assert_eq!(rows.lines().collect::<Vec<_>>(), written, "{name}");
    }
}

fn letter(cell: LogOdds) -> char {
    match cell.state() {
        CellState::Free => 'F',
        CellState::Occupied => 'O',
        CellState::Unknown => 'U',
    }
}

/// The reader's program; nothing when this machine lacks `cmake` or the library.
fn build_reader() -> Option<PathBuf> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/independent_reader");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("independent_reader");
    let configured = Command::new("cmake")
        // what was configured in a folder that has been moved since is of no use
        .arg("--fresh")
        .arg("-S")
        .arg(&source)
        .arg("-B")
        .arg(&target)
        .output();
    match configured {
        Err(error) => {
            skip(&format!("cmake does not run: {error}"));
            return None;
        }
        Ok(output) if !output.status.success() => {
            let message = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(
                message.contains("mrpt") || message.contains("CXX"),
                "cmake failed: {message}"
            );
            skip("libmrpt-maps-dev or g++ is not installed");
            return None;
        }
        Ok(_) => {}
    }
    let built = Command::new("cmake")
        .arg("--build")
        .arg(&target)
        .output()
        .expect("cmake runs");
    let message = String::from_utf8_lossy(&built.stderr);
    assert!(built.status.success(), "the reader does not build: {message}");
    Some(target.join("independent_reader"))
}

#[expect(clippy::print_stderr, reason = "a skipped test says so")]
fn skip(reason: &str) {
    eprintln!("SKIPPED an_independent_reader_sees_every_cell_that_was_written: {reason} (tests/run.sh installs it)");
}

//! The method `hough` by size of map: a flat of many rooms, drawn at 0.05 m a cell, seen in two thirds by each robot.
//!
//! `features` is what a map costs once, `search` what a pair costs. The stages of one search: `mapweld evaluate` tells
//! them in each line.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use mapweld::geometry::{Angle, Pose2};
use mapweld::grid::{Lattice, LogOdds, OccupancyGrid};
use mapweld::registration::methods::hough::Hough;
use mapweld::registration::{Method, Unhurried};

/// Rooms of changing widths on a `cells` x `cells` lattice, of which the robot saw the columns of `seen`.
fn drawn(cells: u32, seen: std::ops::Range<u32>, origin: Pose2) -> OccupancyGrid {
    let lattice = Lattice::new(cells, cells, 0.05, origin).expect("a valid lattice");
    let mut walls = vec![false; cells as usize];
    let (mut next, mut step) = (0, 61);
    while next < cells {
        walls[next as usize] = true;
        next += step;
        step = 50 + (step * 37 + 11) % 71;
    }
    let mut grid = OccupancyGrid::unknown(lattice);
    for row in 0..cells {
        for column in seen.clone() {
            let door = row % 97 < 18 || column % 89 < 18;
            let wall = (walls[row as usize] || walls[column as usize]) && !door;
            grid.cells_mut()[lattice.index(column, row)] = if wall { LogOdds::OCCUPIED } else { LogOdds::FREE };
        }
    }
    grid
}

fn registration(criterion: &mut Criterion) {
    let method = Hough::default();
    let mut group = criterion.benchmark_group("hough");
    group.sample_size(10);
    for cells in [250_u32, 500, 1000, 2000, 4000] {
        let fixed = drawn(cells, 0..cells * 2 / 3, Pose2::IDENTITY);
        let moving = drawn(
            cells,
            cells / 3..cells,
            Pose2::new(3.0, -7.0, Angle::from_degrees(33.0)),
        );
        group.bench_function(BenchmarkId::new("features", cells), |bench| {
            bench.iter(|| method.features(black_box(&fixed)));
        });
        let (fixed, moving) = (method.features(&fixed), method.features(&moving));
        group.bench_function(BenchmarkId::new("search", cells), |bench| {
            bench.iter(|| method.register(black_box(&fixed), black_box(&moving), &Unhurried));
        });
    }
    group.finish();
}

criterion_group!(benches, registration);
criterion_main!(benches);

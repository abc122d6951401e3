//! The method `hough` by size of map and by stage: a flat of many rooms, drawn at 0.05 m a cell, seen in two thirds by each
//! robot.
//!
//! `features` is what a map costs once, `search` what a pair costs, and `translation`, `coarse refinement` and so on what
//! each stage of a search does, as the method itself tells it. All on one thread; `two threads` has the same search and the
//! same features on two.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use mapweld::cli::Stopwatch;
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

fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .expect("a pool")
}

/// Both robots' maps of `cells` x `cells`.
fn pair(cells: u32) -> [OccupancyGrid; 2] {
    [
        drawn(cells, 0..cells * 2 / 3, Pose2::IDENTITY),
        drawn(
            cells,
            cells / 3..cells,
            Pose2::new(3.0, -7.0, Angle::from_degrees(33.0)),
        ),
    ]
}

const SIZES: [u32; 5] = [250, 500, 1000, 2000, 4000];

fn by_size(criterion: &mut Criterion) {
    let (method, one) = (Hough::default(), pool(1));
    let mut group = criterion.benchmark_group("hough");
    group.sample_size(10);
    for cells in SIZES {
        let [fixed, moving] = pair(cells);
        group.bench_function(BenchmarkId::new("features", cells), |bench| {
            one.install(|| bench.iter(|| method.features(black_box(&fixed))));
        });
        let (fixed, moving) = (method.features(&fixed), method.features(&moving));
        group.bench_function(BenchmarkId::new("search", cells), |bench| {
            one.install(|| bench.iter(|| method.register(black_box(&fixed), black_box(&moving), &Unhurried)));
        });
    }
    group.finish();
}

fn by_stage(criterion: &mut Criterion) {
    let (method, one) = (Hough::default(), pool(1));
    let mut group = criterion.benchmark_group("hough stages");
    group.sample_size(10);
    for cells in SIZES {
        let [fixed, moving] = pair(cells).map(|map| method.features(&map));
        let search = || one.install(|| method.register(black_box(&fixed), black_box(&moving), &Stopwatch::start()));
        let stages: Vec<&str> = search().stages().iter().map(|stage| stage.stage).collect();
        for (index, stage) in stages.into_iter().enumerate() {
            group.bench_function(BenchmarkId::new(stage, cells), |bench| {
                bench.iter_custom(|times| (0..times).map(|_| search().stages()[index].duration).sum());
            });
        }
    }
    group.finish();
}

fn two_threads(criterion: &mut Criterion) {
    let (method, two) = (Hough::default(), pool(2));
    let mut group = criterion.benchmark_group("hough two threads");
    group.sample_size(10);
    for cells in [500, 1000, 4000] {
        let [fixed, moving] = pair(cells);
        group.bench_function(BenchmarkId::new("features", cells), |bench| {
            two.install(|| bench.iter(|| method.features(black_box(&fixed))));
        });
        let (fixed, moving) = (method.features(&fixed), method.features(&moving));
        group.bench_function(BenchmarkId::new("search", cells), |bench| {
            two.install(|| bench.iter(|| method.register(black_box(&fixed), black_box(&moving), &Unhurried)));
        });
    }
    group.finish();
}

criterion_group!(benches, by_size, by_stage, two_threads);
criterion_main!(benches);

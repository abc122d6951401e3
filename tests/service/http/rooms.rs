//! A small building, and maps of parts of it, each in its own frame.

use mapweld::codec::{encode_pgm, encode_png, encode_yaml};
use mapweld::geometry::{Angle, Pose2};
use mapweld::grid::{Lattice, LogOdds, OccupancyGrid, resample};

/// The two files of a map.
#[derive(Clone)]
pub(crate) struct Files {
    pub(crate) yaml_name: String,
    pub(crate) yaml: Vec<u8>,
    pub(crate) image_name: String,
    pub(crate) image: Vec<u8>,
}

impl Files {
    /// A map as `NAME.yaml` and `NAME.pgm`.
    pub(crate) fn of(name: &str, grid: &OccupancyGrid) -> Self {
        let image_name = format!("{name}.pgm");
        Self {
            yaml_name: format!("{name}.yaml"),
            yaml: encode_yaml(grid.lattice(), &image_name).into_bytes(),
            image: encode_pgm(grid),
            image_name,
        }
    }

    /// A map as `NAME.yaml` and `NAME.png`.
    pub(crate) fn with_png(name: &str, grid: &OccupancyGrid) -> Self {
        let image_name = format!("{name}.png");
        Self {
            yaml_name: format!("{name}.yaml"),
            yaml: encode_yaml(grid.lattice(), &image_name).into_bytes(),
            image: encode_png(grid),
            image_name,
        }
    }
}

const RESOLUTION: f64 = 0.05;

fn lattice(width: u32, height: u32) -> Lattice {
    Lattice::new(width, height, RESOLUTION, Pose2::IDENTITY).expect("valid")
}

/// A floor of 20 x 14 m: rooms of different sizes, doors, pillars and a slanted wall, so that no part looks like another.
pub(crate) fn building() -> OccupancyGrid {
    let lattice = lattice(400, 280);
    let mut grid = OccupancyGrid::new(lattice, vec![LogOdds::FREE; lattice.cell_count()]).expect("as many");
    let mut fill = |x: u32, y: u32, width: u32, height: u32, value: LogOdds| {
        for row in y..y + height {
            for column in x..x + width {
                grid.cells_mut()[lattice.index(column, row)] = value;
            }
        }
    };
    for (x, y, width, height) in [
        (0, 0, 400, 3),
        (0, 277, 400, 3),
        (0, 0, 3, 280),
        (397, 0, 3, 280),
        (130, 0, 3, 120),
        (130, 160, 3, 120),
        (0, 100, 90, 3),
        (210, 180, 187, 3),
        (250, 60, 3, 120),
        (250, 60, 90, 3),
        (330, 120, 67, 3),
        (180, 230, 3, 50),
        (60, 190, 14, 14),
        (95, 215, 9, 22),
        (40, 40, 25, 8),
        (170, 60, 20, 20),
        (210, 120, 10, 10),
        (300, 20, 8, 30),
        (360, 60, 18, 12),
        (280, 230, 30, 9),
        (350, 205, 9, 30),
    ] {
        fill(x, y, width, height, LogOdds::OCCUPIED);
    }
    for step in 0..70 {
        fill(140 + step, 190 + step / 2, 2, 2, LogOdds::OCCUPIED);
    }
    grid
}

/// What a robot has mapped of the building between `left` and `right` (metres), in its own frame, whose pose in the
/// building is `pose_building_map`.
pub(crate) fn part(left: f64, right: f64, pose_building_map: Pose2) -> OccupancyGrid {
    let mut seen = building();
    let whole = *seen.lattice();
    for row in 0..whole.height() {
        for column in 0..whole.width() {
            let [x, _] = whole.cell_center(column, row);
            if !(left..=right).contains(&x) {
                seen.cells_mut()[whole.index(column, row)] = LogOdds::UNKNOWN;
            }
        }
    }
    let pose_map_building = pose_building_map.inverse();
    let corners = whole.corners().map(|corner| pose_map_building.apply(corner));
    let low = |axis: usize| corners.iter().map(|corner| corner[axis]).fold(f64::INFINITY, f64::min);
    let origin = Pose2::new(low(0).floor(), low(1).floor(), Angle::ZERO);
    let target = Lattice::new(520, 520, RESOLUTION, origin).expect("valid");
    resample(&seen, pose_map_building, target)
}

/// Three robots' maps, which overlap: `[a, b, c]`, and the poses of their frames in that of the first.
pub(crate) fn three_robots() -> ([OccupancyGrid; 3], [Pose2; 3]) {
    let poses = [
        Pose2::new(2.0, 3.0, Angle::ZERO),
        Pose2::new(9.0, 6.0, Angle::from_degrees(34.0)),
        Pose2::new(15.0, 2.0, Angle::from_degrees(-71.0)),
    ];
    let maps = [
        part(0.0, 13.0, poses[0]),
        part(4.0, 20.0, poses[1]),
        part(8.0, 20.0, poses[2]),
    ];
    (maps, poses.map(|pose| poses[0].inverse() * pose))
}

/// A small map of which `seed` makes different ones; far too little to be registered.
pub(crate) fn scrap(seed: u32) -> OccupancyGrid {
    let lattice = lattice(24, 16);
    let mut grid = OccupancyGrid::new(lattice, vec![LogOdds::FREE; lattice.cell_count()]).expect("as many");
    for bit in 0..24 {
        if seed >> bit & 1 == 1 {
            grid.cells_mut()[lattice.index(bit, 3)] = LogOdds::OCCUPIED;
        }
    }
    grid.cells_mut()[lattice.index(0, 0)] = LogOdds::UNKNOWN;
    grid
}

/// A hall that looks the same when it is turned by half: `[a, b]`, two robots' maps of it, and the pose of b's frame in
/// a's. From the maps alone nobody can tell which way round b lies.
pub(crate) fn two_maps_of_a_symmetric_hall() -> ([OccupancyGrid; 2], Pose2) {
    let lattice = lattice(300, 200);
    let mut hall = OccupancyGrid::new(lattice, vec![LogOdds::FREE; lattice.cell_count()]).expect("as many");
    let mut wall = |x: u32, y: u32, width: u32, height: u32| {
        for row in y..y + height {
            for column in x..x + width {
                // and its twin, half a turn about the middle of the hall away
                hall.cells_mut()[lattice.index(column, row)] = LogOdds::OCCUPIED;
                hall.cells_mut()[lattice.index(299 - column, 199 - row)] = LogOdds::OCCUPIED;
            }
        }
    };
    for (x, y, width, height) in [
        (0, 0, 300, 3),
        (0, 0, 3, 200),
        (60, 0, 3, 70),
        (60, 110, 70, 3),
        (130, 40, 25, 12),
        (20, 150, 14, 14),
        (100, 0, 3, 40),
    ] {
        wall(x, y, width, height);
    }
    let pose = Pose2::new(3.0, 2.0, Angle::from_degrees(25.0));
    let origin = Pose2::new(-12.0, -12.0, Angle::ZERO);
    let target = Lattice::new(560, 560, RESOLUTION, origin).expect("valid");
    let turned = resample(&hall, pose.inverse(), target);
    ([hall, turned], pose)
}

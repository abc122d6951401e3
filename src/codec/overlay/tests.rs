use super::*;
use crate::geometry::Angle;
use crate::grid::LogOdds;
use palette::{INK, PAPER};

fn lattice(width: u32, height: u32) -> Lattice {
    Lattice::new(width, height, 0.05, Pose2::IDENTITY).expect("valid")
}

/// A room: walls around free space.
fn room(width: u32, height: u32) -> OccupancyGrid {
    let mut grid = OccupancyGrid::unknown(lattice(width, height));
    for row in 0..height {
        for column in 0..width {
            let wall = row == 0 || column == 0 || row == height - 1 || column == width - 1;
            let index = grid.lattice().index(column, row);
            grid.cells_mut()[index] = if wall { LogOdds::OCCUPIED } else { LogOdds::FREE };
        }
    }
    grid
}

fn layer<'a>(name: &'a str, grid: &'a OccupancyGrid, x: f64, y: f64) -> OverlayLayer<'a> {
    OverlayLayer {
        name,
        grid,
        pose_target_map: Pose2::new(x, y, Angle::ZERO),
    }
}

fn whole(fused: &Lattice) -> View {
    View {
        lattice: *fused,
        column: 0,
        row: 0,
        fused_width: fused.width(),
    }
}

fn painted(view: &View, layer: OverlayLayer<'_>, scale: Scale) -> Picture {
    Painter {
        view,
        layers: &[layer],
        looks: &[Look::of(0, 1)],
        conflicts: &[],
        scale,
    }
    .paint()
}

#[test]
fn walls_stand_where_they_are_and_the_lowest_row_is_at_the_bottom() {
    // one wall cell in the lower left corner of the lattice, 8 pixels a cell
    let mut grid = OccupancyGrid::unknown(lattice(64, 32));
    grid.cells_mut()[0] = LogOdds::OCCUPIED;
    let layer = layer("a", &grid, 0.0, 0.0);
    let view = whole(grid.lattice());
    let picture = painted(&view, layer, Scale { up: 8, down: 1 });
    assert_eq!((picture.width(), picture.height()), (512, 256));
    let wall = Look::of(0, 1).wall;
    assert_eq!(picture.at(0, 255), wall);
    assert_eq!(picture.at(7, 248), wall);
    assert_eq!(picture.at(8, 255), PAPER);
    assert_eq!(picture.at(0, 247), PAPER);
}

#[test]
fn the_picture_is_cut_to_what_is_known_and_conflicts_stay_in_their_place() {
    // a resolution that leaves nothing to round
    let mut grid = OccupancyGrid::unknown(Lattice::new(640, 320, 0.5, Pose2::IDENTITY).expect("valid"));
    let wall = grid.lattice().index(300, 100);
    grid.cells_mut()[wall..wall + 10].fill(LogOdds::OCCUPIED);
    let mut conflicts = vec![false; grid.lattice().cell_count()];
    conflicts[wall + 4] = true;
    // the wall, a cell for rounding, a margin of two
    let view = View::of(grid.lattice(), &[layer("a", &grid, 0.0, 0.0)]);
    assert_eq!((view.column, view.row), (297, 97));
    assert_eq!((view.lattice.width(), view.lattice.height()), (16, 7));
    let picture = overlay(grid.lattice(), &[layer("a", &grid, 0.0, 0.0)], Some(&conflicts));
    let left = (picture.width() - 16 * 8) / 2;
    let at = |column: u32| picture.at(left + column * 8 + 4, 3 * 8 + 4);
    assert_eq!(at(2), PAPER);
    assert_eq!(at(3), Look::of(0, 1).wall);
    assert_eq!(at(7), palette::hazard(7 * 8 + 4, 3 * 8 + 3));
    assert_eq!(at(12), Look::of(0, 1).wall);
    assert_eq!(at(13), PAPER);
}

#[test]
fn overlaps_are_darker_and_shared_walls_are_black() {
    let grid = room(64, 64);
    let layers = [layer("a", &grid, 0.0, 0.0), layer("b", &grid, 1.0, 0.0)];
    let picture = overlay(&lattice(84, 64), &layers, None);
    let at = |column: u32, row: u32| picture.at(column * 8 + 4, (63 - row) * 8 + 4);
    assert_eq!(at(0, 30), Look::of(0, 1).wall);
    assert_eq!(at(83, 30), Look::of(1, 1).wall);
    assert_eq!(at(30, 0), INK, "both see this wall");
    let bright = |[r, g, b]: Rgb| u32::from(r) + u32::from(g) + u32::from(b);
    assert!(bright(at(30, 5)) < bright(at(10, 5)));
    assert!(bright(at(30, 5)) < bright(at(75, 5)));
}

#[test]
fn a_wall_of_one_cell_keeps_its_colour_on_a_picture_made_smaller() {
    let mut grid = OccupancyGrid::unknown(lattice(9000, 6));
    let row = 9000 * 3;
    grid.cells_mut()[row..row + 9000].fill(LogOdds::OCCUPIED);
    let picture = overlay(grid.lattice(), &[layer("a", &grid, 0.0, 0.0)], None);
    assert!(picture.width() <= Scale::SIDE_MAX);
    assert!((0..3000).all(|x| picture.at(x, 0) == Look::of(0, 1).wall));
}

#[test]
fn contradictions_are_marked_and_told_in_the_legend() {
    let grid = room(64, 64);
    let layers = [layer("a", &grid, 0.0, 0.0)];
    let mut conflicts = vec![false; 64 * 64];
    let without = overlay(grid.lattice(), &layers, Some(&conflicts));
    assert_eq!(without, overlay(grid.lattice(), &layers, None));
    conflicts[64 * 20 + 10] = true;
    let with = overlay(grid.lattice(), &layers, Some(&conflicts));
    let yellow = |picture: &Picture| picture.pixels()[64 * 64 * 64..].contains(&palette::hazard(0, 3));
    assert!(yellow(&with) && !yellow(&without), "the legend's swatch");
    assert_eq!(with.at(84, 43 * 8), palette::hazard(84, 20 * 8 + 7));
}

#[test]
fn every_size_of_map_gives_a_picture_of_bounded_size() {
    for (width, height) in [(1, 1), (1, 2000), (5000, 1), (700, 3)] {
        let grid = OccupancyGrid::unknown(lattice(width, height));
        let picture = overlay(grid.lattice(), &[layer(&"long name ".repeat(9), &grid, 0.0, 0.0)], None);
        assert!(
            picture.width() <= 4200 && picture.height() <= 4400,
            "{width} x {height}"
        );
        assert!(picture.width() >= 400, "room for the name");
    }
    let none = overlay(&lattice(10, 10), &[], None);
    assert!(none.to_png().starts_with(b"\x89PNG"));
}

#[test]
fn layers_outside_the_lattice_are_left_out() {
    let grid = room(20, 20);
    let far = [layer("a", &grid, 1e6, 0.0)];
    let picture = overlay(grid.lattice(), &far, None);
    assert_eq!(picture.at(4, 4), PAPER);
}

#[test]
fn strips_do_not_show() {
    // more than one strip, turned: each pixel is what the whole map says there
    let fused = lattice(1500, 1500);
    let grid = room(700, 500);
    let placed = OverlayLayer {
        name: "a",
        grid: &grid,
        pose_target_map: Pose2::new(30.0, 20.0, Angle::from_degrees(30.0)),
    };
    let resampled = crate::grid::resample(&grid, placed.pose_target_map, fused);
    let scale = Scale { up: 1, down: 1 };
    let in_strips = painted(&whole(&fused), placed, scale);
    let at_once = painted(&whole(&fused), layer("a", &resampled, 0.0, 0.0), scale);
    let differing = in_strips
        .pixels()
        .iter()
        .zip(at_once.pixels())
        .filter(|(a, b)| a != b)
        .count();
    assert!(
        differing <= 5,
        "{differing} pixels differ by more than rounding on cell borders"
    );
}

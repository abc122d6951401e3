//! Maps, merged maps and Hough images as rasters.

use super::figure::{Axis, Panel, Raster, Rgb};
use super::numbers::{index, real};
use crate::geometry::{Angle, Pose2};
use crate::grid::{CellState, Lattice, OccupancyGrid, resample};
use crate::registration::methods::hough_peaks::HoughView;

const UNKNOWN: Rgb = [205, 205, 205];
const FREE: Rgb = [255, 255, 255];
const WALL: Rgb = [0, 0, 0];

/// A map in its own frame, in metres: walls black, free space white, the rest grey.
pub(super) fn map_panel(title: &str, map: &OccupancyGrid) -> Panel {
    let lattice = upright(&[(map, Pose2::IDENTITY)]);
    let laid = resample(map, Pose2::IDENTITY, lattice);
    let pixels = rows_from_top(&lattice, |cell| match laid.cells()[cell].state() {
        CellState::Unknown => UNKNOWN,
        CellState::Free => FREE,
        CellState::Occupied => WALL,
    });
    panel_of(title, &lattice, pixels)
}

/// Maps in one frame, each with its pose in it and its colour: walls in the map's colour, black where several have one;
/// free space tinted.
pub(super) fn merged_panel(title: &str, maps: &[(&OccupancyGrid, Pose2, Rgb)]) -> Panel {
    let placed: Vec<(&OccupancyGrid, Pose2)> = maps.iter().map(|(map, pose, _)| (*map, *pose)).collect();
    let lattice = upright(&placed);
    let laid: Vec<(OccupancyGrid, Rgb)> = maps
        .iter()
        .map(|(map, pose, color)| (resample(map, *pose, lattice), *color))
        .collect();
    let pixels = rows_from_top(&lattice, |cell| {
        let of = |wanted: CellState| {
            let in_state = laid.iter().filter(move |(map, _)| map.cells()[cell].state() == wanted);
            in_state.map(|(_, color)| *color).collect::<Vec<Rgb>>()
        };
        match of(CellState::Occupied)[..] {
            [] => of(CellState::Free)
                .into_iter()
                .map(tint)
                .reduce(darker)
                .unwrap_or(UNKNOWN),
            [color] => color,
            _ => WALL,
        }
    });
    panel_of(title, &lattice, pixels)
}

/// A Hough image: the more votes the darker, by their square root so that short walls are seen as well.
pub(super) fn hough_panel(title: &str, view: &HoughView) -> Panel {
    let most = (0..view.columns())
        .flat_map(|c| view.column(c))
        .copied()
        .max()
        .unwrap_or(0);
    let (width, height) = (view.columns(), view.bins());
    let mut pixels = Vec::with_capacity(width * height);
    for row in 0..height {
        let bin = height - 1 - row;
        pixels.extend((0..width).map(|column| {
            let share = (f64::from(view.column(column)[bin]) / f64::from(most.max(1))).sqrt();
            heat(share)
        }));
    }
    let reach = real(height) / 2.0;
    let x = Axis::new("theta [deg]", -90.0, 90.0);
    let y = Axis::new("rho [cells]", -reach, reach);
    Panel::new(title, x, y).with_raster(Raster { width, height, pixels }, false)
}

/// Values on a lattice of columns and rows (row 0 below), the greatest darkest; grey where there is none.
pub(super) fn heat_raster(width: usize, height: usize, value: impl Fn(usize, usize) -> Option<f64>) -> Raster {
    let values: Vec<Option<f64>> = (0..height)
        .rev()
        .flat_map(|row| (0..width).map(move |column| (column, row)))
        .map(|(column, row)| value(column, row))
        .collect();
    let (low, high) = values
        .iter()
        .flatten()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(*v), high.max(*v))
        });
    let shade = |value: &Option<f64>| value.map_or(UNKNOWN, |v| heat((v - low) / (high - low).max(f64::MIN_POSITIVE)));
    Raster {
        width,
        height,
        pixels: values.iter().map(shade).collect(),
    }
}

/// 0 white, 1 nearly black, over yellow, orange and violet: falls in lightness all the way.
fn heat(share: f64) -> Rgb {
    const STOPS: [Rgb; 5] = [
        [255, 255, 255],
        [253, 212, 120],
        [235, 120, 60],
        [150, 40, 110],
        [20, 10, 60],
    ];
    let at = share.clamp(0.0, 1.0) * 4.0;
    let below = super::numbers::count(at.floor()).min(3);
    let part = at - real(below);
    [0, 1, 2].map(|k| {
        let (from, to) = (f64::from(STOPS[below][k]), f64::from(STOPS[below + 1][k]));
        byte(from + (to - from) * part)
    })
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between two bytes"
)]
fn byte(value: f64) -> u8 {
    value.round() as u8
}

fn tint(color: Rgb) -> Rgb {
    color.map(|c| byte(255.0 - (255.0 - f64::from(c)) * 0.25))
}

fn darker(a: Rgb, b: Rgb) -> Rgb {
    [0, 1, 2].map(|k| byte(f64::midpoint(f64::from(a[k]), f64::from(b[k])) - 12.0_f64.min(f64::from(a[k].min(b[k])))))
}

/// The smallest lattice without yaw, in the finest of the maps' cells, that holds all of them.
fn upright(maps: &[(&OccupancyGrid, Pose2)]) -> Lattice {
    let resolution = maps
        .iter()
        .map(|(map, _)| map.lattice().resolution())
        .fold(f64::INFINITY, f64::min);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for (map, pose) in maps {
        for corner in map.lattice().corners() {
            let at = pose.apply(corner);
            low = [low[0].min(at[0]), low[1].min(at[1])];
            high = [high[0].max(at[0]), high[1].max(at[1])];
        }
    }
    let cells = |k: usize| index(((high[k] - low[k]) / resolution).ceil()).max(1);
    Lattice::new(cells(0), cells(1), resolution, Pose2::new(low[0], low[1], Angle::ZERO))
        .expect("invariant: maps of one building fit on a lattice")
}

fn rows_from_top(lattice: &Lattice, color: impl Fn(usize) -> Rgb) -> Vec<Rgb> {
    let rows = (0..lattice.height()).rev();
    rows.flat_map(|row| (0..lattice.width()).map(move |column| (column, row)))
        .map(|(column, row)| color(lattice.index(column, row)))
        .collect()
}

fn panel_of(title: &str, lattice: &Lattice, pixels: Vec<Rgb>) -> Panel {
    let [low, _, high, _] = lattice.corners();
    let raster = Raster {
        width: lattice.width() as usize,
        height: lattice.height() as usize,
        pixels,
    };
    Panel::new(
        title,
        Axis::new("x [m]", low[0], high[0]),
        Axis::new("y [m]", low[1], high[1]),
    )
    .with_raster(raster, true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::LogOdds;

    fn map(cells: [LogOdds; 2]) -> OccupancyGrid {
        let lattice = Lattice::new(2, 1, 1.0, Pose2::IDENTITY).expect("valid");
        OccupancyGrid::new(lattice, cells.to_vec()).expect("two cells")
    }

    #[test]
    fn walls_that_several_maps_have_are_black_and_those_of_one_have_its_colour() {
        let (blue, red) = ([0, 0, 255], [255, 0, 0]);
        let (a, b) = (
            map([LogOdds::OCCUPIED, LogOdds::OCCUPIED]),
            map([LogOdds::OCCUPIED, LogOdds::UNKNOWN]),
        );
        let panel = merged_panel("", &[(&a, Pose2::IDENTITY, blue), (&b, Pose2::IDENTITY, red)]);
        assert_eq!(panel.raster.expect("a raster").pixels, [WALL, blue]);
        let moved = merged_panel(
            "",
            &[
                (&a, Pose2::IDENTITY, blue),
                (&b, Pose2::new(2.0, 0.0, Angle::ZERO), red),
            ],
        );
        assert_eq!(moved.raster.expect("a raster").pixels, [blue, blue, red, UNKNOWN]);
    }

    #[test]
    fn heat_falls_in_lightness() {
        let lightness = |share: f64| heat(share).iter().map(|c| u32::from(*c)).sum::<u32>();
        assert!((0..100_u32).all(|k| lightness(f64::from(k) / 100.0) >= lightness(f64::from(k + 1) / 100.0)));
        assert_eq!(heat(0.0), [255; 3]);
    }
}

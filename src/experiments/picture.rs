//! Maps, merged maps and Hough images as rasters.

use super::figure::{Axis, Mark, Panel, Raster, Rgb, Series};
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

/// A map in a merged picture.
pub(super) struct Laid<'a> {
    /// For the legend.
    pub(super) name: &'a str,
    pub(super) map: &'a OccupancyGrid,
    /// Pose of the map's frame in that of the picture.
    pub(super) pose: Pose2,
    pub(super) color: Rgb,
}

/// Maps in one frame: walls in the map's colour, black where several have one; free space tinted in the map's colour, white
/// where several know it.
pub(super) fn merged_panel(title: &str, maps: &[Laid<'_>]) -> Panel {
    let placed: Vec<(&OccupancyGrid, Pose2)> = maps.iter().map(|laid| (laid.map, laid.pose)).collect();
    let lattice = upright(&placed);
    let laid: Vec<(OccupancyGrid, Rgb)> = maps
        .iter()
        .map(|laid| (resample(laid.map, laid.pose, lattice), laid.color))
        .collect();
    let pixels = rows_from_top(&lattice, |cell| {
        let of = |wanted: CellState| {
            let in_state = laid.iter().filter(move |(map, _)| map.cells()[cell].state() == wanted);
            in_state.map(|(_, color)| *color).collect::<Vec<Rgb>>()
        };
        match of(CellState::Occupied)[..] {
            [] => match of(CellState::Free)[..] {
                [] => UNKNOWN,
                [color] => tint(color),
                _ => FREE,
            },
            [color] => color,
            _ => WALL,
        }
    });
    let panel = panel_of(title, &lattice, pixels);
    // swatches for the legend alone
    maps.iter().fold(panel, |panel, laid| {
        panel.with(Series::new(laid.name, laid.color, Mark::Bar(100), Vec::new()))
    })
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

/// The smallest lattice without yaw that holds all that the maps know. Its cells are half as wide as the finest of theirs: a
/// wall one cell wide, turned, would have gaps in cells of its own size.
fn upright(maps: &[(&OccupancyGrid, Pose2)]) -> Lattice {
    let resolution = maps
        .iter()
        .map(|(map, _)| map.lattice().resolution())
        .fold(f64::INFINITY, f64::min);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for (map, pose) in maps {
        let lattice = map.lattice();
        let known = (0..lattice.height())
            .flat_map(|row| (0..lattice.width()).map(move |column| (column, row)))
            .filter(|(column, row)| map.at(*column, *row).state() != CellState::Unknown);
        for (column, row) in known {
            let at = pose.apply(lattice.cell_center(column, row));
            low = [0, 1].map(|k| low[k].min(at[k]));
            high = [0, 1].map(|k| high[k].max(at[k]));
        }
    }
    if low[0] > high[0] {
        (low, high) = ([0.0; 2], [0.0; 2]); // nothing is known
    }
    // up to the cells' sides
    let (low, high) = (
        low.map(|at| at - resolution / 2.0),
        high.map(|at| at + resolution / 2.0),
    );
    let cell = resolution / 2.0;
    let cells = |k: usize| index(((high[k] - low[k]) / cell - 1e-6).ceil()).max(1);
    Lattice::new(cells(0), cells(1), cell, Pose2::new(low[0], low[1], Angle::ZERO))
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
    .on_ground(UNKNOWN)
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
        // the first row of pixels, two a cell
        let row = |pose: Pose2| {
            let laid = [("a", &a, Pose2::IDENTITY, blue), ("b", &b, pose, red)];
            let laid = laid.map(|(name, map, pose, color)| Laid { name, map, pose, color });
            let raster = merged_panel("", &laid).raster.expect("a raster");
            assert_eq!((raster.height, raster.pixels.len()), (2, 2 * raster.width));
            raster.pixels[..raster.width].to_vec()
        };
        assert_eq!(row(Pose2::IDENTITY), [WALL, WALL, blue, blue]);
        // where nothing is known the picture ends
        assert_eq!(
            row(Pose2::new(2.0, 0.0, Angle::ZERO)),
            [blue, blue, blue, blue, red, red]
        );
    }

    #[test]
    fn free_space_of_several_maps_is_white_and_told_from_the_unknown_and_from_that_of_one() {
        let color = [0, 114, 178];
        let (both, one) = (
            map([LogOdds::FREE, LogOdds::FREE]),
            map([LogOdds::FREE, LogOdds::UNKNOWN]),
        );
        let laid = |map| Laid {
            name: "",
            map,
            pose: Pose2::IDENTITY,
            color,
        };
        let panel = merged_panel("", &[laid(&both), laid(&one)]);
        assert_eq!(
            panel.raster.expect("a raster").pixels[..4],
            [FREE, FREE, tint(color), tint(color)]
        );
        assert!(tint(color) != UNKNOWN && tint(color) != FREE);
    }

    #[test]
    fn a_wall_one_cell_wide_has_no_gap_however_it_is_turned() {
        let lattice = Lattice::new(60, 3, 0.05, Pose2::IDENTITY).expect("valid");
        let cells = (0..180).map(|k| if k / 60 == 1 { LogOdds::OCCUPIED } else { LogOdds::FREE });
        let wall = OccupancyGrid::new(lattice, cells.collect()).expect("as many");
        for degrees in [0.0, 5.5, 21.0, 45.0] {
            let laid = Laid {
                name: "",
                map: &wall,
                pose: Pose2::new(0.0, 0.0, Angle::from_degrees(degrees)),
                color: [200, 0, 0],
            };
            let raster = merged_panel("", &[laid]).raster.expect("a raster");
            let columns = raster.width * 9 / 10;
            let without = (raster.width / 10..columns).filter(|column| {
                (0..raster.height).all(|row| raster.pixels[row * raster.width + column] != [200, 0, 0])
            });
            assert_eq!(without.count(), 0, "{degrees} degrees");
        }
    }

    #[test]
    fn heat_falls_in_lightness() {
        let lightness = |share: f64| heat(share).iter().map(|c| u32::from(*c)).sum::<u32>();
        assert!((0..100_u32).all(|k| lightness(f64::from(k) / 100.0) >= lightness(f64::from(k + 1) / 100.0)));
        assert_eq!(heat(0.0), [255; 3]);
    }
}

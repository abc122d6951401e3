//! The lattice of a map: the only place of the crate that turns metres into cells and back.

use crate::geometry::{Point, Pose2};

/// Where the cells of a grid lie: `width` x `height` square cells of side `resolution` metres, and `origin`, the pose
/// of the lower-left CORNER of cell (0, 0) in the map's frame, yaw honoured. Row 0 is the lowest row.
///
/// Invariants (refused otherwise): width and height at least 1, at most [`Lattice::CELLS_MAX`] cells, resolution within
/// [`Lattice::RESOLUTION_MIN`] and [`Lattice::RESOLUTION_MAX`], origin within [`Lattice::ORIGIN_MAX`] on each axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    width: u32,
    height: u32,
    resolution: f64,
    origin: Pose2,
}

impl Eq for Lattice {} // all its numbers are finite

/// Why there is no such lattice.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LatticeError {
    /// No cell at all.
    #[error("a map of {width} x {height} cells has no cell; width and height must be at least 1")]
    Empty {
        /// Columns asked for.
        width: u32,
        /// Rows asked for.
        height: u32,
    },
    /// More cells than can be indexed.
    #[error(
        "a map of {width} x {height} cells is over the limit of {} cells",
        Lattice::CELLS_MAX
    )]
    TooManyCells {
        /// Columns asked for.
        width: u32,
        /// Rows asked for.
        height: u32,
    },
    /// The cell size is no sensible number of metres.
    #[error(
        "resolution {0} m/cell is out of range: it must lie within {min} and {max}",
        min = Lattice::RESOLUTION_MIN,
        max = Lattice::RESOLUTION_MAX
    )]
    Resolution(f64),
    /// The origin is too far away for positions to be told to a micrometre.
    #[error("origin ({0}, {1}) m is out of range: each must lie within +-{max} m", max = Lattice::ORIGIN_MAX)]
    Origin(f64, f64),
}

impl Lattice {
    /// The most cells that a lattice can have (2^31: a 46340 x 46340 map).
    pub const CELLS_MAX: u64 = 1 << 31;
    /// The smallest cell side in metres.
    pub const RESOLUTION_MIN: f64 = 1e-3;
    /// The largest cell side in metres.
    pub const RESOLUTION_MAX: f64 = 100.0;
    /// The largest coordinate of the origin in metres.
    pub const ORIGIN_MAX: f64 = 1e8;

    /// A lattice with these invariants kept.
    ///
    /// # Errors
    /// [`LatticeError`] names the value that is out of range, and the range.
    pub fn new(width: u32, height: u32, resolution: f64, origin: Pose2) -> Result<Self, LatticeError> {
        if width == 0 || height == 0 {
            return Err(LatticeError::Empty { width, height });
        }
        if u64::from(width) * u64::from(height) > Self::CELLS_MAX {
            return Err(LatticeError::TooManyCells { width, height });
        }
        if !(Self::RESOLUTION_MIN..=Self::RESOLUTION_MAX).contains(&resolution) {
            return Err(LatticeError::Resolution(resolution));
        }
        if origin.x().abs() > Self::ORIGIN_MAX || origin.y().abs() > Self::ORIGIN_MAX {
            return Err(LatticeError::Origin(origin.x(), origin.y()));
        }
        Ok(Self {
            width,
            height,
            resolution,
            origin,
        })
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Side of a cell in metres.
    #[must_use]
    pub fn resolution(&self) -> f64 {
        self.resolution
    }

    /// Pose of the lower-left corner of cell (0, 0) in the map's frame.
    #[must_use]
    pub fn origin(&self) -> Pose2 {
        self.origin
    }

    /// Width times height.
    #[must_use]
    pub fn cell_count(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Where a cell stands in a row-major array.
    #[must_use]
    #[inline]
    pub fn index(&self, column: u32, row: u32) -> usize {
        debug_assert!(column < self.width && row < self.height);
        row as usize * self.width as usize + column as usize
    }

    /// The centre of a cell, in metres in the map's frame.
    #[must_use]
    pub fn cell_center(&self, column: u32, row: u32) -> Point {
        self.to_metres([f64::from(column) + 0.5, f64::from(row) + 0.5])
    }

    /// Lattice coordinates (in cells, the corner of cell (0, 0) at 0, its centre at 0.5) to metres in the map's frame.
    #[must_use]
    pub fn to_metres(&self, [u, v]: Point) -> Point {
        self.origin.apply([u * self.resolution, v * self.resolution])
    }

    /// Metres in the map's frame to lattice coordinates in cells; any real number, also outside of the lattice.
    #[must_use]
    pub fn to_cells(&self, point: Point) -> Point {
        let [x, y] = self.origin.inverse().apply(point);
        [x / self.resolution, y / self.resolution]
    }

    /// The cell `(column, row)` that a point of the map's frame lies in, if any.
    #[must_use]
    pub fn cell_at(&self, point: Point) -> Option<(u32, u32)> {
        self.cell_of(self.to_cells(point))
    }

    /// The cell that lattice coordinates lie in, if any.
    #[must_use]
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "in [0, width) x [0, height)"
    )]
    pub fn cell_of(&self, [u, v]: Point) -> Option<(u32, u32)> {
        let inside = u >= 0.0 && v >= 0.0 && u < f64::from(self.width) && v < f64::from(self.height);
        inside.then_some((u as u32, v as u32))
    }

    /// The four corners in the map's frame, counter-clockwise from the origin.
    #[must_use]
    pub fn corners(&self) -> [Point; 4] {
        let (w, h) = (f64::from(self.width), f64::from(self.height));
        [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]].map(|corner| self.to_metres(corner))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use proptest::prelude::*;

    #[test]
    fn origin_is_the_corner_of_cell_zero_zero_and_row_zero_is_lowest() {
        let lattice = Lattice::new(4, 3, 0.5, Pose2::new(10.0, 20.0, Angle::ZERO)).expect("valid");
        assert_eq!(lattice.cell_center(0, 0), [10.25, 20.25]);
        assert_eq!(lattice.cell_center(3, 2), [11.75, 21.25]);
        assert_eq!(lattice.cell_at([10.0, 20.0]), Some((0, 0)));
        assert_eq!(lattice.cell_at([9.999, 20.0]), None);
        assert_eq!(lattice.cell_at([12.0, 20.0]), None);
    }

    #[test]
    fn yaw_of_the_origin_is_honoured() {
        let lattice = Lattice::new(4, 3, 1.0, Pose2::new(0.0, 0.0, Angle::QUARTER_TURN)).expect("valid");
        let [x, y] = lattice.cell_center(2, 0);
        assert!((x + 0.5).abs() < 1e-12 && (y - 2.5).abs() < 1e-12);
    }

    #[test]
    fn lattices_out_of_range_are_refused_with_the_value_and_the_limit() {
        let id = Pose2::IDENTITY;
        assert!(Lattice::new(0, 3, 0.05, id).is_err());
        assert!(
            Lattice::new(65536, 65536, 0.05, id)
                .expect_err("too many")
                .to_string()
                .contains("2147483648")
        );
        assert!(
            Lattice::new(1, 1, 0.0, id)
                .expect_err("zero")
                .to_string()
                .contains("0.001")
        );
        assert!(Lattice::new(1, 1, f64::NAN, id).is_err());
        assert!(Lattice::new(1, 1, 0.05, Pose2::new(1e9, 0.0, Angle::ZERO)).is_err());
        assert!(Lattice::new(46340, 46340, 0.05, id).is_ok());
    }

    proptest! {
        #[test]
        fn a_cells_centre_lies_in_that_cell(column in 0_u32..500, row in 0_u32..400, x in -90.0..90.0_f64,
                                            y in -90.0..90.0_f64, yaw in -4.0..4.0_f64, resolution in 0.01..0.5_f64) {
            let lattice = Lattice::new(500, 400, resolution, Pose2::new(x, y, Angle::from_radians(yaw))).expect("valid");
            prop_assert_eq!(lattice.cell_at(lattice.cell_center(column, row)), Some((column, row)));
        }
    }
}

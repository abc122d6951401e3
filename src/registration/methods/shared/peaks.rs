//! Local peaks of a Hough image (eq. 20): the walls of a map as triples (theta, rho, v).
//!
//! **Method.** A bin is a local peak when it has at least `fraction` of the strongest bin's votes and no bin within
//! the separation, in directions and in cells, has more; of equal ones the one of the lower direction, then of the lower
//! rho, is the peak. The image closes on itself: beyond +90 degrees the lines of -90 degrees follow with rho negated.
//!
//! **Cost.** Bins above the fraction times the window.
//!
//! **Differences from the paper.** The paper gives no rule for what a local peak is; this one is ours.

use super::hough_image::{COLUMNS, HoughImage};

/// What a local peak is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PeakRule {
    /// Votes of the weakest local peak over those of the strongest, in (0, 1].
    pub(crate) fraction: f64,
    /// A local peak is the greatest within this many degrees to both sides, 1 to 45.
    pub(crate) separation_degrees: f64,
    /// A local peak is the greatest within this many cells to both sides.
    pub(crate) separation_cells: u32,
    /// At most so many of the strongest are kept.
    pub(crate) most: u32,
}

/// A local peak `p = (theta, rho, v)` (eq. 20).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Peak {
    /// Direction of the line's normal, as the column of a whole image: -90 degrees + column.
    pub(crate) column: usize,
    /// Distance of the line about the centre of the map's occupied cells, in cells.
    pub(crate) rho: f64,
    /// Votes.
    pub(crate) votes: f64,
}

impl Peak {
    /// The peak of the same map after half a turn about the centre.
    pub(crate) fn half_turned(self) -> Self {
        Self { rho: -self.rho, ..self }
    }
}

/// The local peaks of a whole image, the strongest first.
pub(crate) fn local_peaks(image: &HoughImage, rule: &PeakRule) -> Vec<Peak> {
    let strongest = image.columns().flatten().copied().max().unwrap_or(0);
    if strongest == 0 {
        return Vec::new();
    }
    let least = (rule.fraction * f64::from(strongest)).max(1.0);
    let mut peaks: Vec<Peak> = Vec::new();
    for (column, votes) in image.columns().enumerate() {
        for (bin, &votes) in votes.iter().enumerate() {
            if f64::from(votes) >= least && is_peak(image, column, bin, votes, rule) {
                peaks.push(Peak {
                    column,
                    rho: image.rho_of(bin),
                    votes: f64::from(votes),
                });
            }
        }
    }
    // stable: equal votes stay in the order of directions and distances
    peaks.sort_by(|a, b| b.votes.total_cmp(&a.votes));
    peaks.truncate(rule.most as usize);
    peaks
}

fn is_peak(image: &HoughImage, column: usize, bin: usize, votes: u32, rule: &PeakRule) -> bool {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "1 to 45 degrees, a column each"
    )]
    let columns = rule.separation_degrees.floor() as usize;
    let cells = rule.separation_cells as usize;
    // Departs from eq. 20, which leaves open what a local peak is: the greatest within a window that closes on itself.
    (0..=2 * columns).all(|step| {
        // column + step - columns, wrapped into the image; a wrapped column shows its lines with rho negated
        let unwrapped = column + COLUMNS + step - columns;
        let there = unwrapped % COLUMNS;
        let mirrored = unwrapped / COLUMNS != 1;
        let middle = if mirrored { image.bins() - 1 - bin } else { bin };
        let (low, high) = (middle.saturating_sub(cells), (middle + cells + 1).min(image.bins()));
        image.column(there)[low..high]
            .iter()
            .zip(low..)
            .all(|(other, other_bin)| *other < votes || (*other == votes && (there, other_bin) >= (column, bin)))
    })
}

#[cfg(test)]
mod tests {
    use super::super::hough_image::{Directions, WallPoints, to_f64};
    use super::*;
    use crate::geometry::{Angle, Point};

    /// Cells along a wall from `a` to `b`, one a cell.
    fn wall(a: Point, b: Point) -> Vec<Point> {
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        let mut points = Vec::new();
        let mut s = 0.0;
        while s < length {
            points.push([a[0] + (b[0] - a[0]) * s / length, a[1] + (b[1] - a[1]) * s / length]);
            s += 1.0;
        }
        points
    }

    const RULE: PeakRule = PeakRule {
        fraction: 0.1,
        separation_degrees: 3.0,
        separation_cells: 5,
        most: 200,
    };

    fn peaks_of(points: &[Point], rule: &PeakRule) -> (WallPoints, Vec<Peak>) {
        let points = WallPoints::about_center(points);
        let directions = Directions::half_turn_of_rotated(Angle::ZERO);
        let image = HoughImage::new(&points, directions, 3);
        let peaks = local_peaks(&image, rule);
        (points, peaks)
    }

    #[test]
    fn a_room_of_four_walls_has_four_strongest_peaks_at_its_walls() {
        let corners = [[0.5, 0.5], [120.5, 0.5], [120.5, 80.5], [0.5, 80.5]];
        let points: Vec<Point> = (0..4).flat_map(|i| wall(corners[i], corners[(i + 1) % 4])).collect();
        let (points, peaks) = peaks_of(&points, &RULE);
        let mut seen: Vec<(usize, f64)> = peaks[..4]
            .iter()
            .map(|peak| {
                let (sin, cos) = Directions::of_column(peak.column).sin_cos();
                (peak.column, peak.rho + points.center[0] * cos + points.center[1] * sin)
            })
            .collect();
        seen.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        // -90 degrees: the walls y = 0.5 and y = 80.5, rho = -y; 0 degrees: x = 0.5 and x = 120.5
        for ((column, rho), (expected_column, expected_rho)) in
            seen.into_iter().zip([(0, -80.5), (0, -0.5), (90, 0.5), (90, 120.5)])
        {
            assert_eq!(column, expected_column);
            assert!((rho - expected_rho).abs() <= 1.5, "{rho} instead of {expected_rho}");
        }
    }

    #[test]
    fn a_wall_on_the_seam_of_the_image_is_one_peak() {
        // a wall whose normal lies between +89 and +90 degrees shows on both sides of the seam
        for tilt in [-0.5_f64, 0.0, 0.5] {
            let (sin, cos) = tilt.to_radians().sin_cos();
            let points = wall([-90.0 * cos, 30.0 - 90.0 * sin], [90.0 * cos, 30.0 + 90.0 * sin]);
            let rule = PeakRule { fraction: 0.9, ..RULE };
            let (_, peaks) = peaks_of(&points, &rule);
            assert_eq!(peaks.len(), 1, "at {tilt} degrees: {peaks:?}");
        }
    }

    #[test]
    fn no_two_peaks_are_closer_than_the_separation() {
        let points: Vec<Point> = (0..900_u32)
            .map(|i| [f64::from(i % 30) * 3.0 + 0.3, f64::from(i / 30) * 2.0])
            .collect();
        let (_, peaks) = peaks_of(&points, &RULE);
        assert!(peaks.len() > 4);
        for (i, a) in peaks.iter().enumerate() {
            for b in &peaks[i + 1..] {
                let columns = a.column.abs_diff(b.column);
                let near_in_rho = |rho: f64| (a.rho - rho).abs() <= f64::from(RULE.separation_cells);
                assert!(!(columns <= 3 && near_in_rho(b.rho)));
                assert!(!(COLUMNS - columns <= 3 && near_in_rho(-b.rho)));
                assert!(a.votes >= b.votes);
            }
        }
        assert!(to_f64(peaks.len()) <= f64::from(RULE.most));
    }
}

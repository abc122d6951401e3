//! Translation by peak matching and least squares (Algorithm 2, lines 1 to 11; eq. 28 to 30).
//!
//! **Convention.** T moves the rotated moving map: `p_fixed = R(psi) p_moving + T`, in cells. A wall at distance rho' in
//! the rotated moving map is at `rho = rho' + n . T` in the fixed one (Property 1), hence
//! `rho_fixed - rho_moving = n(theta) . T`.
//!
//! **Method.**
//!
//! 1. Two walls are associated when their directions differ by at most `delta`, their votes by less than `v_gate` and
//!    their distances by less than `d_gate`; of several the nearest, by `dv / v_gate + drho / d_gate`.
//! 2. `A^T A = sum n n^T`, `A^T B = sum n (rho_fixed - rho_moving)`; T solves `A^T A T = A^T B` (eq. 30).
//! 3. Again from 1, `matching_rounds` times in all, with the moving walls shifted by T and half the `d_gate`: outliers of
//!    the first round fall out of the gate.
//! 4. Rank test: with the metres of wall as weights, the smaller eigenvalue of `sum n n^T` is the wall that holds T in the
//!    direction in which it is held worst.
//!
//! **Cost.** The product of the numbers of peaks.
//!
//! **Fails when** all associated walls are parallel (a corridor): eq. 30 is singular; the answer names the free direction.
//! `d_gate` presupposes that the maps' frames nearly coincide but for the rotation.
//!
//! **Differences from the paper.** In eq. 28 the primed map is the moved one, while Algorithm 2 moves map 2 to map 1: the
//! sign here is pinned by a test. The paper's argmin over two differences at once is read as their sum over the gates.
//! Distances are told about a pivot amid the fixed map instead of the frame's origin: for lines that are off by up to
//! delta, rho errs by delta times the lever arm. The paper has no rank test.

use super::params::{HoughPeaksParams, Pairing};
use crate::geometry::{Angle, Point};
use crate::registration::methods::shared::hough_image::{COLUMNS, Directions, to_f64};
use crate::registration::methods::shared::peaks::Peak;
use crate::registration::methods::shared::verification::smaller_eigenvalue;

/// A wall as the translation sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Line {
    /// Direction of the normal, as in [`Peak::column`].
    pub(super) column: usize,
    /// Distance about the common pivot, in cells.
    pub(super) rho: f64,
    /// Votes.
    pub(super) votes: f64,
}

/// The peaks of a map as lines about a pivot from which the map's centre lies at `center_from_pivot`, in cells.
pub(super) fn lines_about(peaks: impl Iterator<Item = Peak>, center_from_pivot: Point) -> Vec<Line> {
    peaks
        .map(|peak| {
            let (sin, cos) = Directions::of_column(peak.column).sin_cos();
            Line {
                column: peak.column,
                // Departs from eq. 28, told about the frame's origin: about a pivot amid the fixed map's walls.
                rho: peak.rho + center_from_pivot[0] * cos + center_from_pivot[1] * sin,
                votes: peak.votes,
            }
        })
        .collect()
}

/// Two walls that belong together.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Association {
    /// Unit normal of the fixed map's wall.
    normal: Point,
    /// `rho_fixed - rho_moving`, in cells.
    offset: f64,
    /// Votes of the weaker of the two.
    votes: f64,
}

/// T by matching the walls of the fixed and the rotated moving map, round after round (Algorithm 2, lines 1 to 11).
///
/// The fit is that of the last round; without a translation, that of the round which found none.
pub(super) fn matched_translation(fixed: &[Line], moving: &[Line], resolution: f64, params: &HoughPeaksParams) -> Fit {
    let mut near = Near {
        translation: [0.0, 0.0],
        d_gate: params.d_gate,
    };
    let mut fit = least_squares(&associate(fixed, moving, near, params), resolution, params);
    // Departs from section 4.2, one iteration: peaks are matched again around the T found before.
    for _ in 1..params.matching_rounds {
        let Some(translation) = fit.translation else { break };
        near = Near {
            translation,
            d_gate: near.d_gate / 2.0,
        };
        let next = least_squares(&associate(fixed, moving, near, params), resolution, params);
        if next.translation.is_none() {
            break; // what is left holds T no longer: the round before stands
        }
        fit = next;
    }
    fit
}

/// Where walls are looked for: shifted by a translation in cells, and within a gate around it.
#[derive(Debug, Clone, Copy)]
struct Near {
    translation: Point,
    d_gate: f64,
}

/// The associated walls of the fixed and the rotated moving map (Algorithm 2, lines 1 to 9).
fn associate(fixed: &[Line], moving: &[Line], near: Near, params: &HoughPeaksParams) -> Vec<Association> {
    let nearest = |line: &Line| {
        moving
            .iter()
            .filter_map(|other| couple(line, other, near, params))
            .min_by(|a, b| a.0.total_cmp(&b.0))
    };
    match params.pairing {
        // Departs from Algorithm 2 line 3, one couple a direction: every peak, as the text of section 4.2 has it.
        Pairing::EveryPeak => fixed
            .iter()
            .filter_map(nearest)
            .map(|(_, association)| association)
            .collect(),
        Pairing::BestPerAngle => (0..COLUMNS)
            .filter_map(|alpha| {
                let at_alpha = fixed.iter().filter(|line| line.column == alpha);
                at_alpha.filter_map(nearest).min_by(|a, b| a.0.total_cmp(&b.0))
            })
            .map(|(_, association)| association)
            .collect(),
    }
}

/// The distance of two walls over the gates, and their association, when they lie within all gates.
fn couple(fixed: &Line, moving: &Line, near: Near, params: &HoughPeaksParams) -> Option<(f64, Association)> {
    let columns = fixed.column.abs_diff(moving.column);
    // over the seam of the image the moving wall's other name has the nearer direction, and rho negated
    let seam = columns > COLUMNS / 2;
    let (columns, rho) = if seam {
        (COLUMNS - columns, -moving.rho)
    } else {
        (columns, moving.rho)
    };
    let (sin, cos) = Directions::of_column(fixed.column).sin_cos();
    // Departs from eq. 28, whose primed map is the moved one: B_i of eq. 29 is the fixed wall minus the rotated moving one.
    let offset = fixed.rho - rho;
    let drho = (offset - cos * near.translation[0] - sin * near.translation[1]).abs();
    let dv = (fixed.votes - moving.votes).abs();
    let within = to_f64(columns) <= params.delta_degrees && dv < params.v_gate && drho < near.d_gate; // line 6
    within.then(|| {
        let association = Association {
            normal: [cos, sin],
            offset,
            votes: fixed.votes.min(moving.votes),
        };
        // Departs from Algorithm 2 line 3, an argmin over two differences at once: the least sum of both over their gates.
        (dv / params.v_gate + drho / near.d_gate, association)
    })
}

/// What least squares say of the translation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    /// T in cells (eq. 30); `None` when the walls do not hold it.
    pub(super) translation: Option<Point>,
    /// Direction in which T is held worst.
    pub(super) weaker_direction: Angle,
    /// Metres of associated wall that hold T in that direction.
    pub(super) support_m: f64,
    /// Walls that were associated.
    pub(super) associated: usize,
}

/// Least squares over the associated walls (eq. 28 to 30), with the rank test.
fn least_squares(associations: &[Association], resolution: f64, params: &HoughPeaksParams) -> Fit {
    let (mut matrix, mut right) = ([0.0; 3], [0.0; 2]);
    let mut support = [0.0; 3];
    for association in associations {
        let [nx, ny] = association.normal;
        let wall_m = association.votes * resolution;
        for (k, product) in [nx * nx, nx * ny, ny * ny].into_iter().enumerate() {
            matrix[k] += product; // A^T A
            support[k] += wall_m * product;
        }
        right[0] += nx * association.offset; // A^T B
        right[1] += ny * association.offset;
    }
    let (support_m, weaker_direction) = (smaller_eigenvalue(support), smaller_eigenvector(support));
    let determinant = matrix[0] * matrix[2] - matrix[1] * matrix[1];
    // Departs from eq. 30, which is singular for parallel walls: a rank test.
    let held = support_m >= params.support_min_m && determinant > 1e-9;
    Fit {
        translation: held.then(|| {
            [
                (matrix[2] * right[0] - matrix[1] * right[1]) / determinant,
                (matrix[0] * right[1] - matrix[1] * right[0]) / determinant,
            ]
        }),
        weaker_direction,
        support_m,
        associated: associations.len(),
    }
}

/// The direction of the eigenvector of the smaller eigenvalue of `[[a, b], [b, c]]`.
fn smaller_eigenvector([a, b, c]: [f64; 3]) -> Angle {
    Angle::from_radians(0.5 * (2.0 * b).atan2(a - c)) + Angle::QUARTER_TURN
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Lines of a map and of the same map before it was moved by `t`.
    fn moved_lines(walls: &[(usize, f64, f64)], t: Point) -> (Vec<Line>, Vec<Line>) {
        let line = |(column, rho, votes): (usize, f64, f64)| Line { column, rho, votes };
        let fixed = walls.iter().map(|(column, rho, votes)| {
            let (sin, cos) = Directions::of_column(*column).sin_cos();
            line((*column, rho + t[0] * cos + t[1] * sin, *votes))
        });
        (fixed.collect(), walls.iter().copied().map(line).collect())
    }

    fn first_round(params: &HoughPeaksParams) -> Near {
        Near {
            translation: [0.0, 0.0],
            d_gate: params.d_gate,
        }
    }

    const WALLS: [(usize, f64, f64); 5] = [
        (0, -40.0, 200.0),
        (0, 55.0, 160.0),
        (90, 10.0, 120.0),
        (90, 90.0, 80.0),
        (140, -5.0, 40.0),
    ];

    proptest! {
        /// The sign of eq. 28: a known T of the moving map comes back as it is, not negated.
        #[test]
        fn a_known_translation_comes_back(x in -18.0..18.0_f64, y in -18.0..18.0_f64) {
            let params = HoughPeaksParams::default();
            for pairing in [Pairing::EveryPeak, Pairing::BestPerAngle] {
                let params = HoughPeaksParams { pairing, ..params.clone() };
                let (fixed, moving) = moved_lines(&WALLS, [x, y]);
                let fit = matched_translation(&fixed, &moving, 0.05, &params);
                let t = fit.translation.expect("walls in three directions");
                prop_assert!((t[0] - x).abs() < 1e-9 && (t[1] - y).abs() < 1e-9, "{t:?} instead of {x} {y}");
            }
        }

        #[test]
        fn the_closed_form_solves_the_normal_equations(offsets in prop::collection::vec(-20.0..20.0_f64, 5)) {
            let params = HoughPeaksParams::default();
            let associations: Vec<Association> = WALLS.iter().zip(&offsets).map(|((column, _, votes), offset)| {
                let (sin, cos) = Directions::of_column(*column).sin_cos();
                Association { normal: [cos, sin], offset: *offset, votes: *votes }
            }).collect();
            let t = least_squares(&associations, 0.05, &params).translation.expect("held");
            // at the least sum of squares its gradient vanishes
            let mut gradient = [0.0; 2];
            for a in &associations {
                let residual = a.offset - a.normal[0] * t[0] - a.normal[1] * t[1];
                gradient = [gradient[0] + residual * a.normal[0], gradient[1] + residual * a.normal[1]];
            }
            prop_assert!(gradient[0].abs() < 1e-9 && gradient[1].abs() < 1e-9);
        }
    }

    #[test]
    fn parallel_walls_leave_the_translation_free_along_them() {
        let params = HoughPeaksParams::default();
        let (fixed, moving) = moved_lines(&[(30, 12.0, 300.0), (31, -20.0, 250.0)], [3.0, 4.0]);
        let fit = matched_translation(&fixed, &moving, 0.05, &params);
        assert_eq!(fit.translation, None);
        assert!(fit.support_m < 0.1);
        // normals at -60 degrees: the walls run along 30 degrees
        let along = Directions::of_column(30) + Angle::QUARTER_TURN;
        assert!(
            (fit.weaker_direction - along).sin_cos().0.abs() < 0.02,
            "{}",
            fit.weaker_direction.degrees()
        );
    }

    #[test]
    fn every_gate_refuses_on_its_own() {
        let params = HoughPeaksParams::default();
        let line = |column, rho, votes| Line { column, rho, votes };
        let one = line(90, 10.0, 100.0);
        let associated = |other: Line| !associate(&[one], &[other], first_round(&params), &params).is_empty();
        assert!(associated(line(91, 39.0, 109.0)));
        assert!(!associated(line(92, 10.0, 100.0)), "delta");
        assert!(!associated(line(90, 40.0, 100.0)), "d_gate");
        assert!(!associated(line(90, 10.0, 110.0)), "v_gate");
    }

    #[test]
    fn walls_on_both_sides_of_the_seam_are_associated() {
        let params = HoughPeaksParams::default();
        let fixed = [Line {
            column: 0,
            rho: 20.0,
            votes: 100.0,
        }];
        let moving = [Line {
            column: 179,
            rho: -17.0,
            votes: 100.0,
        }];
        let associations = associate(&fixed, &moving, first_round(&params), &params);
        assert_eq!(associations.len(), 1);
        assert!((associations[0].offset - 3.0).abs() < 1e-12);
    }

    #[test]
    fn later_rounds_shed_the_outliers_of_the_first() {
        // T = (4, -3), and two walls that are in one map only but for a wall of like votes 25 cells farther
        let (mut fixed, mut moving) = moved_lines(&WALLS, [4.0, -3.0]);
        for (column, rho, votes) in [(0, 130.0, 300.0), (90, -70.0, 350.0)] {
            fixed.push(Line { column, rho, votes });
            moving.push(Line {
                column,
                rho: rho - 25.0,
                votes,
            });
        }
        let error = |matching_rounds| {
            let params = HoughPeaksParams {
                matching_rounds,
                ..HoughPeaksParams::default()
            };
            let [x, y] = matched_translation(&fixed, &moving, 0.05, &params)
                .translation
                .expect("held");
            (x - 4.0).hypot(y + 3.0)
        };
        assert!(error(1) > 5.0 && error(3) < 1e-9, "{} {}", error(1), error(3));
    }

    #[test]
    fn nothing_associated_holds_nothing() {
        let fit = least_squares(&[], 0.05, &HoughPeaksParams::default());
        assert_eq!(fit.translation, None);
        assert!(fit.support_m.abs() < 1e-12);
    }
}

//! Figures 8 to 10.

use super::step::{Step, name_of};
use crate::experiments::figure::{Axis, Figure, Mark, PALETTE, Panel, Series};
use crate::experiments::frames::reframed;
use crate::experiments::numbers::real;
use crate::experiments::picture::{Laid, heat_raster, hough_panel, map_panel, merged_panel};
use crate::geometry::{Angle, Pose2};
use crate::registration::methods::hough_peaks::{HoughView, Objective, PeakView, Spectrum, SpectrumTrace};

impl Step<'_> {
    pub(super) fn figure_8(&self, tuned: Angle) -> Figure {
        let rotated = reframed(self.moving, Pose2::new(0.0, 0.0, tuned));
        let mut panels = vec![
            map_panel("a) map 1", self.fixed),
            map_panel("b) map 2", self.moving),
            map_panel("c) map 2 after the tuned rotation", &rotated),
        ];
        let pose = self.found.or(self.trace.tuned).unwrap_or(Pose2::IDENTITY);
        let both = [
            ("map 1", self.fixed, Pose2::IDENTITY, PALETTE[0]),
            ("map 2", self.moving, pose, PALETTE[1]),
        ]
        .map(|(name, map, pose, color)| Laid { name, map, pose, color });
        panels.push(merged_panel("d) both maps after the transformation", &both));
        let caption =
            "Figure 8 of the paper: the two maps, the second rotated, and both fused; walls of both in black.";
        Figure::new("figure-8", caption, 2, panels)
    }

    pub(super) fn figure_9(&self) -> Figure {
        let mut panels = Vec::new();
        for spectrum in &self.rotations.spectra {
            panels.push(spectra_panel(spectrum));
            panels.push(self.correlation_panel(spectrum));
        }
        let caption = "Figure 9 of the paper: h(theta) of both maps and their circular cross-correlation, with f = max, the \
                       mean of non-zeros, and the entropy. Circles: candidates, with the half turn of each; broken line: the \
                       true rotation.";
        Figure::new("figure-9", caption, 2, panels)
    }

    fn correlation_panel(&self, spectrum: &SpectrumTrace) -> Panel {
        let c = &spectrum.correlation;
        let most = c.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let at = |degrees: i32| c[usize::try_from(degrees.rem_euclid(180)).unwrap_or(0)] / most;
        let points: Vec<[f64; 2]> = (-180..180).map(|d| [f64::from(d), at(d)]).collect();
        let low = points.iter().map(|p| p[1]).fold(0.0, f64::min);
        let marked = spectrum
            .candidates
            .iter()
            .flat_map(|c| [*c, *c + Angle::HALF_TURN])
            .map(|candidate| {
                let degrees = candidate.degrees();
                #[expect(clippy::cast_possible_truncation, reason = "whole degrees in (-180, 180]")]
                let whole = degrees.round() as i32;
                [degrees, at(whole)]
            });
        let truth = self.truth.yaw().degrees();
        Panel::new(
            format!("Cross-correlation, f = {}", name_of(spectrum.f)),
            Axis::new("rotation [deg]", -180.0, 180.0),
            Axis::new("correlation / greatest", low * 1.1 - 0.02, 1.15),
        )
        .with(Series::new("", PALETTE[0], Mark::Line, points))
        .with(Series::new("candidates", PALETTE[1], Mark::Circle, marked.collect()))
        .with(Series::new(
            "truth",
            PALETTE[7],
            Mark::Dashed,
            vec![[truth, low * 1.1], [truth, 1.1]],
        ))
    }

    pub(super) fn figure_10_images(&self) -> Figure {
        let panel = |title: &str, view: &HoughView, peaks: &[PeakView]| {
            let squares = peaks.iter().map(|peak| [peak.theta.degrees(), peak.rho]).collect();
            hough_panel(title, view).with(Series::new("", [20, 90, 220], Mark::Square, squares))
        };
        let panels = vec![
            panel(
                "a) Hough image of map 1 with its peaks",
                &self.trace.fixed,
                &self.trace.fixed_peaks,
            ),
            panel(
                "b) Hough image of the rotated map 2",
                &self.trace.moving,
                &self.trace.moving_peaks,
            ),
        ];
        let caption = "Figure 10 a) and b) of the paper: Hough images with their local peaks. rho is told about the middle of \
                       each map's walls. Darker: more votes, by their square root.";
        Figure::new("figure-10-peaks", caption, 2, panels)
    }

    pub(super) fn figure_10_search(&self) -> Figure {
        let reach = self.trace.objective.iter().flat_map(|o| o.shift).max().unwrap_or(0);
        let side = usize::try_from(2 * reach + 1).unwrap_or(1);
        let half = real(side) / 2.0;
        let panel = |title: &str, value: fn(&Objective) -> Option<f64>, best: Option<Objective>| {
            let raster = heat_raster(side, side, |column, row| {
                let at = |k: usize| i32::try_from(k).unwrap_or(0) - reach;
                let objective = self.trace.objective.iter().find(|o| o.shift == [at(column), at(row)])?;
                value(objective)
            });
            let x = Axis::new("shift along x [cells]", -half, half);
            let mut panel =
                Panel::new(title, x, Axis::new("shift along y [cells]", -half, half)).with_raster(raster, true);
            panel = panel.with(Series::new("T_o", [0, 130, 60], Mark::Circle, vec![[0.0, 0.0]]));
            if let Some(best) = best {
                let at = best.shift.map(f64::from);
                panel = panel.with(Series::new("best of the search", [20, 90, 220], Mark::Square, vec![at]));
            }
            if let Some(truth) = self.truth_in_search() {
                let shown = truth.map(|cells| cells.clamp(-half, half));
                panel = panel.with(Series::new("truth", [200, 0, 0], Mark::Cross, vec![shown]));
            }
            panel
        };
        let panels = vec![
            panel(
                "c) Entropy of the fused map (dark: small)",
                |o| Some(-o.entropy),
                self.best(|o| Some(o.entropy)),
            ),
            panel(
                "V over cells known in both (dark: great)",
                |o| o.verification_index,
                self.best(|o| o.verification_index.map(|v| -v)),
            ),
        ];
        let caption = "Figure 10 c) of the paper: the exhaustive search around T_o (circle) for the least entropy, and beside \
                       it for the greatest V, which the pipeline takes. Where the truth lies outside of the search its cross \
                       stands at the border.";
        Figure::new("figure-10-search", caption, 2, panels)
    }
}

/// h of both maps over the greatest value of either.
fn spectra_panel(spectrum: &SpectrumTrace) -> Panel {
    let values = spectrum.fixed.iter().chain(&spectrum.moving).copied();
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let points = |of: &[f64]| {
        (0..of.len())
            .map(|k| [HoughView::theta_of(k).degrees(), of[k]])
            .collect()
    };
    let unit = match spectrum.f {
        Spectrum::Entropy => "h [bit]",
        Spectrum::SumOfSquares => "h [votes squared]",
        _ => "h [votes]",
    };
    let room = (high - low) * 0.35;
    Panel::new(
        format!("h(theta), f = {}", name_of(spectrum.f)),
        Axis::new("theta [deg]", -90.0, 90.0),
        Axis::new(unit, low, high + room),
    )
    .with(Series::new(
        "h1, map 1",
        PALETTE[0],
        Mark::Line,
        points(&spectrum.fixed),
    ))
    .with(Series::new(
        "h2, map 2",
        PALETTE[1],
        Mark::Line,
        points(&spectrum.moving),
    ))
}

//! The candidates, and the pose after each stage.

use super::step::{Step, name_of, off};
use crate::experiments::outcome::Table;
use crate::geometry::{Angle, Pose2};
use crate::registration::overlap::{Comparison, StateMap, compare};

impl Step<'_> {
    pub(super) fn candidates(&self) -> Table {
        let mut table = Table::new(
            "candidates",
            "Local maxima of the circular cross-correlation by f (eq. 25); each stands for itself and its half turn.",
            &["f", "rank", "rotation [deg]", "off the truth [deg]"],
        );
        for spectrum in &self.rotations.spectra {
            for (rank, candidate) in spectrum.candidates.iter().enumerate() {
                let off = off(Some(candidate), self.truth.yaw());
                table.push(vec![
                    name_of(spectrum.f).into(),
                    (rank + 1).into(),
                    candidate.degrees().into(),
                    off.into(),
                ]);
            }
        }
        table
    }

    pub(super) fn stages(&self, candidate: Angle, tuned: Angle, at_truth: &Comparison) -> Table {
        let mut table = Table::new(
            "stages",
            "The pose after each stage. V over cells known in both maps.",
            &["stage", "rotation [deg]", "x [cells]", "y [cells]", "V"],
        );
        let v =
            |pose: Pose2| compare(&StateMap::new(self.fixed), &StateMap::new(self.moving), pose).verification_index();
        table.push(vec![
            "candidate".into(),
            candidate.degrees().into(),
            None::<f64>.into(),
            None::<f64>.into(),
            None::<f64>.into(),
        ]);
        table.push(vec![
            "rotation tuned".into(),
            tuned.degrees().into(),
            None::<f64>.into(),
            None::<f64>.into(),
            None::<f64>.into(),
        ]);
        let cell = self.cell();
        let approximate = self
            .trace
            .approximate
            .map(|[x, y]| Pose2::new(x * cell, y * cell, tuned));
        for (stage, pose) in [
            ("peaks matched", approximate),
            ("translation tuned", self.trace.tuned),
            ("answer", self.found),
        ] {
            if let Some(pose) = pose {
                let [x, y] = self.in_cells(pose);
                table.push(vec![
                    stage.into(),
                    pose.yaw().degrees().into(),
                    x.into(),
                    y.into(),
                    v(pose).into(),
                ]);
            }
        }
        let [x, y] = self.in_cells(self.truth);
        let index = at_truth.verification_index();
        table.push(vec![
            "truth".into(),
            self.truth.yaw().degrees().into(),
            x.into(),
            y.into(),
            index.into(),
        ]);
        table
    }
}

//! The whole pipeline with one reading at a time as printed.

use crate::experiments::bars::{Bars, bar_panel};
use crate::experiments::figure::{Figure, PALETTE};
use crate::experiments::numbers::real;
use crate::experiments::outcome::Table;
use crate::registration::methods::HoughPeaksParams;
use crate::registration::methods::hough_peaks::{
    Disagreement, Pairing, PsiHat, RotationChoice, RotationTuning, Spectrum, TranslationTuning,
};
/// The pipeline with one reading as printed.
pub(super) fn variants() -> Vec<(&'static str, HoughPeaksParams)> {
    let ours = HoughPeaksParams::default();
    let of = |name, change: fn(&mut HoughPeaksParams)| {
        let mut params = ours.clone();
        change(&mut params);
        (name, params)
    };
    vec![
        of("ours", |_| ()),
        of("one rotation, by psi-hat as printed", |p| {
            p.rotation_choice = RotationChoice::NearestToPsiHat;
            p.psi_hat = PsiHat::MeanOfTangents;
        }),
        of("one rotation, by a circular psi-hat", |p| {
            p.rotation_choice = RotationChoice::NearestToPsiHat;
            p.psi_hat = PsiHat::CircularMean;
        }),
        of("f = mean of non-zeros", |p| p.spectrum = Spectrum::MeanOfNonZeros),
        of("f = entropy", |p| p.spectrum = Spectrum::Entropy),
        of("tuning window as printed", |p| {
            p.rotation_tuning = RotationTuning::PaperWindow;
        }),
        of("lines one cell wide", |p| p.line_width_cells = 1),
        of("one couple a direction", |p| p.pairing = Pairing::BestPerAngle),
        of("peaks matched once", |p| p.matching_rounds = 1),
        of("v_gate 50 votes", |p| p.v_gate = 50.0),
        of("d_gate 100 cells", |p| p.d_gate = 100.0),
        of("translation by entropy", |p| {
            p.translation_tuning = TranslationTuning::Entropy;
        }),
        of("dis over cells known in one", |p| {
            p.disagreement = Disagreement::KnownInOne;
        }),
        ("all as printed", HoughPeaksParams::literal()),
    ]
}

/// What one variant of the pipeline does.
pub(super) struct Row {
    pub(super) name: &'static str,
    pub(super) pairs: usize,
    pub(super) posed: f64,
    pub(super) right: f64,
    pub(super) wrong: usize,
    pub(super) falsely: usize,
}

pub(super) fn pipeline_table(rows: &[Row]) -> Table {
    let mut table = Table::new(
        "pipeline",
        "The whole pipeline with one reading at a time as printed. Pose right: the best pose is within 0.5 m, merged or not.",
        &[
            "reading",
            "matching pairs",
            "pose right [share]",
            "merged rightly [share]",
            "merged wrongly",
            "two buildings merged",
        ],
    );
    for row in rows {
        table.push(vec![
            row.name.into(),
            row.pairs.into(),
            row.posed.into(),
            row.right.into(),
            row.wrong.into(),
            row.falsely.into(),
        ]);
    }
    table
}

pub(super) fn pipeline_figure(rows: &[Row]) -> Figure {
    let names: Vec<String> = rows.iter().map(|row| row.name.to_owned()).collect();
    let bars = |label, color, value: fn(&Row) -> f64| Bars {
        label,
        color,
        values: rows.iter().map(value).collect(),
    };
    let right = bar_panel(
        "One reading at a time as printed",
        "matching pairs [%]",
        &names,
        vec![
            bars("pose right", PALETTE[0], |row| 100.0 * row.posed),
            bars("merged rightly", PALETTE[2], |row| 100.0 * row.right),
        ],
    );
    let wrong = bar_panel(
        "Merges that are wrong",
        "pairs",
        &names,
        vec![
            bars("matching pairs merged wrongly", PALETTE[1], |row| real(row.wrong)),
            bars("two buildings merged", PALETTE[5], |row| real(row.falsely)),
        ],
    );
    let caption =
        "The whole pipeline with one reading at a time as printed; the first row is ours, the last the paper's.";
    Figure::new("pipeline", caption, 2, vec![right, wrong])
}

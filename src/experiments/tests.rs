use super::report::{Entry, files_of, page};
use super::*;
use crate::registration::Unhurried;

fn quick(name: ExperimentName) -> Outcome {
    let settings = Settings {
        seed: 1,
        quick: true,
        recorded: Vec::new(),
    };
    run(name, &settings, &Unhurried).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn table<'a>(outcome: &'a Outcome, name: &str) -> &'a Table {
    outcome
        .tables
        .iter()
        .find(|table| table.name == name)
        .expect("the table is there")
}

/// Numbers of a column, of the rows in which another column says something.
fn numbers(table: &Table, column: &str, only: Option<(&str, &str)>) -> Vec<f64> {
    let at = |name: &str| {
        table
            .columns
            .iter()
            .position(|c| c == name)
            .expect("the column is there")
    };
    let rows = table
        .rows
        .iter()
        .filter(|row| only.is_none_or(|(name, text)| row[at(name)] == Cell::from(text)));
    rows.map(|row| match row[at(column)] {
        Cell::Number(number) => number,
        Cell::Count(count) => count as f64,
        _ => f64::NAN,
    })
    .collect()
}

/// Draws all figures, and looks whether the page names every file that is to be written.
fn shows_everything(outcome: Outcome) {
    assert!(!outcome.claims.is_empty() && !outcome.tables.is_empty() && !outcome.figures.is_empty());
    for figure in &outcome.figures {
        let drawn = plot::draw(figure).unwrap_or_else(|error| panic!("{error}"));
        assert!(drawn.png.len() > 1000 && drawn.svg.len() > 1000, "{}", figure.name);
    }
    let files = files_of(&outcome);
    let html = page(&[Entry { outcome, seconds: 1.0 }], "a test");
    for file in files {
        assert!(html.contains(&format!("\"{file}\"")), "the page does not link {file}");
    }
}

#[test]
fn the_properties_of_the_hough_image_hold_within_a_cell_and_a_degree() {
    let outcome = quick(ExperimentName::HoughProperties);
    let rows = table(&outcome, "property-1");
    let votes = numbers(rows, "votes", None);
    assert_eq!(votes.len(), 20);
    for (votes, moved) in votes.iter().zip(numbers(rows, "votes, moved exactly", None)) {
        assert!(moved >= 0.9 * votes, "{moved} of {votes} votes");
    }
    assert!(
        outcome.claims[2].ours.ends_with("0 votes"),
        "{}",
        outcome.claims[2].ours
    );
    for intensity in numbers(table(&outcome, "property-3"), "points a cell apart", None) {
        assert!((intensity - 1.0).abs() < 0.02, "{intensity}");
    }
    shows_everything(outcome);
}

#[test]
fn the_step_by_step_pair_is_as_told_and_its_rotation_is_among_the_candidates() {
    let outcome = quick(ExperimentName::TwoMapsStepByStep);
    let off = numbers(table(&outcome, "candidates"), "off the truth [deg]", Some(("f", "max")));
    assert!(off.iter().any(|off| *off < 2.0), "{off:?}");
    let rotation = numbers(table(&outcome, "stages"), "rotation [deg]", Some(("stage", "truth")));
    assert!((rotation[0] + 5.5).abs() < 0.3, "{rotation:?}");
    shows_everything(outcome);
}

#[test]
fn the_four_robots_overlap_as_in_table_1_within_5_points() {
    let outcome = quick(ExperimentName::FourRobots);
    let rows = table(&outcome, "table-1");
    let (paper, ours) = (numbers(rows, "paper [%]", None), numbers(rows, "ours [%]", None));
    assert_eq!(paper.len(), 6);
    for (paper, ours) in paper.iter().zip(ours) {
        assert!((paper - ours).abs() <= 5.0, "{ours} instead of {paper}");
    }
    shows_everything(outcome);
}

#[test]
fn the_settings_of_the_two_and_the_three_robots_are_the_papers() {
    for name in [ExperimentName::TwoRobots, ExperimentName::ThreeRobots] {
        let outcome = quick(name);
        let setting = &outcome.claims[0];
        assert_eq!(setting.verdict, Verdict::Holds, "{name}: {}", setting.ours);
        shows_everything(outcome);
    }
}

#[test]
fn the_similarity_rises_with_the_overlap_and_the_default_engine_needs_little() {
    let outcome = quick(ExperimentName::OverlapSweep);
    let rows = table(&outcome, "overlap");
    let of = numbers(rows, "similarity, mean", Some(("method", "hough-peaks, as printed")));
    assert!(of.len() == 3 && of[1] > of[0] && of[2] > of[1], "{of:?}");
    let of = numbers(rows, "similarity, mean", Some(("method", "hough (default)")));
    assert!(
        of.len() == 3 && of.iter().all(|similarity| *similarity > 0.95),
        "{of:?}"
    );
    shows_everything(outcome);
}

#[test]
fn distortion_lowers_the_similarity() {
    let outcome = quick(ExperimentName::DistortionSweep);
    let of = numbers(
        table(&outcome, "distortion"),
        "similarity, mean",
        Some(("method", "hough (default)")),
    );
    // 40 % straight and bent, 70 % straight and bent
    assert!(of.len() == 4 && of[0] > of[1] + 0.05 && of[2] > of[3] + 0.05, "{of:?}");
    shows_everything(outcome);
}

#[test]
fn every_parameter_of_table_2_is_varied_both_ways() {
    let outcome = quick(ExperimentName::Sensitivity);
    assert_eq!(table(&outcome, "sensitivity").rows.len(), 1 + 2 * 6);
    shows_everything(outcome);
}

#[test]
fn every_method_is_compared_and_the_default_makes_no_wrong_merge() {
    let outcome = quick(ExperimentName::Comparison);
    let rows = table(&outcome, "table-3");
    for name in crate::registration::MethodName::ALL {
        let pairs = numbers(rows, "pairs", Some(("method", name.as_str())));
        assert!(
            pairs.len() >= 4 && pairs.iter().all(|pairs| *pairs >= 1.0),
            "{name}: {pairs:?}"
        );
    }
    let wrong = numbers(rows, "merged wrongly", Some(("method", "hough")));
    assert_eq!(wrong.iter().sum::<f64>(), 0.0);
    shows_everything(outcome);
}

#[test]
fn every_reading_is_measured_alone_and_in_the_pipeline() {
    let outcome = quick(ExperimentName::Readings);
    let shares = numbers(table(&outcome, "pipeline"), "pose right [share]", None);
    assert!(
        shares.len() == 14 && shares.iter().all(|s| (0.0..=1.0).contains(s)),
        "{shares:?}"
    );
    assert!(table(&outcome, "stages").rows.len() > 20);
    shows_everything(outcome);
}

//! `benches/fit_decision.py`, by which the weights of the decision were fitted: on simulated maps, to its end.

use std::process::Command;

use super::command::{Folder, mapweld};
use crate::skipped::skipped;

#[test]
fn weights_fitted_to_simulated_pairs_place_others_rightly_and_are_taken_by_the_command() {
    if Command::new("python3").arg("--version").output().is_err() {
        return skipped("the fit of the decision", "python3");
    }
    let folder = Folder::new();
    let maps = folder.text("maps");
    let simulate = [
        "simulate",
        "--out",
        &maps,
        "--seed",
        "7",
        "--matching",
        "24",
        "--same-building",
        "8",
        "--different",
        "8",
    ];
    let output = mapweld(&simulate);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let list = format!("{maps}/pairs.json");

    let output = Command::new("python3")
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/benches/fit_decision.py"))
        .args([env!("CARGO_BIN_EXE_mapweld"), &list, "--parts", "3"])
        .output()
        .expect("the script runs");
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{output:?}");
    let all = told
        .lines()
        .find_map(|line| line.strip_prefix("left out, all: right "))
        .expect("figures of all pairs");
    let right: u32 = all
        .split(' ')
        .next()
        .and_then(|count| count.parse().ok())
        .expect("a count");
    let weights = told.lines().last().expect("the weights");
    let of = |name: &str| {
        let weights: serde_json::Value = serde_json::from_str(weights).expect("JSON");
        weights["decision"]["weights"][name].as_f64().expect("a weight")
    };
    assert!(right >= 10, "{told}");
    assert!(
        of("plain") > 0.0 && of("plain_ratio") < 0.0,
        "score speaks for, a rival's against: {told}"
    );

    let output = mapweld(&["evaluate", "--pairs", &list, "--parameters", weights]);
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert_eq!(told.lines().count(), 40, "a line for each pair");
}

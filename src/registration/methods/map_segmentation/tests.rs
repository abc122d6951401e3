use super::*;
use crate::registration::methods::shared::contract::{self, Trial, keeps_the_contract};
use crate::registration::methods::shared::stopping::assert_stops_wherever_it_looks;

keeps_the_contract!(MapSegmentation of MapSegmentationParams, within 0.3 m, refuses frequency_max above 0.5);

#[test]
fn a_map_is_found_on_itself_to_a_cell() {
    // neither of two equal maps has less structure, so the inverse answer is not promised: the last cell is the matching's
    let trial = Trial::full_overlap(0.0, 0.0, 0.0);
    let answer = trial.answer(&default_method());
    let pose = answer.accepted().expect("it is the same map").pose_fixed_moving;
    assert!(
        pose.x().hypot(pose.y()) <= 0.05 && pose.yaw().degrees().abs() < 0.5,
        "{pose:?}"
    );
}

#[test]
fn the_method_can_be_stopped_between_any_two_stages_and_inside_them() {
    let trial = Trial::partial_overlap(0.5, -0.7, -5.0);
    let names = ["histogram filter", "segment matching", "verification"];
    let looks = assert_stops_wherever_it_looks(&default_method(), (&trial.fixed, &trial.moving), &names);
    assert!(looks > 60, "{looks}: each pair of segments, each hypothesis");
}

#[test]
fn two_parts_of_one_place_are_found_by_the_segments_that_they_share() {
    for (x, y, degrees) in [(0.5, -0.7, -5.0), (-20.0, 31.0, 112.0)] {
        contract::assert_finds(&default_method(), &Trial::partial_overlap(x, y, degrees), 0.3);
    }
}

#[test]
fn an_edge_threshold_above_the_other_is_refused() {
    let bad = MapSegmentationParams {
        edge_low: 300.0,
        ..MapSegmentationParams::default()
    };
    assert!(
        bad.validate()
            .expect_err("150 is below 300")
            .to_string()
            .contains("edge_high")
    );
}

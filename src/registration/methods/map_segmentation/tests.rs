use super::*;
use crate::registration::methods::shared::contract::{self, Trial};
use crate::registration::methods::shared::stopping::assert_stops_wherever_it_looks;

fn default_method() -> MapSegmentation {
    MapSegmentation::new(MapSegmentationParams::default()).expect("defaults")
}

#[test]
fn maps_of_one_place_are_found_at_small_rotations() {
    for (x, y, degrees) in [(0.4, -0.3, 0.0), (1.5, 2.0, 3.4), (-4.0, 1.2, -8.6)] {
        contract::assert_finds(&default_method(), &Trial::full_overlap(x, y, degrees), 0.3);
    }
}

#[test]
fn maps_of_one_place_are_found_at_large_rotations_wherever_their_frames_lie() {
    for (x, y, degrees) in [
        (60.0, -35.0, 41.7),
        (-12.0, 9.0, 93.2),
        (3.0, 250.0, -137.0),
        (7.0, 7.0, 178.8),
    ] {
        contract::assert_finds(&default_method(), &Trial::full_overlap(x, y, degrees), 0.3);
    }
}

#[test]
fn maps_without_walls_are_refused() {
    contract::assert_refuses_maps_without_walls(&default_method());
}

#[test]
fn nothing_below_the_threshold_is_accepted_unless_the_caller_asks() {
    contract::assert_nothing_below_the_threshold(|verification_threshold, accept_unverified| {
        let params = MapSegmentationParams {
            verification_threshold,
            accept_unverified,
            ..MapSegmentationParams::default()
        };
        Box::new(MapSegmentation::new(params).expect("in range"))
    });
}

#[test]
fn the_answer_is_the_same_on_any_number_of_threads_and_inverse_for_the_inverse_pair() {
    let trial = Trial::full_overlap(5.0, -3.0, 64.0);
    contract::assert_deterministic(&default_method(), &trial);
    contract::assert_inverse_pair_has_the_inverse_answer(&default_method(), &trial);
}

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
fn a_parameter_out_of_range_is_refused_by_name_value_and_limit() {
    assert_eq!(MapSegmentationParams::default().validate(), Ok(()));
    let bad = MapSegmentationParams {
        frequency_max: 7.5,
        ..MapSegmentationParams::default()
    };
    let message = bad.validate().expect_err("out of range").to_string();
    assert!(
        message.contains("frequency_max") && message.contains("7.5") && message.contains("0.5"),
        "{message}"
    );
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

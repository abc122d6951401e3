use super::*;
use crate::registration::methods::shared::contract::{self, Trial};
use crate::registration::methods::shared::stopping::assert_stops_wherever_it_looks;

/// All tests here run with the seed of the defaults, 1, unless they say so.
fn default_method() -> Ransac {
    Ransac::new(RansacParams::default()).expect("defaults")
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
        let params = RansacParams {
            verification_threshold,
            accept_unverified,
            ..RansacParams::default()
        };
        Box::new(Ransac::new(params).expect("in range"))
    });
}

#[test]
fn the_answer_is_the_same_on_any_number_of_threads_and_inverse_for_the_inverse_pair() {
    let trial = Trial::full_overlap(5.0, -3.0, 64.0);
    contract::assert_deterministic(&default_method(), &trial);
    contract::assert_inverse_pair_has_the_inverse_answer(&default_method(), &trial);
    contract::assert_inverse_pair_has_the_inverse_answer(&default_method(), &Trial::full_overlap(0.0, 0.0, 0.0));
}

#[test]
fn the_method_can_be_stopped_between_any_two_stages_and_inside_them() {
    let trial = Trial::partial_overlap(0.5, -0.7, -5.0);
    let names = ["correspondences", "consensus", "verification"];
    let looks = assert_stops_wherever_it_looks(&default_method(), (&trial.fixed, &trial.moving), &names);
    assert!(looks > 15, "{looks}: the samples by 64, and each hypothesis");
}

#[test]
fn a_parameter_out_of_range_is_refused_by_name_value_and_limit() {
    assert_eq!(RansacParams::default().validate(), Ok(()));
    let bad = RansacParams {
        peak_fraction: 7.5,
        ..RansacParams::default()
    };
    let message = bad.validate().expect_err("out of range").to_string();
    assert!(
        message.contains("peak_fraction") && message.contains("7.5") && message.contains('1'),
        "{message}"
    );
}

#[test]
fn the_other_metric_finds_maps_of_one_place_as_well() {
    let params = RansacParams {
        metric: SegmentDistance::SmallerSum,
        ..RansacParams::default()
    };
    let method = Ransac::new(params).expect("in range");
    contract::assert_finds(&method, &Trial::full_overlap(0.4, -0.3, 2.5), 0.3);
}

#[test]
fn a_small_search_region_leaves_large_motions_out() {
    let params = RansacParams {
        search_degrees: 10.0,
        search_cells: 40.0,
        ..RansacParams::default()
    };
    let method = Ransac::new(params).expect("in range");
    contract::assert_finds(&method, &Trial::full_overlap(0.4, -0.3, 2.5), 0.3);
    let trial = Trial::full_overlap(0.4, -0.3, 45.0);
    let answer = trial.answer(&method);
    assert!(
        answer
            .accepted()
            .is_none_or(|accepted| trial.error_m(accepted.pose_fixed_moving) > 0.5)
    );
}

use super::*;
use crate::registration::methods::shared::contract::{self, Trial};
use crate::registration::methods::shared::stopping::assert_stops_wherever_it_looks;
use proptest::prelude::*;

fn default_method() -> HoughSpectrum {
    HoughSpectrum::new(HoughSpectrumParams::default()).expect("defaults")
}

#[test]
fn maps_of_one_place_are_found_at_small_rotations() {
    for (x, y, degrees) in [(0.4, -0.3, 0.0), (1.5, 2.0, 3.4), (-4.0, 1.2, -8.6)] {
        contract::assert_finds(&default_method(), &Trial::full_overlap(x, y, degrees), 0.15);
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
        contract::assert_finds(&default_method(), &Trial::full_overlap(x, y, degrees), 0.15);
    }
}

#[test]
fn maps_without_walls_are_refused() {
    contract::assert_refuses_maps_without_walls(&default_method());
}

#[test]
fn nothing_below_the_threshold_is_accepted_unless_the_caller_asks() {
    contract::assert_nothing_below_the_threshold(|verification_threshold, accept_unverified| {
        let params = HoughSpectrumParams {
            verification_threshold,
            accept_unverified,
            ..HoughSpectrumParams::default()
        };
        Box::new(HoughSpectrum::new(params).expect("in range"))
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
    let names = ["rotation candidates", "projections", "verification"];
    let looks = assert_stops_wherever_it_looks(&default_method(), (&trial.fixed, &trial.moving), &names);
    assert!(looks > 20, "{looks}: six rotations twice in each of two stages");
}

#[test]
fn a_parameter_out_of_range_is_refused_by_name_value_and_limit() {
    assert_eq!(HoughSpectrumParams::default().validate(), Ok(()));
    let bad = HoughSpectrumParams {
        rotation_step_degrees: 7.5,
        ..HoughSpectrumParams::default()
    };
    let message = bad.validate().expect_err("out of range").to_string();
    assert!(
        message.contains("rotation_step_degrees") && message.contains("7.5") && message.contains('5'),
        "{message}"
    );
}

proptest! {
    #[test]
    fn a_projection_is_found_again_wherever_it_is_shifted_to(values in prop::collection::vec(0.0..9.0_f64, 20..60),
                                                             before in 0_usize..40, after in 0_usize..40) {
        let mut moved = vec![0.0; before];
        moved.extend(&values);
        moved.extend(vec![0.0; after]);
        // told about the middles, in whole bins
        let expected = to_f64(before) + to_f64(values.len() / 2) - to_f64(moved.len() / 2);
        prop_assert!((shift(&moved, &values) - expected).abs() <= 0.5);
    }
}

use super::*;
use crate::registration::methods::shared::contract::{self, Trial, keeps_the_contract};
use crate::registration::methods::shared::stopping::assert_stops_wherever_it_looks;
use proptest::prelude::*;

keeps_the_contract!(HoughSpectrum of HoughSpectrumParams, within 0.15 m, refuses rotation_step_degrees above 5);

#[test]
fn equal_maps_have_the_inverse_answer_as_well() {
    contract::assert_inverse_pair_has_the_inverse_answer(&default_method(), &Trial::full_overlap(0.0, 0.0, 0.0));
}

#[test]
fn the_method_can_be_stopped_between_any_two_stages_and_inside_them() {
    let trial = Trial::partial_overlap(0.5, -0.7, -5.0);
    let names = ["rotation candidates", "projections", "verification"];
    let looks = assert_stops_wherever_it_looks(&default_method(), (&trial.fixed, &trial.moving), &names);
    assert!(looks > 20, "{looks}: six rotations twice in each of two stages");
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

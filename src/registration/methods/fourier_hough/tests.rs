use super::*;
use crate::registration::methods::shared::contract::{self, Trial, keeps_the_contract};
use crate::registration::methods::shared::stopping::assert_stops_wherever_it_looks;

keeps_the_contract!(FourierHough of FourierHoughParams, within 0.15 m, refuses frequency_max above 0.5);

#[test]
fn equal_maps_have_the_inverse_answer_as_well() {
    contract::assert_inverse_pair_has_the_inverse_answer(&default_method(), &Trial::full_overlap(0.0, 0.0, 0.0));
}

#[test]
fn the_method_can_be_stopped_between_any_two_stages_and_inside_them() {
    let trial = Trial::partial_overlap(0.5, -0.7, -5.0);
    let names = ["rotation", "translation", "verification"];
    let looks = assert_stops_wherever_it_looks(&default_method(), (&trial.fixed, &trial.moving), &names);
    assert!(looks >= 8, "{looks}: two hypotheses in each of two stages");
}

#[test]
fn phase_correlation_finds_the_translation_as_well() {
    let params = FourierHoughParams {
        translation: FourierCorrelation::Phase,
        ..FourierHoughParams::default()
    };
    let method = FourierHough::new(params).expect("in range");
    contract::assert_finds(&method, &Trial::full_overlap(-3.0, 8.0, 30.0), 0.15);
}

#[test]
fn maps_that_are_too_large_are_correlated_in_larger_cells() {
    let params = FourierHoughParams {
        side_max_cells: 400,
        ..FourierHoughParams::default()
    };
    let method = FourierHough::new(params).expect("in range");
    contract::assert_finds(&method, &Trial::full_overlap(-3.0, 8.0, 30.0), 0.2);
}

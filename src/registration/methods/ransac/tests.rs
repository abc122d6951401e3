use super::*;
use crate::registration::methods::shared::contract::{self, Trial, keeps_the_contract};
use crate::registration::methods::shared::stopping::assert_stops_wherever_it_looks;

// All tests here run with the seed of the defaults, 1, unless they say so.
keeps_the_contract!(Ransac of RansacParams, within 0.3 m, refuses peak_fraction above 1);

#[test]
fn equal_maps_have_the_inverse_answer_as_well() {
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

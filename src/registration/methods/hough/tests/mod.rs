//! The method as a whole, on maps drawn here: rooms and corridors, seen from everywhere.

mod flat;

use std::sync::LazyLock;
use std::time::Duration;

use proptest::prelude::*;

pub(super) use flat::{everything, map};

use super::*;
use crate::geometry::Angle;
use crate::grid::{CellState, Lattice, LogOdds, resample};
use crate::registration::Stop;

fn answer(method: &Hough, fixed: &OccupancyGrid, moving: &OccupancyGrid) -> Registration {
    method.register(&method.features(fixed), &method.features(moving), &Unhurried)
}

/// How far apart two poses carry the flat's corners at most, metres.
fn apart(a: Pose2, b: Pose2, pose_world_map: Pose2) -> f64 {
    [[0.0, 0.0], [15.0, 0.0], [0.0, 8.0], [15.0, 8.0]]
        .map(|corner| {
            let inner = pose_world_map.inverse().apply(corner);
            let ([ax, ay], [bx, by]) = (a.apply(inner), b.apply(inner));
            (ax - bx).hypot(ay - by)
        })
        .into_iter()
        .fold(0.0, f64::max)
}

fn accepted(registration: &Registration) -> Pose2 {
    match registration {
        Registration::Accepted(acceptance) => acceptance.pose_fixed_moving,
        Registration::Rejected(rejection) => panic!("rejected: {:?}", rejection.reason),
    }
}

/// The pose that was accepted, or would have been.
fn best(registration: &Registration) -> Pose2 {
    match registration {
        Registration::Accepted(acceptance) => acceptance.pose_fixed_moving,
        Registration::Rejected(rejection) => rejection.candidates.first().expect("a candidate").pose_fixed_moving,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn a_map_moved_anywhere_is_found_on_itself(x in -50.0..50.0_f64, y in -50.0..50.0_f64, yaw in -4.0..4.0_f64) {
        // coarse cells keep 200 maps affordable; 0.2 cells are 0.02 m
        static FLAT: LazyLock<(Hough, OccupancyGrid, MapFeatures)> = LazyLock::new(|| {
            let (method, flat) = (Hough::default(), map(0.1, Pose2::IDENTITY, everything));
            let features = method.features(&flat);
            (method, flat, features)
        });
        let (method, fixed, features) = &*FLAT;
        let truth = Pose2::new(x, y, Angle::from_radians(yaw));
        // the same cells in a frame of their own: exactly the same map
        let lattice = Lattice::new(
            fixed.lattice().width(),
            fixed.lattice().height(),
            0.1,
            truth.inverse() * fixed.lattice().origin(),
        ).expect("a valid lattice");
        let moving = OccupancyGrid::new(lattice, fixed.cells().to_vec()).expect("as many cells");
        let registration = method.register(features, &method.features(&moving), &Unhurried);
        prop_assert!(apart(accepted(&registration), truth, truth) < 0.02);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn two_drawings_of_one_place_are_registered_to_a_fraction_of_a_cell(
        x in -50.0..50.0_f64, y in -50.0..50.0_f64, yaw in -4.0..4.0_f64,
    ) {
        let method = Hough::default();
        let truth = Pose2::new(x, y, Angle::from_radians(yaw));
        let fixed = map(0.05, Pose2::IDENTITY, |[x, _]| x < 12.0);
        let moving = map(0.05, truth, |[x, _]| x > 3.0);
        let pose = accepted(&answer(&method, &fixed, &moving));
        prop_assert!(apart(pose, truth, truth) < 0.05, "{} m", apart(pose, truth, truth));
    }

    #[test]
    fn the_inverse_pair_gives_the_inverse_pose(x in -50.0..50.0_f64, y in -50.0..50.0_f64, yaw in -4.0..4.0_f64) {
        let method = Hough::default();
        let truth = Pose2::new(x, y, Angle::from_radians(yaw));
        let fixed = map(0.1, Pose2::IDENTITY, |[x, _]| x < 12.0);
        let moving = map(0.1, truth, |[x, _]| x > 3.0);
        let (there, back) = (answer(&method, &fixed, &moving), answer(&method, &moving, &fixed));
        prop_assert_eq!(there.accepted().is_some(), back.accepted().is_some());
        prop_assert!(apart(best(&there), best(&back).inverse(), truth) < 1e-6);
    }

    #[test]
    fn posing_a_map_anew_changes_nothing_but_the_pose(x in -50.0..50.0_f64, y in -50.0..50.0_f64, yaw in -4.0..4.0_f64) {
        let method = Hough::default();
        let fixed = map(0.1, Pose2::IDENTITY, |[x, _]| x < 12.0);
        let moving = map(0.1, Pose2::new(3.0, -2.0, Angle::from_radians(0.7)), |[x, _]| x > 3.0);
        let again = Pose2::new(x, y, Angle::from_radians(yaw));
        let old = moving.lattice();
        let lattice = Lattice::new(old.width(), old.height(), old.resolution(), again * old.origin()).expect("valid");
        let posed = OccupancyGrid::new(lattice, moving.cells().to_vec()).expect("as many cells");
        let (one, other) = (answer(&method, &fixed, &moving), answer(&method, &fixed, &posed));
        prop_assert!(apart(best(&one), best(&other) * again, Pose2::new(3.0, -2.0, Angle::from_radians(0.7))) < 1e-6);
        prop_assert_eq!(one.accepted().is_some(), other.accepted().is_some());
        prop_assert_eq!(one.best_evidence().map(|e| e.matched_wall_m), other.best_evidence().map(|e| e.matched_wall_m));
    }
}

#[test]
fn one_thread_and_four_give_the_same_bytes() {
    let fixed = map(0.05, Pose2::IDENTITY, |[x, _]| x < 12.0);
    let moving = map(0.05, Pose2::new(3.0, -2.0, Angle::from_radians(0.7)), |[x, _]| x > 3.0);
    let told = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| format!("{:?}", answer(&Hough::default(), &fixed, &moving)))
    });
    assert_eq!(told[0], told[1]);
}

#[test]
fn maps_of_different_resolutions_are_registered() {
    let method = Hough::default();
    let truth = Pose2::new(-7.0, 3.0, Angle::from_radians(2.2));
    let fixed = map(0.05, Pose2::IDENTITY, everything);
    for resolution in [0.02, 0.03, 0.1] {
        let moving = map(resolution, truth, everything);
        let pose = accepted(&answer(&method, &fixed, &moving));
        assert!(
            apart(pose, truth, truth) < 0.1,
            "{resolution}: {}",
            apart(pose, truth, truth)
        );
    }
}

#[test]
fn a_map_resampled_under_another_yaw_of_its_origin_is_the_same_place() {
    let method = Hough::default();
    let fixed = map(0.05, Pose2::IDENTITY, everything);
    let lattice = Lattice::new(900, 900, 0.05, Pose2::new(8.0, -20.0, Angle::from_degrees(40.0))).expect("valid");
    let moving = resample(&fixed, Pose2::IDENTITY, lattice);
    let pose = accepted(&answer(&method, &fixed, &moving));
    assert!(apart(pose, Pose2::IDENTITY, Pose2::IDENTITY) < 0.05);
}

#[test]
fn blurred_and_probabilistic_maps_are_registered() {
    let method = Hough::default();
    let truth = Pose2::new(-7.0, 3.0, Angle::from_radians(-1.1));
    let fixed = map(0.05, Pose2::IDENTITY, everything);
    let mut moving = map(0.05, truth, everything);
    // thick walls, less sure towards their sides, and free space that is only probably free
    let (width, before) = (moving.lattice().width() as usize, moving.clone());
    for (index, cell) in moving.cells_mut().iter_mut().enumerate() {
        let near = [1, width].iter().any(|&step| {
            [index.wrapping_sub(step), index + step].iter().any(|&other| {
                before
                    .cells()
                    .get(other)
                    .is_some_and(|cell| cell.state() == CellState::Occupied)
            })
        });
        *cell = match cell.state() {
            CellState::Unknown => LogOdds::UNKNOWN,
            CellState::Free if near => LogOdds::from_probability(0.7),
            CellState::Free => LogOdds::from_probability(0.15),
            CellState::Occupied => LogOdds::from_probability(0.9),
        };
    }
    let pose = accepted(&answer(&method, &fixed, &moving));
    assert!(apart(pose, truth, truth) < 0.08, "{}", apart(pose, truth, truth));
}

#[test]
fn maps_without_walls_have_no_structure() {
    let method = Hough::default();
    let flat = map(0.1, Pose2::IDENTITY, everything);
    let tiny = OccupancyGrid::unknown(Lattice::new(1, 1, 0.05, Pose2::IDENTITY).expect("valid"));
    let mut dot = tiny.clone();
    dot.cells_mut()[0] = LogOdds::OCCUPIED;
    let unknown = OccupancyGrid::unknown(*flat.lattice());
    for poor in [&tiny, &dot, &unknown] {
        for (fixed, moving) in [(&flat, poor), (poor, &flat), (poor, poor)] {
            match answer(&method, fixed, moving) {
                Registration::Rejected(Rejection {
                    reason: Reason::NoStructure { structure_m, needed_m },
                    ..
                }) => assert!(structure_m < needed_m),
                other => panic!("{other:?}"),
            }
        }
    }
}

/// A corridor along x, open at both ends.
fn corridor(length: f64) -> OccupancyGrid {
    let lattice = Lattice::new(
        super::num::round64(length * 20.0).try_into().expect("small"),
        60,
        0.05,
        Pose2::IDENTITY,
    )
    .expect("valid");
    let cells = (0..60_u32).flat_map(|row| {
        (0..lattice.width()).map(move |_| match row {
            10 | 50 => LogOdds::OCCUPIED,
            11..50 => LogOdds::FREE,
            _ => LogOdds::UNKNOWN,
        })
    });
    OccupancyGrid::new(lattice, cells.collect()).expect("as many cells")
}

#[test]
fn corridors_slide_along_each_other_and_the_free_direction_is_told() {
    match answer(&Hough::default(), &corridor(30.0), &corridor(20.0)) {
        Registration::Rejected(Rejection {
            reason:
                Reason::UnderConstrained {
                    free_direction,
                    support_m,
                    ..
                },
            candidates,
            ..
        }) => {
            assert!(free_direction.radians().sin().abs() < 0.05, "{free_direction:?}");
            assert!(support_m < 1.0 && !candidates.is_empty());
        }
        other => panic!("{other:?}"),
    }
}

/// Stops at the n-th look.
struct Impatient(std::sync::atomic::AtomicUsize, Stop);

impl Control for Impatient {
    fn now(&self) -> Duration {
        Duration::ZERO
    }
    fn should_stop(&self) -> Option<Stop> {
        use std::sync::atomic::Ordering::SeqCst;
        let left = self.0.load(SeqCst);
        self.0.store(left.saturating_sub(1), SeqCst);
        (left == 0).then_some(self.1)
    }
}

#[test]
fn whoever_stops_it_is_told_so_after_whatever_stage() {
    let method = Hough::default();
    let flat = method.features(&map(0.1, Pose2::IDENTITY, everything));
    for looks in 0..6 {
        for (stop, reason) in [(Stop::Deadline, Reason::Deadline), (Stop::Cancelled, Reason::Cancelled)] {
            let control = Impatient(looks.into(), stop);
            match method.register(&flat, &flat, &control) {
                Registration::Rejected(rejection) => assert_eq!(rejection.reason, reason),
                Registration::Accepted(_) => panic!("went on after look {looks}"),
            }
        }
    }
}

#[test]
fn a_known_pose_is_confirmed_and_a_wrong_one_is_not() {
    let method = Hough::default();
    let truth = Pose2::new(-7.0, 3.0, Angle::from_radians(-1.1));
    let fixed = method.features(&map(0.05, Pose2::IDENTITY, |[x, _]| x < 12.0));
    let moving = method.features(&map(0.05, truth, |[x, _]| x > 3.0));
    let near = truth * Pose2::new(0.1, -0.1, Angle::from_degrees(0.3));
    let pose = accepted(&method.verify_at(&fixed, &moving, near, &Unhurried));
    assert!(apart(pose, truth, truth) < 0.05);
    let wrong = truth * Pose2::new(2.0, 1.0, Angle::from_degrees(10.0));
    assert!(
        method
            .verify_at(&fixed, &moving, wrong, &Unhurried)
            .accepted()
            .is_none()
    );
}

#[test]
fn the_verification_index_agrees_with_the_rooms_own() {
    use crate::registration::overlap::{StateMap, compare};
    let truth = Pose2::new(-7.0, 3.0, Angle::from_radians(-1.1));
    let fixed = map(0.05, Pose2::IDENTITY, |[x, _]| x < 12.0);
    let moving = map(0.05, truth, |[x, _]| x > 3.0);
    let registration = answer(&Hough::default(), &fixed, &moving);
    let evidence = registration.best_evidence().expect("there is a hypothesis").clone();
    let slow = compare(&StateMap::new(&fixed), &StateMap::new(&moving), accepted(&registration));
    let v = |index: Option<f64>| index.expect("much in common");
    assert!((v(evidence.verification_index) - v(slow.verification_index())).abs() < 0.02);
    assert!((evidence.overlap - slow.overlap()).abs() < 0.02);
}

#[test]
fn a_pose_under_which_free_space_and_walls_disagree_is_refused_however_likely_it_is() {
    let truth = Pose2::new(-7.0, 3.0, Angle::from_radians(-1.1));
    let fixed = map(0.05, Pose2::IDENTITY, |[x, _]| x < 12.0);
    let moving = map(0.05, truth, |[x, _]| x > 3.0);
    let taken = answer(&Hough::default(), &fixed, &moving);
    let Some(evidence) = taken.accepted().map(|acceptance| &acceptance.evidence) else {
        panic!("two drawings of one place are registered")
    };
    let probability = evidence.probability.expect("the method has a model");
    assert!((0.6..=1.0).contains(&probability), "{probability}");
    // two drawings on turned lattices differ in a cell here and there
    let index = evidence.verification_index.expect("much in common");
    let mut parameters = HoughParameters::default();
    parameters.decision.verification_min = super::num::narrow(index + 0.001);
    let strict = Hough::new(parameters).expect("in range");
    let Registration::Rejected(refused) = answer(&strict, &fixed, &moving) else {
        panic!("V is {index} only")
    };
    let Reason::VerificationFailed {
        verification_index,
        threshold,
    } = refused.reason
    else {
        panic!("{:?}", refused.reason)
    };
    assert!(verification_index < threshold && apart(refused.candidates[0].pose_fixed_moving, truth, truth) < 0.05);
}

#[test]
fn parameters_out_of_range_are_named() {
    let parameters = HoughParameters {
        rotations: 0,
        ..HoughParameters::default()
    };
    let Err(error) = Hough::new(parameters) else {
        panic!("no rotation at all")
    };
    assert_eq!(
        error.to_string(),
        "parameter rotations of the method hough is 0; it must be within 1 and 24"
    );
}

//! What the tests of every method ask of it, each under a name of its own; a method's tests call what its documentation
//! promises.

use super::map::Map;
use super::world::{Seen, World};
use crate::geometry::{Angle, Pose2};
use crate::grid::{Lattice, LogOdds, OccupancyGrid};
use crate::registration::overlap::StateMap;
use crate::registration::{Method, Reason, Registration, Unhurried, register};

/// All of a world.
const ALL: Seen = Seen {
    low: [-0.3, -0.3],
    high: [22.3, 14.3],
};
/// Two parts of a world that have something over half of each in common.
const WEST: Seen = Seen {
    low: [-0.2, -0.2],
    high: [15.6, 14.2],
};
const EAST: Seen = Seen {
    low: [6.3, -0.2],
    high: [22.2, 14.2],
};

/// Two maps and how they lie.
pub(crate) struct Trial {
    pub(crate) fixed: OccupancyGrid,
    pub(crate) moving: OccupancyGrid,
    pub(crate) truth: Pose2,
}

impl Trial {
    /// Both maps show the whole office.
    pub(crate) fn full_overlap(x: f64, y: f64, degrees: f64) -> Self {
        Self::new(ALL, ALL, Pose2::new(x, y, Angle::from_degrees(degrees)))
    }

    /// One map shows the west of the office and the other its east; they have 57 % in common.
    pub(crate) fn partial_overlap(x: f64, y: f64, degrees: f64) -> Self {
        Self::new(WEST, EAST, Pose2::new(x, y, Angle::from_degrees(degrees)))
    }

    fn new(fixed: Seen, moving: Seen, truth: Pose2) -> Self {
        let frame = Pose2::new(10.5, 6.9, Angle::from_degrees(17.0));
        Self {
            fixed: World::office().map(fixed, frame, 0.05),
            moving: World::office().map(moving, frame * truth, 0.05),
            truth,
        }
    }

    pub(crate) fn answer(&self, method: &dyn Method) -> Registration {
        register(method, &self.fixed, &self.moving, &Unhurried)
    }

    /// RMS displacement of the moving map's occupied cells against the truth, in metres.
    pub(crate) fn error_m(&self, pose_fixed_moving: Pose2) -> f64 {
        Map::new(StateMap::new(&self.moving)).distance_between(pose_fixed_moving, self.truth)
    }
}

/// The method accepts, no farther off than the tolerance in metres, and its evidence speaks for it.
pub(crate) fn assert_finds(method: &dyn Method, trial: &Trial, tolerance_m: f64) {
    let answer = trial.answer(method);
    let accepted = answer
        .accepted()
        .unwrap_or_else(|| panic!("at {:?}: {answer:?}", trial.truth));
    let error = trial.error_m(accepted.pose_fixed_moving);
    assert!(
        error < tolerance_m,
        "error {error} m at {:?}: {:?}",
        trial.truth,
        accepted.evidence
    );
    let evidence = &accepted.evidence;
    let required = method.required_verification().expect("it asks for V");
    assert!(evidence.verification_index.expect("known in both") >= required);
    assert!(evidence.overlap > 0.4, "overlap {}", evidence.overlap);
    assert!(evidence.matched_wall_m > evidence.violated_wall_m, "{evidence:?}");
    assert!(evidence.weaker_direction_m > 1.0, "{evidence:?}");
}

/// Maps in which nothing stands are refused, and whatever else is strange does no harm.
pub(crate) fn assert_refuses_maps_without_walls(method: &dyn Method) {
    let lattice = Lattice::new(70, 50, 0.05, Pose2::new(1e8, -1e8, Angle::from_degrees(40.0))).expect("valid");
    let filled = |cell| OccupancyGrid::new(lattice, vec![cell; lattice.cell_count()]).expect("as many cells");
    let (unknown, free, wall) = (
        filled(LogOdds::UNKNOWN),
        filled(LogOdds::FREE),
        filled(LogOdds::OCCUPIED),
    );
    let office = Trial::full_overlap(0.0, 0.0, 0.0).fixed;
    for poor in [&unknown, &free] {
        for (fixed, moving) in [(poor, &office), (&office, poor), (poor, poor)] {
            let Registration::Rejected(rejection) = register(method, fixed, moving, &Unhurried) else {
                panic!("a map without walls was placed")
            };
            assert!(
                matches!(rejection.reason, Reason::NoStructure { structure_m, needed_m } if structure_m < needed_m)
            );
            assert!(rejection.candidates.is_empty());
        }
    }
    for (fixed, moving) in [(&wall, &office), (&office, &wall), (&wall, &wall)] {
        let _ = register(method, fixed, moving, &Unhurried); // any answer will do
    }
}

/// The answer is the same, to the byte, on any number of threads.
pub(crate) fn assert_deterministic(method: &dyn Method, trial: &Trial) {
    let on_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| trial.answer(method))
    };
    let alone = on_threads(1);
    assert!(alone.best_evidence().is_some(), "{alone:?}");
    for threads in [2, 5] {
        assert_eq!(on_threads(threads), alone);
    }
}

/// The pair the other way round has the inverse answer.
pub(crate) fn assert_inverse_pair_has_the_inverse_answer(method: &dyn Method, trial: &Trial) {
    let there = trial.answer(method);
    let back = register(method, &trial.moving, &trial.fixed, &Unhurried);
    let (Some(there), Some(back)) = (there.accepted(), back.accepted()) else {
        panic!("{there:?} and {back:?}")
    };
    let off = Map::new(StateMap::new(&trial.moving))
        .distance_between(there.pose_fixed_moving, back.pose_fixed_moving.inverse());
    assert!(off < 1e-6, "{off} m apart");
    assert!((there.evidence.score - back.evidence.score).abs() < 1e-12);
}

/// With a threshold that no maps reach nothing is accepted, until the caller asks for it. `method` makes it of the threshold
/// and the wish.
pub(crate) fn assert_nothing_below_the_threshold(method: impl Fn(f64, bool) -> Box<dyn Method>) {
    let trial = Trial::full_overlap(0.3, -0.2, 7.3);
    let (strict, asked) = (method(1.0, false), method(1.0, true));
    assert_eq!(
        (strict.required_verification(), asked.required_verification()),
        (Some(1.0), None)
    );
    let Registration::Rejected(rejection) = trial.answer(&*strict) else {
        panic!("no two maps agree in every cell")
    };
    let Reason::VerificationFailed {
        verification_index,
        threshold,
    } = rejection.reason
    else {
        panic!("{:?}", rejection.reason)
    };
    assert!(verification_index < threshold);
    let answer = trial.answer(&*asked);
    let accepted = answer.accepted().expect("asked for");
    assert_eq!(accepted.evidence.verification_index, Some(verification_index));
    assert_eq!(accepted.pose_fixed_moving, rejection.candidates[0].pose_fixed_moving);
}

/// The tests that a method passes whose promises are those of this file, by one name in each method's tests: which method
/// with which parameters, how near to the truth it comes on full overlap, and one parameter with its greatest value.
macro_rules! keeps_the_contract {
    ($method:ident of $params:ident, within $tolerance_m:literal m, refuses $field:ident above $limit:literal) => {
        fn default_method() -> $method {
            $method::new($params::default()).expect("defaults")
        }

        #[test]
        fn maps_of_one_place_are_found_at_small_rotations() {
            for (x, y, degrees) in [(0.4, -0.3, 0.0), (1.5, 2.0, 3.4), (-4.0, 1.2, -8.6)] {
                contract::assert_finds(
                    &default_method(),
                    &Trial::full_overlap(x, y, degrees),
                    $tolerance_m,
                );
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
                contract::assert_finds(
                    &default_method(),
                    &Trial::full_overlap(x, y, degrees),
                    $tolerance_m,
                );
            }
        }

        #[test]
        fn maps_without_walls_are_refused() {
            contract::assert_refuses_maps_without_walls(&default_method());
        }

        #[test]
        fn nothing_below_the_threshold_is_accepted_unless_the_caller_asks() {
            contract::assert_nothing_below_the_threshold(|verification_threshold, accept_unverified| {
                let params = $params {
                    verification_threshold,
                    accept_unverified,
                    ..$params::default()
                };
                Box::new($method::new(params).expect("in range"))
            });
        }

        #[test]
        fn the_answer_is_the_same_on_any_number_of_threads_and_inverse_for_the_inverse_pair() {
            let trial = Trial::full_overlap(5.0, -3.0, 64.0);
            contract::assert_deterministic(&default_method(), &trial);
            contract::assert_inverse_pair_has_the_inverse_answer(&default_method(), &trial);
        }

        #[test]
        fn a_parameter_out_of_range_is_refused_by_name_value_and_limit() {
            assert_eq!($params::default().validate(), Ok(()));
            let bad = $params {
                $field: 7.5,
                ..$params::default()
            };
            let message = bad.validate().expect_err("out of range").to_string();
            let told = [stringify!($field), "7.5", stringify!($limit)];
            assert!(told.iter().all(|words| message.contains(words)), "{message}");
        }
    };
}
pub(crate) use keeps_the_contract;

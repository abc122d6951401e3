//! The adaptive random walk.
//!
//! **Method.** From a place x of value c, again and again:
//!
//! 1. a step v is drawn from a normal distribution of mean mu and standard deviations sigma, and `s = x + v` is looked at;
//! 2. s is taken when its value is smaller, or with the probability of the random selector;
//! 3. mu and the variances follow the steps that were really made (0 for a refused one):
//!    `mu <- (1 - a) mu + a v` and `m <- (1 - a) m + a v^2`, `sigma^2 = 5 m` within its bounds, so that sigma grows while more
//!    than one step in five is taken and shrinks while fewer are.
//!
//! The best place of all is the answer.
//!
//! **Shapes and units.** A place is where the middle of the moving map's walls lies in the fixed map's frame, in metres, and
//! the rotation in radians: a rotation then does not move what is being rotated.
//!
//! **Differences from the source.** Birk and Carpin take mean and covariance of the last few states; the window here is an
//! exponential one, and the covariance a diagonal.

use super::params::RandomWalkParams;
use crate::geometry::{Angle, Point, Pose2};
use crate::random::Random;
use crate::registration::Reason;

/// The variance is so many times that of the steps that were made: at one step taken in so many it stays.
const STEPS_FOR_ONE: f64 = 5.0;
/// A walk looks whether to go on so often.
const STEPS_BETWEEN_LOOKS: u32 = 64;

/// A place of the walk: x and y in metres, yaw in radians.
pub(super) type Place = [f64; 3];

/// The pose that lays `middle`, a point of the moving map in its frame, at this place.
pub(super) fn pose_of([x, y, yaw]: Place, middle: Point) -> Pose2 {
    let rotation = Pose2::new(0.0, 0.0, Angle::from_radians(yaw));
    let [mx, my] = rotation.apply(middle);
    Pose2::new(x - mx, y - my, rotation.yaw())
}

/// The least and the first standard deviations of a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scales {
    pub(super) least: Place,
    pub(super) first: Place,
}

impl Scales {
    /// A quarter of a cell and a twentieth of a degree at least; the parameters' at first.
    pub(super) fn new(cell: f64, params: &RandomWalkParams) -> Self {
        let least = [0.25 * cell, 0.25 * cell, Angle::from_degrees(0.05).radians()];
        let (metres, radians) = (params.sigma_translation_m, params.sigma_rotation_degrees.to_radians());
        Self {
            least,
            first: [metres.max(least[0]), metres.max(least[1]), radians.max(least[2])],
        }
    }
}

/// Walks from `start`; the best place and its value.
pub(super) fn walk(
    value_of: impl Fn(Place) -> f64,
    start: Place,
    scales: Scales,
    random: &mut Random,
    params: &RandomWalkParams,
    go_on: impl Fn() -> Result<(), Reason>,
) -> Result<(Place, f64), Reason> {
    let (mut place, mut value) = (start, value_of(start));
    let mut best = (place, value);
    let (mut mean, mut square) = ([0.0; 3], scales.first.map(|sigma| sigma * sigma / STEPS_FOR_ONE));
    let keep = 1.0 - params.adaptation;
    for step in 0..params.steps {
        if step % STEPS_BETWEEN_LOOKS == 0 {
            go_on()?;
        }
        let mut moved = [0.0; 3];
        for axis in 0..3 {
            let sigma = (STEPS_FOR_ONE * square[axis]).sqrt();
            moved[axis] = mean[axis] + random.normal(sigma.clamp(scales.least[axis], scales.first[axis]));
        }
        let next = [0, 1, 2].map(|axis| place[axis] + moved[axis]);
        let next_value = value_of(next);
        // the lot is drawn at every step, so that how many were drawn does not depend on the values
        let lot = random.chance(params.worse_probability);
        if next_value < value || lot {
            (place, value) = (next, next_value);
            if value < best.1 {
                best = (place, value);
            }
        } else {
            moved = [0.0; 3];
        }
        for axis in 0..3 {
            mean[axis] = keep * mean[axis] + params.adaptation * moved[axis];
            square[axis] = keep * square[axis] + params.adaptation * moved[axis] * moved[axis];
        }
    }
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bowl([x, y, yaw]: Place) -> f64 {
        (x - 3.0).abs() + (y + 2.0).abs() + 5.0 * (yaw - 0.4).abs()
    }

    fn walked(seed: u64, start: Place) -> (Place, f64) {
        let params = RandomWalkParams::default();
        let scales = Scales::new(0.05, &params);
        walk(bowl, start, scales, &mut Random::new(seed, &[7]), &params, || Ok(())).expect("nobody stops it")
    }

    #[test]
    fn a_walk_ends_at_the_bottom_of_a_bowl() {
        for seed in 0..8 {
            let (place, value) = walked(seed, [0.0, 0.0, 0.0]);
            assert!(value < 0.1, "{place:?}: {value} with seed {seed}");
            assert!((bowl(place) - value).abs() < 1e-12);
        }
    }

    #[test]
    fn a_seed_is_a_walk() {
        assert_eq!(walked(3, [1.0, 1.0, 0.0]), walked(3, [1.0, 1.0, 0.0]));
        assert_ne!(walked(3, [1.0, 1.0, 0.0]), walked(4, [1.0, 1.0, 0.0]));
    }

    #[test]
    fn a_walk_that_is_stopped_says_why() {
        let params = RandomWalkParams::default();
        let scales = Scales::new(0.05, &params);
        let mut random = Random::new(1, &[]);
        let stopped = walk(bowl, [0.0; 3], scales, &mut random, &params, || Err(Reason::Cancelled));
        assert_eq!(stopped, Err(Reason::Cancelled));
    }

    #[test]
    fn a_place_lays_the_middle_where_it_says() {
        let pose = pose_of([4.0, -1.0, 2.0], [7.0, 3.0]);
        let [x, y] = pose.apply([7.0, 3.0]);
        assert!((x - 4.0).abs() < 1e-12 && (y + 1.0).abs() < 1e-12);
        assert!((pose.yaw().radians() - 2.0).abs() < 1e-12);
    }
}

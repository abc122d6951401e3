//! The building of section 5.1, in place of the RADISH data set "Fort AP Hill": an office, and two robots in it.

use super::{Mapped, frame_at, middle};
use crate::experiments::numbers::real;
use crate::geometry::{Angle, Pose2};
use crate::simulation::{Lidar, Planner, Random, SimulationError, compare, demo_building};

/// Two maps of an office of 34 m x 24 m that overlap by about 70 %, the second turned by -5.5 degrees and moved by [27, 2]
/// cells against the first, as the paper found its two maps to be.
///
/// Of some seeded attempts the one is taken whose overlap comes nearest to 70 %.
///
/// # Errors
/// When there is nowhere to drive.
///
/// # Panics
/// Never: there is at least one attempt.
pub(in crate::experiments) fn two_maps(seed: u64) -> Result<Vec<Mapped>, SimulationError> {
    const ATTEMPTS: u64 = 8;
    let world = demo_building(seed);
    let scene = world.scene();
    let planner = Planner::new(&scene, 0.25);
    let everywhere = planner.region(world.entrance(), f64::INFINITY)?;
    let mut best: Option<(f64, Vec<Mapped>)> = None;
    for attempt in 0..ATTEMPTS {
        let mut random = Random::new(seed, &[8, attempt]);
        let start = planner
            .point_at(&everywhere, 0.0, f64::INFINITY, &mut random)
            .unwrap_or(world.entrance());
        let from_start = planner.region(start, f64::INFINITY)?;
        let other = planner.point_at(&from_start, 4.0, 9.0, &mut random).unwrap_or(start);
        let tours = [start, other]
            .into_iter()
            .map(|from| Ok(planner.tour(&planner.region(from, 15.0)?, 70.0, 0.35, &mut random)))
            .collect::<Result<Vec<_>, SimulationError>>()?;
        let places: Vec<_> = tours
            .iter()
            .flat_map(|tour| tour.poses.iter().map(|pose| pose.translation()))
            .collect();
        let first = frame_at(middle(&places), [0.0, 0.0], 0.0);
        let second = first * Pose2::new(27.0 * 0.05, 2.0 * 0.05, Angle::from_degrees(-5.5));
        let lidar = Lidar::default();
        let maps = vec![
            Mapped::of_tour("map 1", &scene, &tours[0], lidar, first, seed ^ 0x80)?,
            Mapped::of_tour("map 2", &scene, &tours[1], lidar, second, seed ^ 0x81)?,
        ];
        let overlap = compare(&maps[0].map, &maps[1].map, maps[0].pose_of(&maps[1])).overlap;
        let off = (overlap - 0.7).abs();
        if best.as_ref().is_none_or(|(before, _)| off < *before) {
            best = Some((off, maps));
        }
        if off < 0.02 + 0.005 * real(usize::try_from(attempt).unwrap_or(0)) {
            break;
        }
    }
    Ok(best.expect("invariant: there was at least one attempt").1)
}

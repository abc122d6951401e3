//! Rotations that a Hough spectrum knows up to half a turn only.

use crate::geometry::Angle;

/// Degrees between two rotations, half turns not counted.
pub(super) fn apart_modulo_half_turn(a: Angle, b: Angle) -> f64 {
    let degrees = (a - b).degrees().abs();
    degrees.min(180.0 - degrees)
}

/// The candidate, or its half turn, that is nearest to a rotation; `None` without candidates.
pub(super) fn nearest(candidates: &[Angle], rotation: Angle) -> Option<Angle> {
    let turned = candidates.iter().flat_map(|c| [*c, *c + Angle::HALF_TURN]);
    turned.min_by(|a, b| (*a - rotation).magnitude().total_cmp(&(*b - rotation).magnitude()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_candidate_stands_for_its_half_turn_as_well() {
        let [a, b, far] = [85.0, -10.0, 172.0].map(Angle::from_degrees);
        let found = nearest(&[a, b], far).expect("there are two");
        assert!((found.degrees() - 170.0).abs() < 1e-9, "{found:?}");
        assert!((apart_modulo_half_turn(b, far) - 2.0).abs() < 1e-9);
        assert_eq!(nearest(&[], far), None);
    }
}

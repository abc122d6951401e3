//! Putative correspondences of the walls of two maps (section 6.2).
//!
//! **Method.** For each wall of one map the most similar wall of the other within the search region is chosen; likewise the other
//! way round. A wall that is claimed by several is the most similar one's: a correspondence is a mutual choice.
//!
//! **Cost.** The product of the numbers of walls times the size of a neighbourhood.
//!
//! **Fails when** a building has many walls of one length with the same surroundings, as corridors of equal rooms have.
//!
//! **Differences from the paper.** "The match with highest intensity and neighborhood similarity" is read as the greatest product
//! of both similarities. Neighbourhoods are compared under both names of a line, since a rotation may change the name.

use super::consensus::Correspondence;
use super::params::RansacParams;
use super::wall::Wall;

/// The correspondences that both maps choose, in the order of the fixed map's walls.
pub(super) fn correspondences<'a>(
    fixed: &'a [Wall],
    moving: &'a [Wall],
    params: &RansacParams,
) -> Vec<Correspondence<'a>> {
    let similarity: Vec<Vec<f64>> = fixed
        .iter()
        .map(|one| moving.iter().map(|other| similarity(one, other, params)).collect())
        .collect();
    let greatest = |values: &mut dyn Iterator<Item = f64>| {
        let mut best: Option<(usize, f64)> = None;
        for (index, value) in values.enumerate() {
            if value > best.map_or(0.0, |(_, most)| most) {
                best = Some((index, value));
            }
        }
        best.map(|(index, _)| index)
    };
    let of_moving: Vec<Option<usize>> = (0..moving.len())
        .map(|j| greatest(&mut similarity.iter().map(|row| row[j])))
        .collect();
    similarity
        .iter()
        .enumerate()
        .filter_map(|(i, row)| {
            let j = greatest(&mut row.iter().copied())?;
            (of_moving[j] == Some(i)).then(|| (&fixed[i], &moving[j]))
        })
        .collect()
}

/// The similarity of two walls, 0 outside of the search region.
fn similarity(fixed: &Wall, moving: &Wall, params: &RansacParams) -> f64 {
    let turn = fixed.theta - moving.theta;
    // the angle between two lines, in [0, 90] degrees
    let turned = turn.sin().abs().atan2(turn.cos().abs());
    if turned > params.search_degrees.to_radians() + 1e-9 {
        return 0.0;
    }
    // a line's other name has the other sign of rho, and the neighbourhood mirrored
    let name = |mirrored: bool| {
        let rho = if mirrored { -moving.rho } else { moving.rho };
        let within = (fixed.rho - rho).abs() <= params.search_cells;
        if within {
            fixed.similarity(moving, mirrored)
        } else {
            0.0
        }
    };
    name(false).max(name(true))
}

//! The one story: maps come in, and come out as one.

use super::fuse::{PlacedMap, fuse};
use super::group::register_set;
use super::input::{WeldInput, WeldOptions};
use super::outcome::{Weld, WeldError};
use crate::registration::{Control, StageTime};

/// Places all maps that can be placed, and adds them up in the anchor's frame. Used by the command, by the service's
/// one-shot merge and by its worker: the same maps give the same answer, to the byte, whoever asks, in any order and on
/// any number of threads (only the stages' times differ).
///
/// "These maps do not match" is no error: each map is placed or not placed, with its reason. When nobody is joined to the
/// anchor, the fused map is the anchor's alone, and `set.groups` says who is joined to whom.
///
/// # Errors
/// [`WeldError`] when an input is out of range, the fused map would be too large, or the caller stops it.
pub fn weld(inputs: &[WeldInput], options: &WeldOptions, control: &dyn Control) -> Result<Weld, WeldError> {
    let mut set = register_set(inputs, options, control)?;
    if let Some(stop) = control.should_stop() {
        return Err(WeldError::Stopped(stop));
    }
    let since = control.now();
    let others: Vec<PlacedMap<'_>> = inputs
        .iter()
        .zip(&set.placements)
        .enumerate()
        .filter(|(index, _)| *index != options.anchor)
        .filter_map(|(_, (input, placement))| {
            placement.placed().map(|placed| PlacedMap {
                grid: &input.grid,
                pose_anchor_map: placed.pose_anchor_map,
            })
        })
        .collect();
    let fused = fuse(&inputs[options.anchor].grid, &others, &options.fuse)?;
    set.stages.push(StageTime {
        stage: "fusion",
        duration: control.now().saturating_sub(since),
    });
    Ok(Weld { set, fused })
}

#[cfg(test)]
#[path = "prior_tests.rs"]
mod prior_tests;
#[cfg(test)]
#[path = "weld_tests.rs"]
mod tests;

//! What the experiments with teams share: all pairs registered, all maps welded, and everything laid beside the truth.

use std::sync::Arc;

use super::answer::{Answer, answer};
use super::figure::{Figure, Mark, PALETTE, Panel, Series};
use super::frames::far;
use super::numbers::index;
use super::outcome::Table;
use super::picture::{Laid, map_panel, merged_panel};
use super::worlds::Mapped;
use crate::fusion::{Moments, WeldError, WeldInput, WeldOptions, weld};
use crate::geometry::{Angle, Pose2};
use crate::grid::OccupancyGrid;
use crate::registration::{Control, MethodName, MethodSpec};
use crate::simulation::{Comparison, Random, compare};

/// Maps by one method in one kind of frames, welded.
pub(super) struct Welded {
    pub(super) method: MethodName,
    /// Whether the frames nearly have one origin, as the paper's method needs them.
    pub(super) near: bool,
    /// For each map its pose in the first one's frame and the error of it, where it was placed.
    pub(super) placed: Vec<Option<(Pose2, f64)>>,
    /// The first map and those that were placed, in the frame of the first.
    pub(super) maps: Vec<OccupancyGrid>,
}

impl Welded {
    /// Maps placed, the first one among them.
    pub(super) fn count(&self) -> usize {
        self.placed.iter().flatten().count()
    }

    /// The greatest error of a placed map, in metres.
    pub(super) fn worst_m(&self) -> f64 {
        self.placed
            .iter()
            .flatten()
            .map(|(_, error)| *error)
            .fold(0.0, f64::max)
    }

    /// In what frames, for people.
    pub(super) fn frames(&self) -> &'static str {
        if self.near { "within 20 cells" } else { "anywhere" }
    }

    /// How many were placed how well, for people.
    pub(super) fn words(&self) -> String {
        match self.count() {
            1 => format!("none of {} maps placed beside the first", self.maps.len() - 1),
            count => format!(
                "{count} of {} maps placed, error up to {:.3} m",
                self.maps.len(),
                self.worst_m()
            ),
        }
    }

    /// The merged picture.
    fn panel(&self, title: &str, team: &[Mapped]) -> Panel {
        let maps: Vec<Laid<'_>> = self
            .maps
            .iter()
            .zip(team)
            .zip(&self.placed)
            .zip(PALETTE)
            .filter_map(|(((map, mapped), placed), color)| {
                let (pose, _) = (*placed)?;
                Some(Laid {
                    name: mapped.name,
                    map,
                    pose,
                    color,
                })
            })
            .collect();
        merged_panel(title, &maps)
    }
}

/// Welds the team's maps into the first one's frame, by the paper's method and by the default one, in the frames that they
/// have (near each other) and in frames anywhere.
pub(super) fn welds(team: &[Mapped], seed: u64, control: &dyn Control) -> Result<Vec<Welded>, WeldError> {
    let mut all = Vec::new();
    for near in [true, false] {
        let mut random = Random::new(seed, &[20, u64::from(near)]);
        let told: Vec<(OccupancyGrid, Pose2)> = team
            .iter()
            .enumerate()
            .map(|(k, mapped)| {
                let truth = team[0].pose_of(mapped);
                if near || k == 0 {
                    (mapped.map.clone(), truth)
                } else {
                    far(&mapped.map, truth, &mut random)
                }
            })
            .collect();
        for method in [MethodName::HoughPeaks, MethodName::Hough] {
            let inputs: Vec<WeldInput> = team
                .iter()
                .zip(&told)
                .map(|(mapped, (map, _))| WeldInput::new(mapped.name, Arc::new(map.clone())))
                .collect();
            let welded = weld(
                &inputs,
                &WeldOptions::new(MethodSpec::default_of(method).build()),
                control,
            )?;
            let placed = welded
                .set
                .placements
                .iter()
                .zip(&told)
                .map(|(placement, (map, truth))| {
                    let pose = placement.placed()?.pose_anchor_map;
                    Some((pose, Moments::of(map).distance(pose, *truth)))
                })
                .collect();
            all.push(Welded {
                method,
                near,
                placed,
                maps: told.iter().map(|(map, _)| map.clone()).collect(),
            });
        }
    }
    Ok(all)
}

/// Who was placed, and how well.
pub(super) fn weld_table(team: &[Mapped], welds: &[Welded]) -> Table {
    let mut table = Table::new(
        "fused",
        "All maps put into the first one's frame, by method and by where the frames lie to each other.",
        &[
            "method",
            "frames",
            "map",
            "placed",
            "error [m]",
            "error of the yaw [deg]",
        ],
    );
    for welded in welds {
        for (mapped, placed) in team.iter().zip(&welded.placed).skip(1) {
            let truth = team[0].pose_of(mapped);
            let turn = placed.map(|(pose, _)| (pose.yaw() - truth.yaw()).degrees().abs());
            table.push(vec![
                welded.method.as_str().into(),
                welded.frames().into(),
                mapped.name.into(),
                placed.is_some().into(),
                placed.map(|(_, error)| error).into(),
                turn.into(),
            ]);
        }
    }
    table
}

/// Two maps of a team and what is true of them.
pub(super) struct Pair {
    pub(super) fixed: usize,
    pub(super) moving: usize,
    pub(super) truth: Pose2,
    pub(super) common: Comparison,
}

/// All pairs of a team.
pub(super) fn pairs(team: &[Mapped]) -> Vec<Pair> {
    let of = |fixed: usize, moving: usize| {
        let truth = team[fixed].pose_of(&team[moving]);
        Pair {
            fixed,
            moving,
            truth,
            common: compare(&team[fixed].map, &team[moving].map, truth),
        }
    };
    (0..team.len())
        .flat_map(|a| (a + 1..team.len()).map(move |b| of(a, b)))
        .collect()
}

/// Every pair by the paper's method and the default one, in frames near each other.
pub(super) fn pair_table(team: &[Mapped], pairs: &[Pair], control: &dyn Control) -> (Table, Vec<[Answer; 2]>) {
    let mut table = Table::new(
        "pairs",
        "Every pair of maps on its own, frames within 20 cells of each other.",
        &[
            "fixed",
            "moving",
            "overlap [share]",
            "method",
            "merged",
            "why not",
            "V",
            "error of the best pose [m]",
        ],
    );
    let mut answers = Vec::new();
    for pair in pairs {
        let of = [MethodName::HoughPeaks, MethodName::Hough].map(|name| {
            let method = MethodSpec::default_of(name).build();
            let (fixed, moving) = (&team[pair.fixed], &team[pair.moving]);
            let answer = answer(&*method, &fixed.map, &moving.map, Some(pair.truth), control);
            table.push(vec![
                fixed.name.into(),
                moving.name.into(),
                pair.common.overlap.into(),
                name.as_str().into(),
                answer.merged.into(),
                answer.reason.into(),
                answer.verification_index.into(),
                answer.error_m.into(),
            ]);
            answer
        });
        answers.push(of);
    }
    (table, answers)
}

/// Each map in its own frame with the way of its robot, then what each method made of all of them in frames near each other.
pub(super) fn figure(name: &str, caption: &str, team: &[Mapped], welds: &[Welded]) -> Figure {
    let mut panels: Vec<Panel> = team
        .iter()
        .zip(PALETTE)
        .map(|(mapped, color)| {
            let title = format!(
                "{}: {:.1} m driven, {:.0} m2 known",
                mapped.name,
                mapped.driven_m,
                mapped.map.known_area()
            );
            let way = mapped
                .path
                .iter()
                .map(|place| mapped.pose_world_map.inverse().apply(*place))
                .collect();
            map_panel(&title, &mapped.map).with(Series::new("way of the robot", color, Mark::Line, way))
        })
        .collect();
    for welded in welds.iter().filter(|welded| welded.near) {
        let title = format!("{}: {}", welded.method, welded.words());
        panels.push(welded.panel(&title, team));
    }
    let columns = if panels.len() > 4 { 3 } else { 2 };
    Figure::new(name, caption, columns, panels)
}

/// Square metres of the world that at least one map knows, and that at least two know, on cells of 0.1 m.
pub(super) fn coverage_m2(team: &[Mapped]) -> [f64; 2] {
    const CELL: f64 = 0.1;
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for mapped in team {
        for corner in mapped.map.lattice().corners() {
            let at = mapped.pose_world_map.apply(corner);
            low = [0, 1].map(|k| low[k].min(at[k]));
            high = [0, 1].map(|k| high[k].max(at[k]));
        }
    }
    let cells = |k: usize| index(((high[k] - low[k]) / CELL).ceil()).max(1);
    let origin = Pose2::new(low[0], low[1], Angle::ZERO);
    let lattice = crate::grid::Lattice::new(cells(0), cells(1), CELL, origin).expect("invariant: a building");
    let mut times = vec![0_u32; lattice.cell_count()];
    for mapped in team {
        let laid = crate::grid::resample(&mapped.map, mapped.pose_world_map, lattice);
        for (times, cell) in times.iter_mut().zip(laid.cells()) {
            *times += u32::from(cell.state() != crate::grid::CellState::Unknown);
        }
    }
    [1, 2].map(|least| {
        let known = times.iter().filter(|times| **times >= least).count();
        super::numbers::real(known) * CELL * CELL
    })
}

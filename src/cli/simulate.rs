//! `mapweld simulate`: writes labelled pairs of simulated maps; sets and growing maps are `simulate_fleets`.

use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::{Value, json};

use super::files::write;
use super::terminal::{say, tell};
use super::{BadInput, Done, Failure, in_pool, simulate_fleets};
use crate::codec::{encode_png, encode_yaml};
use crate::geometry::Pose2;
use crate::grid::{CellState, OccupancyGrid};
use crate::simulation::{MapPair, PairRequest, Relation, SimulationError, Truth, WorldKind, generate_pair};

/// Write simulated maps with their truth: FOLDER/pairs.json, sets.json and growth.json, and FOLDER/maps.
///
/// The same seed and counts give the same files. `mapweld evaluate` measures on them. A list of which none is asked for is
/// not written.
#[derive(Debug, clap::Args)]
pub(super) struct Simulate {
    /// Where to write; made when it is not there.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Seed of everything.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Pairs of maps that overlap by 10 to 92 %.
    #[arg(long, default_value_t = 40)]
    matching: u64,
    /// Pairs of maps of the same building that have nothing in common.
    #[arg(long, default_value_t = 40)]
    same_building: u64,
    /// Pairs of maps of different buildings.
    #[arg(long, default_value_t = 20)]
    different: u64,
    /// Sets of maps: a fleet of robots in one building.
    #[arg(long, default_value_t = 0)]
    sets: u64,
    /// Growth sequences: the maps of a fleet as they grow.
    #[arg(long, default_value_t = 0)]
    growth: u64,
    /// Robots of a fleet.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..=100))]
    robots: u16,
    /// Robots of another building that are put among a set's, not to be placed.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=100))]
    strangers: u16,
    /// Kinds of worlds, separated by commas; all but campus when none is named: office, repetitive, hall, angled, clutter,
    /// flat, corridors, blocks, campus.
    #[arg(long, value_delimiter = ',')]
    kinds: Vec<WorldKind>,
    /// Different worlds of each kind.
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u64).range(1..=500))]
    worlds: u64,
    /// Threads to use; all of the machine when not given.
    #[arg(long)]
    threads: Option<NonZeroUsize>,
}

impl Simulate {
    pub(super) fn run(self) -> Result<Done, Failure> {
        fs::create_dir_all(self.out.join("maps")).bad_input(|| format!("cannot make {}", self.out.display()))?;
        let fleets = simulate_fleets::Fleets {
            out: &self.out,
            seed: self.seed,
            kinds: self.kinds(),
            robots: self.robots.into(),
            strangers: self.strangers.into(),
        };
        in_pool(self.threads, || {
            fleets.sets(self.sets).and_then(|()| fleets.growth(self.growth))
        })??;
        if self.matching + self.same_building + self.different == 0 {
            return Ok(Done::Entirely);
        }
        let requests = self.requests();
        let made: Vec<_> = in_pool(self.threads, || {
            requests
                .par_iter()
                .map(|request| make(request, &self.out))
                .collect::<Result<_, Failure>>()
        })??;
        let mut pairs = Vec::new();
        for pair in made {
            match pair {
                Ok(entry) => pairs.push(entry),
                Err(missing) => tell(&format!("left out: {missing}"))?,
            }
        }
        let text = serde_json::to_string_pretty(&pairs).map_err(anyhow::Error::from)?;
        write(&self.out, "pairs.json", text.as_bytes())?;
        say(&format!(
            "{} pairs of {} asked for in {}",
            pairs.len(),
            requests.len(),
            self.out.join("pairs.json").display()
        ))?;
        Ok(Done::Entirely)
    }

    fn kinds(&self) -> &[WorldKind] {
        if self.kinds.is_empty() {
            &WorldKind::BUILDINGS
        } else {
            &self.kinds
        }
    }

    /// Each relation goes round the kinds.
    fn requests(&self) -> Vec<PairRequest> {
        let kinds = self.kinds();
        [
            (Relation::Matching, self.matching),
            (Relation::SameBuilding, self.same_building),
            (Relation::DifferentBuildings, self.different),
        ]
        .into_iter()
        .flat_map(|(relation, count)| {
            let rounds = (0..).flat_map(|number| kinds.iter().map(move |&kind| (kind, number)));
            rounds
                .zip(0..count)
                .map(move |((kind, number), _)| (relation, kind, number))
        })
        .map(|(relation, kind, number)| PairRequest {
            seed: self.seed,
            relation,
            kind,
            worlds: self.worlds,
            number,
        })
        .collect()
    }
}

/// Makes one pair and writes its maps; its entry of the list, or why there is none.
fn make(request: &PairRequest, folder: &Path) -> Result<Result<Value, SimulationError>, Failure> {
    let pair = match generate_pair(request) {
        Ok(pair) => pair,
        Err(missing) => return Ok(Err(missing)),
    };
    let id = format!(
        "sim{}_{}_{}_{:03}",
        request.seed, request.relation, request.kind, request.number
    );
    let mut paths = Vec::new();
    for (role, map) in [("fixed", &pair.fixed), ("moving", &pair.moving)] {
        let stem = format!("{id}_{role}");
        write(folder, &format!("maps/{stem}.png"), &encode_png(map))?;
        let yaml = encode_yaml(map.lattice(), &format!("{stem}.png"));
        write(folder, &format!("maps/{stem}.yaml"), yaml.as_bytes())?;
        paths.push(format!("maps/{stem}.yaml"));
    }
    Ok(Ok(entry(&id, request, &pair, &paths)))
}

fn entry(id: &str, request: &PairRequest, pair: &MapPair, paths: &[String]) -> Value {
    let pose = |pose: Pose2| json!({"x": pose.x(), "y": pose.y(), "yaw": pose.yaw().radians()});
    let mut tags = vec!["simulated".to_owned(), request.relation.to_string()];
    tags.extend(pair.tags.iter().map(|&tag| tag.to_owned()));
    let mut entry = json!({
        "id": id,
        "source": request.kind.name(),
        "building": pair.building,
        "fixed": paths[0],
        "moving": paths[1],
    });
    match &pair.truth {
        Truth::Match {
            pose_fixed_moving,
            common,
        } => {
            entry["match"] = json!(true);
            entry["truth"] = pose(*pose_fixed_moving);
            entry["overlap"] = json!(common.overlap);
            entry["agreement"] = json!(common.agreement);
        }
        Truth::Apart { placement } => {
            tags.push("non-matching".to_owned());
            entry["match"] = json!(false);
            entry["truth"] = Value::Null;
            entry["overlap"] = json!(0.0);
            if let Some(placement) = placement {
                entry["placement"] = pose(*placement);
            }
        }
    }
    entry["tags"] = json!(tags);
    entry["moments"] = moments(&pair.moving);
    entry["tolerance"] = json!(0.5);
    entry
}

/// Count, mean and mean square distance from the origin of the occupied cells: what an error in metres needs.
fn moments(map: &OccupancyGrid) -> Value {
    let lattice = map.lattice();
    let (mut n, mut x, mut y, mut square) = (0_u32, 0.0, 0.0, 0.0);
    for row in 0..lattice.height() {
        for column in 0..lattice.width() {
            if map.at(column, row).state() == CellState::Occupied {
                let [px, py] = lattice.cell_center(column, row);
                n += 1;
                x += px;
                y += py;
                square += px * px + py * py;
            }
        }
    }
    let count = f64::from(n.max(1));
    json!({"n": n, "mean_x": x / count, "mean_y": y / count, "mean_r2": square / count})
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::files::MapFiles;
    use crate::codec::Limits;

    fn simulate(out: &Path, threads: usize) -> String {
        let command = Simulate {
            out: out.to_path_buf(),
            seed: 5,
            matching: 1,
            same_building: 1,
            different: 1,
            sets: 0,
            growth: 0,
            robots: 2,
            strangers: 0,
            kinds: vec![WorldKind::Blocks],
            worlds: 3,
            threads: NonZeroUsize::new(threads),
        };
        command.run().expect("it runs");
        fs::read_to_string(out.join("pairs.json")).expect("the list of pairs")
    }

    #[test]
    fn the_written_pairs_can_be_read_and_are_the_same_on_any_number_of_threads() {
        let folders = [1, 2].map(|_| tempfile::tempdir().expect("a temporary folder"));
        let text = simulate(folders[0].path(), 1);
        assert_eq!(text, simulate(folders[1].path(), 2));
        let pairs: Vec<Value> = serde_json::from_str(&text).expect("JSON");
        assert_eq!(pairs.len(), 3);
        for pair in &pairs {
            for role in ["fixed", "moving"] {
                let path = pair[role].as_str().expect("a path");
                let read = |folder: &Path| {
                    let files = MapFiles::read(&folder.join(path), &Limits::default()).expect("both files");
                    files.decode(&Limits::default()).expect("a map").grid
                };
                let grid = read(folders[0].path());
                assert_eq!(grid, read(folders[1].path()));
                let occupied = grid.state_counts().occupied;
                assert!(role == "fixed" || pair["moments"]["n"] == json!(occupied), "{path}");
            }
            assert_eq!(pair["match"].as_bool(), Some(!pair["truth"].is_null()));
        }
    }
}

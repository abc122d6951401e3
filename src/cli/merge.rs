//! `mapweld merge`: welds map files without a server.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use super::files::{self, MapFiles};
use super::merge_rules::MergeRules;
use super::placements::{self, all_placed};
use super::terminal::{say, tell};
use super::{BadInput, Done, Failure, Stopwatch, in_pool};
use crate::api::{MergeResult, Welded};
use crate::codec::{self, Decoded, Limits, OverlayLayer};
use crate::fusion::{self, Weld, WeldInput, WeldOptions};
use crate::model::{Digest, MethodSpec};
use crate::registration::MethodName;

/// What a command takes in, on the machine of whoever asks for it: the largest maps known (20768 x 13612 cells, 282 MB
/// as PGM) and a margin.
const LIMITS: Limits = Limits {
    bytes: 2 << 30,
    cells: 400_000_000,
    yaml_bytes: 64 << 10,
    yaml_depth: 8,
};

/// Merge map files into one, without a server.
///
/// Writes map.yaml, map.png, overlay.png and result.json into the output folder. The exit code is 0 when all maps were
/// placed, 3 when some were not, 2 when the input is bad.
#[derive(Debug, clap::Args)]
pub(super) struct Merge {
    /// The maps: ROS map YAML files beside their PNG or PGM.
    #[arg(required = true, num_args = 2.., value_name = "MAP.yaml")]
    maps: Vec<PathBuf>,
    /// Folder to write to; made when it is not there.
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// How pairs of maps are registered.
    #[arg(long, default_value = MethodName::ALL[0].as_str())]
    method: MethodName,
    /// The method's parameters that shall differ from its defaults, as a JSON object.
    #[arg(long, value_name = "JSON", default_value = "{}")]
    parameters: String,
    /// Name of the map in whose frame the result is told: the stem of its file's name. Default: the first map.
    #[arg(long, value_name = "NAME")]
    anchor: Option<String>,
    #[command(flatten)]
    rules: MergeRules,
    /// Threads to compute with. Default: one for each processor. The result is the same.
    #[arg(long, value_name = "COUNT")]
    threads: Option<NonZeroUsize>,
    /// Print the result as JSON, as in result.json, and no table.
    #[arg(long)]
    json: bool,
}

impl Merge {
    pub(super) fn run(self) -> Result<Done, Failure> {
        let method = method(self.method, &self.parameters)?;
        let files = self
            .maps
            .iter()
            .map(|path| MapFiles::read(path, &LIMITS))
            .collect::<Result<Vec<_>, _>>()?;
        let names = fusion::distinct_names(files.iter().map(MapFiles::stem));
        let anchor = self.anchor(&names)?;
        let (maps, weld, result) = in_pool(self.threads, || {
            let maps = decode(&files)?;
            let (weld, result) = merge(&maps, &names, anchor, &method, &self.rules)?;
            Ok::<_, Failure>((maps, weld, result))
        })??;
        write(&self.output, &maps, &names, &weld, &result)?;
        if self.json {
            say(&to_json(&result))?;
        } else {
            say(&placements::table(&result))?;
            say(&told_timings(&result))?;
            say(&format!("written to {}", self.output.display()))?;
        }
        Ok(if all_placed(&result) {
            Done::Entirely
        } else {
            Done::SomeNotPlaced
        })
    }

    fn anchor(&self, names: &[String]) -> Result<usize, Failure> {
        let Some(anchor) = &self.anchor else {
            return Ok(0);
        };
        names.iter().position(|name| name == anchor).ok_or_else(|| {
            Failure::bad_input(format!(
                "--anchor is {anchor:?}; it must be one of the maps: {}",
                names.join(", ")
            ))
        })
    }
}

fn method(name: MethodName, parameters: &str) -> Result<MethodSpec, Failure> {
    let parameters: serde_json::Value = serde_json::from_str(parameters)
        .bad_input(|| format!("--parameters is {parameters:?}; it must be a JSON object"))?;
    MethodSpec::new(name, Some(parameters)).bad_input(|| "--parameters")
}

fn decode(files: &[MapFiles]) -> Result<Vec<Arc<crate::grid::OccupancyGrid>>, Failure> {
    let decoded: Vec<Result<Decoded, Failure>> = files.par_iter().map(|map| map.decode(&LIMITS)).collect();
    let mut maps = Vec::with_capacity(files.len());
    for (map, decoded) in files.iter().zip(decoded) {
        let decoded = decoded?;
        for warning in &decoded.warnings {
            tell(&format!("warning: {}: {warning}", map.path.display()))?;
        }
        maps.push(Arc::new(decoded.grid));
    }
    Ok(maps)
}

/// The same steps as in the service, so that both give the same result.
fn merge(
    maps: &[Arc<crate::grid::OccupancyGrid>],
    names: &[String],
    anchor: usize,
    method: &MethodSpec,
    rules: &MergeRules,
) -> Result<(Weld, MergeResult), Failure> {
    let clock = Stopwatch::start();
    let mut inputs: Vec<WeldInput> = names
        .iter()
        .zip(maps)
        .map(|(name, grid)| WeldInput::new(name.clone(), Arc::clone(grid)))
        .collect();
    rules.put_priors(names, anchor, &mut inputs)?;
    let options = WeldOptions {
        anchor,
        forbidden: rules.forbidden(names)?,
        ..WeldOptions::new(method.build())
    };
    let weld = fusion::weld(&inputs, &options, &clock).bad_input(|| "cannot merge these maps")?;
    let took = clock.elapsed();
    let digests: Vec<Digest> = maps.par_iter().map(|grid| Digest::of_grid(grid)).collect();
    let welded = Welded {
        names,
        digests: &digests,
        anchor,
        method,
    };
    let result = MergeResult::of(&weld, &welded, took);
    Ok((weld, result))
}

fn write(
    folder: &Path,
    maps: &[Arc<crate::grid::OccupancyGrid>],
    names: &[String],
    weld: &Weld,
    result: &MergeResult,
) -> Result<(), Failure> {
    let fused = &weld.fused.grid;
    let layers: Vec<OverlayLayer<'_>> = (maps.iter().zip(names).zip(&weld.set.placements))
        .filter_map(|((grid, name), placement)| {
            let pose_target_map = placement.placed()?.pose_anchor_map;
            Some(OverlayLayer {
                name,
                grid,
                pose_target_map,
            })
        })
        .collect();
    let conflicts = weld.fused.conflicts.as_ref().map(fusion::Conflicts::mask);
    let overlay = codec::overlay(fused.lattice(), &layers, conflicts.as_deref());
    files::make_folder(folder)?;
    files::write(folder, "map.png", &codec::encode_png(fused))?;
    files::write(
        folder,
        "map.yaml",
        codec::encode_yaml(fused.lattice(), "map.png").as_bytes(),
    )?;
    files::write(folder, "overlay.png", &overlay.to_png())?;
    files::write(folder, "result.json", format!("{}\n", to_json(result)).as_bytes())
}

fn to_json(result: &MergeResult) -> String {
    serde_json::to_string_pretty(result).expect("invariant: a merge result is JSON")
}

fn told_timings(result: &MergeResult) -> String {
    let stages = result
        .timings
        .stages
        .iter()
        .map(|stage| format!("{} {:.2} s", stage.stage, stage.seconds));
    let stages = stages.collect::<Vec<_>>().join(", ");
    format!("{:.2} s: {stages}", result.timings.total_seconds)
}

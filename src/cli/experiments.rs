//! `mapweld experiments`: the paper's experiments, written as data, pictures and a page.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::Deserialize;

use super::files::{MapFiles, make_folder, write};
use super::terminal::say;
use super::{BadInput, Done, Failure, Stopwatch};
use crate::codec::Limits;
use crate::experiments::report::{Entry, file_of, page};
use crate::experiments::{
    ExperimentError, ExperimentName, Outcome, RecordedLabel, RecordedPair, Settings, Verdict, chosen, plot, run,
};
use crate::geometry::Pose2;
use crate::grid::OccupancyGrid;
use crate::registration::{Control, Stop};

/// Run the paper's experiments and write FOLDER/report.html with all pictures and numbers beside the paper's.
///
/// Everything is simulated and seeded: the same seed gives the same numbers, but for times. All experiments take about a
/// quarter of an hour on two cores.
#[derive(Debug, clap::Args)]
pub(super) struct Experiments {
    /// Which experiments; all when none is named: hough-properties, two-maps-step-by-step, four-robots, two-robots,
    /// three-robots, overlap-sweep, distortion-sweep, sensitivity, comparison, readings.
    #[arg(value_name = "NAME")]
    names: Vec<ExperimentName>,
    /// Where to write; made when it is not there.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Fewer seeds and pairs: a minute in all, to see whether everything runs.
    #[arg(long)]
    quick: bool,
    /// Seed of everything.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// A folder of recorded maps with a list pairs.json, for the comparison. Default: ../shared/maps where it exists.
    #[arg(long, value_name = "FOLDER")]
    maps: Option<PathBuf>,
}

/// Where recorded maps usually lie beside a clone.
const MAPS: &str = "../shared/maps";
/// Recorded pairs of each source, matching and not: what the comparison has time for.
const RECORDED_EACH: usize = 5;

impl Experiments {
    pub(super) fn run(self) -> Result<Done, Failure> {
        make_folder(&self.out)?;
        let names = if self.names.is_empty() {
            ExperimentName::ALL.to_vec()
        } else {
            self.names.clone()
        };
        let recorded = if names.contains(&ExperimentName::Comparison) {
            self.recorded()?
        } else {
            Vec::new()
        };
        let settings = Settings {
            seed: self.seed,
            quick: self.quick,
            recorded,
        };
        let whole = Stopwatch::start();
        let mut entries = Vec::new();
        for name in names {
            let (outcome, took) = watched(name, &settings)?;
            self.write(&outcome)?;
            say(&line(&outcome, took))?;
            entries.push(Entry {
                outcome,
                seconds: took.as_secs_f64(),
            });
            // after each, so that an interrupted run leaves a page of what is done
            write(
                &self.out,
                "report.html",
                page(&entries, &self.words(&settings)).as_bytes(),
            )?;
        }
        say(&format!(
            "{} in {:.0} s",
            self.out.join("report.html").display(),
            whole.elapsed().as_secs_f64()
        ))?;
        Ok(Done::Entirely)
    }

    fn words(&self, settings: &Settings) -> String {
        format!(
            "Seed {}{}; mapweld {}, {} threads{}.",
            self.seed,
            if self.quick {
                ", quick: far fewer seeds and pairs than the full run"
            } else {
                ""
            },
            env!("CARGO_PKG_VERSION"),
            rayon::current_num_threads(),
            if settings.recorded.is_empty() {
                String::new()
            } else {
                format!("; {} pairs of recorded maps in the comparison", settings.recorded.len())
            }
        )
    }

    /// A folder for the experiment: its tables as CSV, everything as JSON, its figures as PNG and SVG.
    fn write(&self, outcome: &Outcome) -> Result<(), Failure> {
        make_folder(&self.out.join(outcome.name.as_str()))?;
        for table in &outcome.tables {
            write(&self.out, &file_of(outcome, &table.name, "csv"), table.csv().as_bytes())?;
        }
        let json = serde_json::to_string_pretty(&outcome.json()).map_err(anyhow::Error::from)?;
        write(&self.out, &file_of(outcome, "outcome", "json"), json.as_bytes())?;
        outcome.figures.par_iter().try_for_each(|figure| {
            let drawn = plot::draw(figure).map_err(anyhow::Error::from)?;
            write(&self.out, &file_of(outcome, &figure.name, "png"), &drawn.png)?;
            write(&self.out, &file_of(outcome, &figure.name, "svg"), drawn.svg.as_bytes())
        })
    }

    /// An evenly spread part of the recorded pairs, if there are any.
    fn recorded(&self) -> Result<Vec<RecordedPair>, Failure> {
        let folder = match &self.maps {
            Some(folder) => folder.clone(),
            None if Path::new(MAPS).join("pairs.json").is_file() => PathBuf::from(MAPS),
            None => return Ok(Vec::new()),
        };
        let list = folder.join("pairs.json");
        let text = fs::read(&list).bad_input(|| list.display().to_string())?;
        let listed: Vec<Listed> = serde_json::from_slice(&text).bad_input(|| list.display().to_string())?;
        let labels: Vec<RecordedLabel> = listed.iter().map(Listed::label).collect();
        let each = if self.quick { 1 } else { RECORDED_EACH };
        let read = |name: &str| -> Result<Arc<OccupancyGrid>, Failure> {
            let limits = Limits::default();
            Ok(Arc::new(
                MapFiles::read(&folder.join(name), &limits)?.decode(&limits)?.grid,
            ))
        };
        chosen(&labels, each)
            .into_par_iter()
            .map(|index| {
                let pair = &listed[index];
                Ok(RecordedPair {
                    label: labels[index].clone(),
                    fixed: read(&pair.fixed)?,
                    moving: read(&pair.moving)?,
                    truth: pair.truth,
                    tolerance_m: pair.tolerance,
                })
            })
            .collect()
    }
}

/// What is read of a labelled pair of recorded maps.
#[derive(Debug, Deserialize)]
struct Listed {
    id: String,
    source: String,
    fixed: String,
    moving: String,
    #[serde(rename = "match")]
    matching: bool,
    truth: Option<Pose2>,
    #[serde(default = "half_a_metre")]
    tolerance: f64,
}

fn half_a_metre() -> f64 {
    0.5
}

impl Listed {
    fn label(&self) -> RecordedLabel {
        RecordedLabel {
            id: self.id.clone(),
            source: self.source.clone(),
            matching: self.matching,
        }
    }
}

/// Runs one experiment with a bar that tells how far it has come.
fn watched(name: ExperimentName, settings: &Settings) -> Result<(Outcome, Duration), Failure> {
    let style = ProgressStyle::with_template("{prefix:>22} [{bar:32}] {pos}/{len}  {elapsed}, {eta} left")
        .expect("invariant: the template is well formed")
        .progress_chars("=> ");
    let bar = ProgressBar::new(0).with_style(style).with_prefix(name.as_str());
    bar.enable_steady_tick(Duration::from_millis(200));
    let watch = Watch {
        since: Stopwatch::start(),
        bar: bar.clone(),
    };
    let outcome = run(name, settings, &watch);
    bar.finish_and_clear();
    match outcome {
        Ok(outcome) => Ok((outcome, watch.since.elapsed())),
        Err(error @ (ExperimentError::Simulation(_) | ExperimentError::Weld(_) | ExperimentError::Stopped)) => {
            Err(anyhow::Error::new(error).context(name.as_str()).into())
        }
    }
}

/// The clock and the bar of one experiment.
struct Watch {
    since: Stopwatch,
    bar: ProgressBar,
}

impl Control for Watch {
    fn now(&self) -> Duration {
        self.since.elapsed()
    }

    fn should_stop(&self) -> Option<Stop> {
        None
    }

    fn progress(&self, done: usize, total: usize) {
        self.bar.set_length(total as u64);
        self.bar.set_position(done as u64);
    }
}

fn line(outcome: &Outcome, took: Duration) -> String {
    let count = |verdict| outcome.claims.iter().filter(|claim| claim.verdict == verdict).count();
    format!(
        "{:>22}  {:6.1} s  {} claims hold, {} in part, {} do not",
        outcome.name.as_str(),
        took.as_secs_f64(),
        count(Verdict::Holds),
        count(Verdict::InPart),
        count(Verdict::Fails)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_links_only_files_that_were_written() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let command = Experiments {
            names: vec![ExperimentName::HoughProperties, ExperimentName::TwoRobots],
            out: folder.path().join("report"),
            quick: true,
            seed: 1,
            maps: None,
        };
        command.run().expect("it runs");
        let html = fs::read_to_string(folder.path().join("report/report.html")).expect("the page");
        let mut links: Vec<&str> = html
            .split("href=\"")
            .chain(html.split("src=\""))
            .skip(1)
            .filter_map(|rest| rest.split('"').next())
            .filter(|link| link.contains('/') && !link.contains(' '))
            .collect();
        links.sort_unstable();
        links.dedup();
        assert!(links.len() >= 12, "{links:?}");
        for link in links {
            let path = folder.path().join("report").join(link);
            assert!(
                path.is_file() && fs::metadata(&path).expect("its size").len() > 20,
                "{link}"
            );
        }
    }

    #[test]
    fn a_folder_without_a_list_is_refused_by_name() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let command = Experiments {
            names: vec![ExperimentName::Comparison],
            out: folder.path().join("report"),
            quick: true,
            seed: 1,
            maps: Some(folder.path().to_path_buf()),
        };
        let Err(Failure::BadInput(error)) = command.run() else {
            panic!("there is no list")
        };
        assert!(format!("{error:#}").contains("pairs.json"), "{error:#}");
    }
}

//! `mapweld evaluate`: answers for a list of labelled pairs, one JSON object a line, as a scorer reads them; lists of whole
//! sets are `evaluate_sets`.

use std::collections::BTreeMap;
use std::fs;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{ArgGroup, Args};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::files::MapFiles;
use super::{Done, Failure, Stopwatch, evaluate_sets, in_pool, say};
use crate::codec::Limits;
use crate::geometry::Pose2;
use crate::registration::methods::hough::{Hough, HoughParameters};
use crate::registration::{MapFeatures, Method, MethodName, MethodSpec, Registration};

/// Registers labelled pairs, sets or growing maps and prints one line of JSON each.
#[derive(Debug, Args)]
#[command(group(ArgGroup::new("list").required(true).args(["pairs", "sets", "growth"])))]
pub(super) struct Evaluate {
    /// The list of pairs: JSON objects with `id`, `fixed` and `moving`, the maps' YAML files relative to the list.
    #[arg(long, value_name = "PAIRS.json")]
    pairs: Option<PathBuf>,
    /// A list of sets instead: JSON objects with `id`, `maps` and their `poses` in the world, null for a map of another
    /// place.
    #[arg(long, value_name = "SETS.json")]
    sets: Option<PathBuf>,
    /// A list of growth sequences instead: JSON objects with `id` and `robots`, each with a `name`, its `pose` and its
    /// `snapshots`.
    #[arg(long, value_name = "GROWTH.json")]
    growth: Option<PathBuf>,
    /// The registration method.
    #[arg(long, default_value_t = MethodName::ALL[0])]
    method: MethodName,
    /// Parameters of the method as a JSON object; those left out keep their defaults.
    #[arg(long, value_name = "JSON", default_value = "{}")]
    parameters: String,
    /// Threads of a registration; as many as the machine has when left out.
    #[arg(long)]
    threads: Option<NonZeroUsize>,
    /// Only pairs whose id contains this.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,
    /// Register every pair so many times and tell the least time.
    #[arg(long, default_value = "1")]
    repeat: NonZeroUsize,
    /// Also write all hypotheses of each pair that were looked at closely, with what their scores are made of and what
    /// speaks for and against each, one line a pair: for fitting the decision of the method `hough`.
    #[arg(long, value_name = "FILE")]
    hypotheses: Option<PathBuf>,
}

/// What is read of a labelled pair; whatever else it says is the scorer's.
#[derive(Debug, Deserialize)]
struct LabelledPair {
    id: String,
    fixed: String,
    moving: String,
}

/// A map's features and the time they took.
struct Prepared {
    features: MapFeatures,
    seconds: f64,
}

impl Evaluate {
    pub(super) fn run(&self) -> Result<Done, Failure> {
        let (only, method) = (self.only.as_deref(), self.spec()?.build());
        in_pool(self.threads, || match (&self.pairs, &self.sets, &self.growth) {
            (Some(list), ..) => self.pairs(list, &*method),
            (_, Some(list), _) => evaluate_sets::sets(list, only, &method),
            (.., Some(list)) => evaluate_sets::growth(list, only, &method),
            (None, None, None) => unreachable!("invariant: the arguments require one list"),
        })??;
        Ok(Done::Entirely)
    }

    fn pairs(&self, list: &Path, method: &dyn Method) -> Result<(), Failure> {
        let text = fs::read(list).map_err(|error| bad(list, error))?;
        let mut pairs: Vec<LabelledPair> = serde_json::from_slice(&text).map_err(|error| bad(list, error))?;
        if let Some(only) = &self.only {
            pairs.retain(|pair| pair.id.contains(only));
        }
        let examined = self.hypotheses.is_some().then(|| self.hough()).transpose()?;
        let folder = list.parent().unwrap_or(Path::new(""));
        let mut last_use: BTreeMap<&str, usize> = BTreeMap::new();
        for (index, pair) in pairs.iter().enumerate() {
            last_use.insert(&pair.fixed, index);
            last_use.insert(&pair.moving, index);
        }
        let bar = progress(pairs.len());
        let mut prepared: BTreeMap<&str, Prepared> = BTreeMap::new();
        let mut hypotheses = String::new();
        for (index, pair) in pairs.iter().enumerate() {
            bar.inc(1);
            for name in [&pair.fixed, &pair.moving] {
                if !prepared.contains_key(name.as_str()) {
                    prepared.insert(name, self.prepare(method, &folder.join(name))?);
                }
            }
            let (fixed, moving) = (&prepared[pair.fixed.as_str()], &prepared[pair.moving.as_str()]);
            let (answer, search) = self.least_time(|| {
                let watch = Stopwatch::start();
                let answer = method.register(&fixed.features, &moving.features, &watch);
                (answer, watch.elapsed())
            });
            let mut line = line(&answer);
            line.insert("id".into(), json!(pair.id));
            line.insert(
                "seconds".into(),
                json!(fixed.seconds + moving.seconds + search.as_secs_f64()),
            );
            line.insert("search_seconds".into(), json!(search.as_secs_f64()));
            say(&Value::Object(line).to_string())?;
            if let Some(hough) = &examined {
                let all = hough.examine(&fixed.features, &moving.features);
                hypotheses += &json!({"id": pair.id, "hypotheses": all}).to_string();
                hypotheses.push('\n');
            }
            // maps are let go after their last pair: a list may name more than fit into memory
            prepared.retain(|name, _| last_use[name] > index);
        }
        bar.finish_and_clear();
        if let Some(path) = &self.hypotheses {
            fs::write(path, hypotheses).map_err(|error| bad(path, error))?;
        }
        Ok(())
    }

    fn spec(&self) -> Result<MethodSpec, Failure> {
        let parameters = serde_json::from_str(&self.parameters)
            .map_err(|error| Failure::BadInput(anyhow::Error::new(error).context("--parameters")))?;
        MethodSpec::new(self.method, Some(parameters)).map_err(|error| Failure::BadInput(error.into()))
    }

    fn hough(&self) -> Result<Hough, Failure> {
        if self.method != MethodName::Hough {
            return Err(Failure::bad_input(format!(
                "--hypotheses needs the method hough, not {}",
                self.method
            )));
        }
        let parameters: HoughParameters = serde_json::from_str(&self.parameters)
            .map_err(|error| Failure::BadInput(anyhow::Error::new(error).context("--parameters")))?;
        Hough::new(parameters).map_err(|error| Failure::BadInput(error.into()))
    }

    fn prepare(&self, method: &dyn Method, path: &Path) -> Result<Prepared, Failure> {
        let limits = Limits::default();
        let map = MapFiles::read(path, &limits)?.decode(&limits)?.grid;
        let (features, time) = self.least_time(|| {
            let watch = Stopwatch::start();
            let features = method.features(&map);
            (features, watch.elapsed())
        });
        Ok(Prepared {
            features,
            seconds: time.as_secs_f64(),
        })
    }

    fn least_time<T>(&self, mut work: impl FnMut() -> (T, Duration)) -> (T, Duration) {
        let mut best = work();
        for _ in 1..self.repeat.get() {
            let again = work();
            if again.1 < best.1 {
                best = again;
            }
        }
        best
    }
}

fn bad(path: &Path, error: impl std::error::Error + Send + Sync + 'static) -> Failure {
    Failure::BadInput(anyhow::Error::new(error).context(path.display().to_string()))
}

fn progress(pairs: usize) -> ProgressBar {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} pairs, {eta} left")
        .expect("invariant: the template is well formed");
    ProgressBar::new(pairs as u64).with_style(style)
}

/// The answer itself, the reason, and the evidence.
fn line(answer: &Registration) -> Map<String, Value> {
    let mut line = Map::new();
    let mut put = |key: &str, value: Value| {
        line.insert(key.to_owned(), value);
    };
    put("id", Value::Null); // first in the line; filled in by the caller
    match answer {
        Registration::Accepted(acceptance) => {
            put("merged", json!(true));
            put_pose(&mut put, acceptance.pose_fixed_moving);
            put(
                "sigma_m",
                json!(acceptance.covariance.0[0][0].max(acceptance.covariance.0[1][1]).sqrt()),
            );
        }
        Registration::Rejected(rejection) => {
            put("merged", json!(false));
            put("reason", json!(format!("{:?}", rejection.reason)));
            if let Some(best) = rejection.candidates.first() {
                put_pose(&mut put, best.pose_fixed_moving);
            }
        }
    }
    if let Some(evidence) = answer.best_evidence() {
        put("score", json!(evidence.score));
        put("probability", json!(evidence.probability));
        put("verification_index", json!(evidence.verification_index));
        put("overlap", json!(evidence.overlap));
        put("matched_wall_m", json!(evidence.matched_wall_m));
        put("violated_wall_m", json!(evidence.violated_wall_m));
        put("weaker_direction_m", json!(evidence.weaker_direction_m));
        put("runner_up_score", json!(evidence.runner_up.map(|rival| rival.score)));
        put(
            "runner_up_distance_m",
            json!(evidence.runner_up.map(|rival| rival.distance_m)),
        );
    }
    let stages: Map<String, Value> = answer
        .stages()
        .iter()
        .map(|stage| (stage.stage.to_owned(), json!(stage.duration.as_secs_f64())))
        .collect();
    put("stages", Value::Object(stages));
    line
}

fn put_pose(put: &mut impl FnMut(&str, Value), pose: Pose2) {
    put("x", json!(pose.x()));
    put("y", json!(pose.y()));
    put("yaw", json!(pose.yaw().radians()));
}

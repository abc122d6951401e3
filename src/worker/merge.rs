//! One merge, told as a story: the newest maps are loaded, welded into one, drawn and kept.

use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use bytes::Bytes;
use futures_util::future::try_join_all;

use super::memory::{Memory, Remembering};
use super::order::Order;
use super::work::{Done, Failure, Progress, Work};
use crate::api::{MergeResult, Welded};
use crate::codec::{OverlayLayer, decode_cells, encode_cells, encode_png, overlay};
use crate::compute::{Compute, RunControl};
use crate::failpoint::{self, Point};
use crate::fusion::{Conflicts, FuseError, Weld, WeldError, WeldInput, WeldOptions, weld};
use crate::model::{
    Constraint, ConstraintId, Digest, Job, JobError, JobKind, MapRecord, MergeRequest, ResultText, Session,
    StageSeconds, VersionInput, VersionNumber, VersionSelector,
};
use crate::registration::{Control, Method, Stop};
use crate::store::{Blobs, NewVersion, Page, Store, StoreError, keep_blob};

/// Does merges.
#[derive(Clone)]
pub struct Merges {
    /// Where sessions and maps are looked up.
    pub store: Arc<dyn Store>,
    /// Where the cells of maps are, and where those of versions go.
    pub blobs: Blobs,
    /// Where it is computed.
    pub compute: Compute,
    /// What was computed before.
    pub memory: Memory,
    /// The most cells of a fused map.
    pub cells_max: u64,
}

/// What share of the work is done when a stage begins; registration takes most of the time.
const LOADED: f64 = 0.05;
const WELDED: f64 = 0.90;
const DRAWN: f64 = 0.95;

#[async_trait]
impl Work for Merges {
    async fn run(&self, job: &Job, control: &RunControl, progress: &Progress) -> Result<Done, Failure> {
        let JobKind::Merge = job.kind;
        let mut times = Times::start(control);
        progress.stage("load", 0.0);
        let session = self.store.get_session(&job.session).await?;
        if let Some(version) = job.request.restore {
            return self.restore(&session, version, &job.request).await;
        }
        let newest = self.store.newest_maps(&job.session).await?;
        let mut order = Order::new(&session, newest, &job.request)?;
        let standing = self.store.list_constraints(&job.session, &all_constraints()).await?;
        let earlier = self.earlier(&job.session, &order.maps, order.anchor()).await?;
        order.steer(job, standing, &earlier.poses)?;
        let mut inputs = self.load(&order).await?;
        self.put_earlier(&earlier, &order.maps, &mut inputs).await?;
        times.end("load");

        progress.stage("weld", LOADED);
        let work = Merge {
            memory: self.memory.clone(),
            cells_max: self.cells_max,
            control: control.clone(),
            progress: progress.clone(),
        };
        failpoint::reach(Point::MidMerge);
        let order = Arc::new(order);
        let merged = {
            let order = Arc::clone(&order);
            self.compute.run(move || work.run(&order, &inputs)).await??
        };
        times.stages.extend(merged.stages);
        if job.request.dry_run {
            return Ok(Done::DryRun {
                result: merged.result,
                timings: times.stages,
            });
        }

        times.begin();
        progress.stage("keep", DRAWN);
        let now = control.wall_clock();
        let [grid, png, overlay] = merged
            .pictures
            .map(|bytes| keep_blob(&*self.store, &self.blobs, bytes, now));
        let (grid, png, overlay) = futures_util::try_join!(grid, png, overlay)?;
        times.end("keep");
        failpoint::reach(Point::BeforePublish);
        Ok(Done::Version(Box::new(NewVersion {
            anchor: order.maps[order.anchor].robot.clone(),
            inputs: order.maps.iter().map(input_of).collect(),
            result: merged.result,
            grid,
            png,
            overlay,
            digest: merged.digest,
            restored_from: None,
            reanchors: job.request.anchor.is_some(),
            timings: times.stages,
        })))
    }
}

/// All of them: a session has no more.
fn all_constraints() -> Page<ConstraintId> {
    Page::first(Constraint::COUNT_MAX)
}

impl Merges {
    /// The content of an earlier version, as the session's newest one. The session frame goes back with it.
    async fn restore(&self, session: &Session, number: VersionNumber, request: &MergeRequest) -> Result<Done, Failure> {
        let found = self
            .store
            .get_version(&session.id, VersionSelector::Number(number))
            .await;
        let version = match found {
            Ok(version) => version,
            Err(StoreError::NotFound(missing)) => {
                return Err(Failure::for_good(
                    "version_gone",
                    format!("{missing} does not exist any more"),
                ));
            }
            Err(error) => return Err(error.into()),
        };
        if request.dry_run {
            return Ok(Done::DryRun {
                result: version.result,
                timings: Vec::new(),
            });
        }
        Ok(Done::Version(Box::new(NewVersion {
            reanchors: session.settings.anchor.as_ref() != Some(&version.anchor),
            anchor: version.anchor,
            inputs: version.inputs,
            result: version.result,
            grid: version.grid,
            png: version.png,
            overlay: version.overlay,
            digest: version.digest,
            restored_from: Some(version.restored_from.unwrap_or(version.number)),
            timings: Vec::new(),
        })))
    }

    async fn load(&self, order: &Order) -> Result<Vec<WeldInput>, Failure> {
        let mut inputs = try_join_all(order.maps.iter().map(|record| async {
            let bytes = self.blobs.get(record.map.blob).await?;
            let decoded = self.compute.run(move || decode_cells(&bytes)).await?;
            let grid = decoded.map_err(|error| {
                Failure::for_good(
                    "store_damaged",
                    format!("map {} of robot {}: {error}", record.id, record.robot),
                )
            })?;
            Ok::<_, Failure>(WeldInput::new(record.robot.as_str(), Arc::new(grid)))
        }))
        .await?;
        order.steered.put_priors(&order.robots(), &mut inputs);
        Ok(inputs)
    }
}

fn input_of(record: &MapRecord) -> VersionInput {
    VersionInput {
        robot: record.robot.clone(),
        map: record.id,
        digest: record.map.digest,
    }
}

/// The part of a merge that computes.
struct Merge {
    memory: Memory,
    cells_max: u64,
    control: RunControl,
    progress: Progress,
}

/// What a merge computes.
struct Merged {
    result: ResultText,
    digest: Digest,
    /// Cells, picture, overlay.
    pictures: [Bytes; 3],
    stages: Vec<StageSeconds>,
}

impl Merge {
    fn run(&self, order: &Order, inputs: &[WeldInput]) -> Result<Merged, Failure> {
        let key = serde_json::to_vec(&order.method).expect("invariant: a method is plain data");
        let method = self.memory.remembering(order.method.build(), Digest::of_bytes(&key));
        let mut options = WeldOptions::new(Arc::clone(&method) as Arc<dyn Method>);
        options.anchor = order.anchor;
        order.steered.put_pairs(&order.robots(), &mut options);
        options.fuse.resolution = order.resolution;
        options.fuse.cells_max = self.cells_max;
        let began = self.control.now();
        let watched = Watched {
            control: &self.control,
            progress: &self.progress,
            method: &method,
            pairs: inputs.len() * inputs.len().saturating_sub(1) / 2,
        };
        let weld = weld(inputs, &options, &watched).map_err(|error| failure(&error))?;
        let took = self.control.now().saturating_sub(began);

        let names: Vec<String> = inputs.iter().map(|input| input.name.clone()).collect();
        let digests: Vec<Digest> = order.maps.iter().map(|record| record.map.digest).collect();
        let welded = Welded {
            names: &names,
            digests: &digests,
            anchor: order.anchor,
            method: &order.method,
        };
        let mut result = MergeResult::of(&weld, &welded, took);
        result.constraints.clone_from(&order.steered.told);

        let mut times = Times::start(&self.control);
        self.progress.stage("draw", WELDED);
        let grid = &weld.fused.grid;
        let (cells, (png, overlay)) = rayon::join(
            || encode_cells(grid),
            || rayon::join(|| encode_png(grid), || draw_overlay(inputs, &weld)),
        );
        times.end("draw");
        let mut stages = result.timings.stages.clone();
        stages.append(&mut times.stages);
        Ok(Merged {
            digest: result.fused.digest,
            result: ResultText::of(&result).expect("invariant: a merge result is JSON"),
            pictures: [cells, png, overlay].map(Bytes::from),
            stages,
        })
    }
}

fn draw_overlay(inputs: &[WeldInput], weld: &Weld) -> Vec<u8> {
    let layers: Vec<OverlayLayer<'_>> = inputs
        .iter()
        .zip(&weld.set.placements)
        .filter_map(|(input, placement)| {
            Some(OverlayLayer {
                name: &input.name,
                grid: &input.grid,
                pose_target_map: placement.placed()?.pose_anchor_map,
            })
        })
        .collect();
    let conflicts = weld.fused.conflicts.as_ref().map(Conflicts::mask);
    overlay(weld.fused.grid.lattice(), &layers, conflicts.as_deref()).to_png()
}

fn failure(error: &WeldError) -> Failure {
    let code = match error {
        WeldError::Stopped(stop) => return Failure::Stopped(*stop),
        WeldError::Fuse(FuseError::Memory { .. }) => {
            return Failure::ForNow(JobError::new("out_of_memory", error.to_string()));
        }
        WeldError::Fuse(_) => "fused_map_too_large",
        _ => "bad_merge",
    };
    Failure::for_good(code, error.to_string())
}

/// The control of a weld, which tells how many of the pairs are done whenever the weld looks at it.
struct Watched<'a> {
    control: &'a RunControl,
    progress: &'a Progress,
    method: &'a Remembering,
    pairs: usize,
}

impl Control for Watched<'_> {
    fn now(&self) -> Duration {
        self.control.now()
    }

    fn should_stop(&self) -> Option<Stop> {
        self.progress
            .done(LOADED + (WELDED - LOADED) * share(self.method.registered(), self.pairs));
        self.control.should_stop()
    }
}

#[expect(clippy::cast_precision_loss, reason = "for people, and sessions have few robots")]
fn share(done: usize, all: usize) -> f64 {
    (done as f64 / all.max(1) as f64).min(1.0)
}

/// How long each stage took.
struct Times<'a> {
    control: &'a RunControl,
    began: Duration,
    stages: Vec<StageSeconds>,
}

impl<'a> Times<'a> {
    fn start(control: &'a RunControl) -> Self {
        Self {
            control,
            began: control.now(),
            stages: Vec::new(),
        }
    }

    fn begin(&mut self) {
        self.began = self.control.now();
    }

    fn end(&mut self, stage: &str) {
        let now = self.control.now();
        self.stages.push(StageSeconds {
            stage: stage.to_owned(),
            seconds: now.saturating_sub(self.began).as_secs_f64(),
        });
        self.began = now;
    }
}

#[cfg(test)]
#[path = "merge_bench.rs"]
mod bench;
#[cfg(test)]
#[path = "merge_tests.rs"]
mod tests;

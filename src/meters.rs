//! What can be measured of a running server: counts and times for Prometheus, at `/metrics`.
//!
//! Imports nothing of the crate: every room that has something to count calls a function of this one. What is counted is
//! told apart by a few words that stand in this program (routes, reasons, stages), never by names from outside, so that
//! the number of series is bounded. [`ALL`] is the table of them; `docs/operations.md` repeats it, held by a test.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use metrics::{counter, gauge, histogram};
use metrics_exporter_prometheus::{Matcher, PrometheusBuilder, PrometheusHandle};

/// Something that is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Meter {
    /// Its name.
    pub name: &'static str,
    /// What kind of figure it is.
    pub kind: Kind,
    /// What tells its figures apart.
    pub labels: &'static [&'static str],
    /// What it tells.
    pub what: &'static str,
}

/// A kind of figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Only grows, from 0 at the start of the server.
    Counter,
    /// As it is now.
    Gauge,
    /// Seconds, in buckets.
    Histogram,
}

impl Kind {
    /// As Prometheus calls it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Counter => "counter",
            Self::Gauge => "gauge",
            Self::Histogram => "histogram",
        }
    }
}

macro_rules! meters {
    ($($constant:ident = $kind:ident $name:literal [$($label:literal),*] $what:literal;)*) => {
        $(const $constant: &str = $name;)*

        /// All that is measured.
        pub const ALL: &[Meter] = &[
            $(Meter { name: $name, kind: Kind::$kind, labels: &[$($label),*], what: $what },)*
        ];
    };
}

meters! {
    BUILD = Gauge "mapweld_build_info" ["version"] "Always 1; the version tells which program runs.";
    REQUESTS = Counter "mapweld_http_requests_total" ["route", "method", "status"]
        "Requests that were answered. `none` is the route of those that met no operation, or were refused before.";
    REQUEST_SECONDS = Histogram "mapweld_http_request_seconds" ["route", "method"]
        "Time from a request's head to the head of its answer.";
    SHED = Counter "mapweld_http_shed_total" ["reason"]
        "Requests that were refused because there is too much to do: which bound was met.";
    NAMED = Counter "mapweld_named_requests_total" ["outcome"]
        "Requests with an Idempotency-Key: `begun`, `replayed`, `under_way` or `other_request`.";
    UPLOADS = Counter "mapweld_uploads_total" ["outcome"]
        "Maps that were taken in: `created`, or `known` when the session had them.";
    UPLOAD_BYTES = Counter "mapweld_upload_bytes_total" [] "Bytes of the bodies of uploads that were read whole.";
    QUEUE = Gauge "mapweld_queue_jobs" ["state"]
        "Jobs in the database, the same at every replica: `queued` or `running`. NaN while it does not answer.";
    WORKERS = Gauge "mapweld_workers" [] "Jobs that this server does at one time at most.";
    WORKERS_BUSY = Gauge "mapweld_workers_busy" [] "Jobs that this server does right now.";
    ATTEMPTS = Counter "mapweld_job_attempts_total" ["outcome"]
        "Attempts at jobs that this server has ended: `published`, `dry_run`, `failed`, `retried`, `cancelled`, \
         `given_back` or `lost`.";
    STAGE_SECONDS = Histogram "mapweld_job_stage_seconds" ["stage"] "Time of each stage of a job that succeeded.";
    ATTEMPT_SECONDS = Histogram "mapweld_job_attempt_seconds" [] "Time of an attempt at a job, however it ended.";
    WAIT_SECONDS = Histogram "mapweld_job_wait_seconds" [] "Time from when a job was due to when it was begun.";
    RECLAIMS = Counter "mapweld_lease_reclaims_total" ["outcome"]
        "Jobs that were taken from a worker of which nothing was heard any more: `begun_again`, or `parked` when no \
         attempt was left or somebody had cancelled it.";
    ROBOTS = Counter "mapweld_robots_total" ["outcome", "reason"]
        "Robots of published versions: `placed`, or `not_placed` with the reason.";
    STORE_ERRORS = Counter "mapweld_store_errors_total" ["part", "kind"]
        "Failures of the database (`records`) or of the blobs: `unavailable` or `damaged`.";
    SWEPT = Counter "mapweld_swept_total" ["what"]
        "What keeping house has removed: `versions`, `maps`, `blobs`, `answers`, `jobs`.";
}

/// Buckets of times: from a probe to a long merge.
const SECONDS: [f64; 15] = [
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 60.0, 600.0,
];

/// Words that stand for figures which begin at 0, so that their first step is seen.
const AT_ZERO: &[(&str, &str, &[&str])] = &[
    (
        SHED,
        "reason",
        &[
            "connections",
            "requests",
            "waiting",
            "merges",
            "uploads",
            "queue",
            "key_rate",
        ],
    ),
    (
        NAMED,
        "outcome",
        &["begun", "replayed", "gone", "under_way", "other_request"],
    ),
    (UPLOADS, "outcome", &["created", "known"]),
    (
        ATTEMPTS,
        "outcome",
        &[
            "published",
            "dry_run",
            "failed",
            "retried",
            "cancelled",
            "given_back",
            "lost",
        ],
    ),
    (RECLAIMS, "outcome", &["begun_again", "parked"]),
    (SWEPT, "what", &["versions", "maps", "blobs", "answers", "jobs"]),
];

static EXPOSITION: OnceLock<Option<PrometheusHandle>> = OnceLock::new();

/// Begins to measure in this process. A second call changes nothing.
///
/// # Errors
/// When something else measures in this process already.
pub fn install() -> Result<(), Taken> {
    let installed = EXPOSITION.get_or_init(|| {
        let histograms = ALL.iter().filter(|meter| meter.kind == Kind::Histogram);
        let builder = histograms.fold(PrometheusBuilder::new(), |builder, meter| {
            let name = Matcher::Full(meter.name.to_owned());
            let with_buckets = builder.set_buckets_for_metric(name, &SECONDS);
            with_buckets.expect("invariant: there are buckets")
        });
        let handle = builder.install_recorder().ok()?;
        begin();
        Some(handle)
    });
    installed.as_ref().map(|_| ()).ok_or(Taken)
}

/// Something else measures in this process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("something else collects metrics in this process")]
pub struct Taken;

/// Describes what is measured, and lets counters begin at 0.
fn begin() {
    for meter in ALL {
        match meter.kind {
            Kind::Counter => metrics::describe_counter!(meter.name, meter.what),
            Kind::Gauge => metrics::describe_gauge!(meter.name, meter.what),
            Kind::Histogram => metrics::describe_histogram!(meter.name, meter.what),
        }
    }
    gauge!(BUILD, "version" => env!("CARGO_PKG_VERSION")).set(1.0);
    for (name, label, words) in AT_ZERO {
        for word in *words {
            counter!(*name, *label => *word).absolute(0);
        }
    }
    for part in ["records", "blobs"] {
        for kind in ["unavailable", "damaged"] {
            counter!(STORE_ERRORS, "part" => part, "kind" => kind).absolute(0);
        }
    }
    counter!(ROBOTS, "outcome" => "placed", "reason" => "").absolute(0);
    counter!(UPLOAD_BYTES).absolute(0);
    gauge!(WORKERS).set(0.0);
    gauge!(WORKERS_BUSY).set(0.0);
}

/// All figures in the text format of Prometheus; `None` when nothing is measured.
#[must_use]
pub fn exposition() -> Option<String> {
    let handle = EXPOSITION.get()?.as_ref()?;
    // folds what was observed into the buckets; what is rendered is folded too, but memory is given back only here
    handle.run_upkeep();
    Some(handle.render())
}

/// A request was answered.
pub fn request(route: &Arc<str>, method: &'static str, status: u16, took: Duration) {
    counter!(REQUESTS, "route" => Arc::clone(route), "method" => method, "status" => status.to_string()).increment(1);
    histogram!(REQUEST_SECONDS, "route" => Arc::clone(route), "method" => method).record(took);
}

/// A request was refused because there is too much to do.
pub fn shed(reason: &'static str) {
    counter!(SHED, "reason" => reason).increment(1);
}

/// A request came with a name.
pub fn named(outcome: &'static str) {
    counter!(NAMED, "outcome" => outcome).increment(1);
}

/// A map was taken in.
pub fn upload(is_new: bool) {
    let outcome = if is_new { "created" } else { "known" };
    counter!(UPLOADS, "outcome" => outcome).increment(1);
}

/// The body of an upload was read.
pub fn upload_bytes(bytes: usize) {
    counter!(UPLOAD_BYTES).increment(bytes as u64);
}

/// How many jobs wait and run; `None` when nobody knows.
pub fn queue(jobs: Option<(u32, u32)>) {
    let (queued, running) = jobs.map_or((f64::NAN, f64::NAN), |(queued, running)| {
        (queued.into(), running.into())
    });
    gauge!(QUEUE, "state" => "queued").set(queued);
    gauge!(QUEUE, "state" => "running").set(running);
}

/// How many jobs this server does at one time.
pub fn workers(at_once: u32) {
    gauge!(WORKERS).set(f64::from(at_once));
}

/// A job that is being done, from now until this is dropped.
#[must_use = "the worker is busy for as long as this is there"]
#[derive(Debug)]
pub struct Busy(());

impl Busy {
    /// A job is begun that had been due for `waited`.
    pub fn begin(waited: Duration) -> Self {
        histogram!(WAIT_SECONDS).record(waited);
        gauge!(WORKERS_BUSY).increment(1.0);
        Self(())
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        gauge!(WORKERS_BUSY).decrement(1.0);
    }
}

/// An attempt at a job was ended.
pub fn attempt(outcome: &'static str, took: Duration) {
    counter!(ATTEMPTS, "outcome" => outcome).increment(1);
    histogram!(ATTEMPT_SECONDS).record(took);
}

/// A stage of a job that succeeded took so many seconds. `stage` is one of the few words that the engine tells.
pub fn stage(stage: &str, seconds: f64) {
    histogram!(STAGE_SECONDS, "stage" => stage.to_owned()).record(seconds);
}

/// Jobs were taken from workers that were lost.
pub fn reclaimed(outcome: &'static str, jobs: usize) {
    counter!(RECLAIMS, "outcome" => outcome).increment(jobs as u64);
}

/// A robot of a published version is placed, or not, for this reason.
pub fn robot(not_placed: Option<String>) {
    let outcome = if not_placed.is_some() { "not_placed" } else { "placed" };
    counter!(ROBOTS, "outcome" => outcome, "reason" => not_placed.unwrap_or_default()).increment(1);
}

/// A part of the store has failed.
pub fn store_error(part: &'static str, kind: &'static str) {
    counter!(STORE_ERRORS, "part" => part, "kind" => kind).increment(1);
}

/// Keeping house has removed so many.
pub fn swept(what: &'static str, count: u64) {
    counter!(SWEPT, "what" => what).increment(count);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_their_kind_and_unit_and_every_meter_says_what_it_tells() {
        for meter in ALL {
            assert!(meter.name.starts_with("mapweld_"), "{}", meter.name);
            let ending = meter.name.rsplit('_').next().unwrap_or_default();
            match meter.kind {
                Kind::Counter => assert_eq!(ending, "total", "{}", meter.name),
                Kind::Histogram => assert_eq!(ending, "seconds", "{}", meter.name),
                Kind::Gauge => assert!(!["total", "seconds"].contains(&ending), "{}", meter.name),
            }
            assert!(meter.what.ends_with('.'), "{}", meter.name);
        }
    }

    #[test]
    fn the_buckets_grow() {
        assert!(SECONDS.is_sorted());
    }
}

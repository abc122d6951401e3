//! `/metrics`: what a server tells of itself, read as Prometheus reads it; and the dashboard that is made of it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use mapweld::api::{Job, PlacementStatus, Version};
use mapweld::meters::{self, Kind};
use mapweld::model::{JobState, Scope};
use mapweld::store::SqliteStore;
use prometheus_parse::{Sample, Scrape, Value};
use reqwest::StatusCode;
use serde_json::{Value as Json, json};

use super::access::{keep, robots};
use super::rooms::{Files, scrap, three_robots};
use super::server::{PATIENCE, TestServer, json as read};

/// A line with `<` and `>` for the braces in its labels' values: the format allows those, and this parser does not.
fn without_braces(line: &str) -> String {
    let mut is_quoted = false;
    let each = line.chars().map(|at| match at {
        '"' => {
            is_quoted = !is_quoted;
            at
        }
        '{' if is_quoted => '<',
        '}' if is_quoted => '>',
        _ => at,
    });
    each.collect()
}

/// All samples of a server.
struct Figures(Scrape);

impl Figures {
    async fn of(server: &TestServer) -> Self {
        let answer = server.get("/metrics").send().await.expect("an answer");
        assert_eq!(answer.status(), StatusCode::OK);
        assert_eq!(
            answer.headers()["content-type"],
            "text/plain; version=0.0.4; charset=utf-8"
        );
        let text = answer.text().await.expect("a body");
        let lines = text.lines().map(|line| Ok(without_braces(line)));
        Self(Scrape::parse(lines).expect("the text format of Prometheus"))
    }

    /// All samples of a server when its workers have counted what they have done, which others hear of a moment before.
    async fn at_rest(server: &TestServer) -> Self {
        let began = std::time::Instant::now();
        loop {
            let figures = Self::of(server).await;
            if figures.count("mapweld_workers_busy", &[]) == 0 {
                return figures;
            }
            assert!(began.elapsed() < PATIENCE, "a worker stays busy");
            tokio::time::sleep(std::time::Duration::from_millis(20)).await;
        }
    }

    /// The samples of a metric that have these labels.
    fn samples<'a>(&'a self, name: &'a str, labels: &'a [(&str, &str)]) -> impl Iterator<Item = &'a Sample> {
        let has = |sample: &Sample| {
            labels
                .iter()
                .all(|(label, value)| sample.labels.get(label) == Some(*value))
        };
        self.0
            .samples
            .iter()
            .filter(move |sample| sample.metric == name && has(sample))
    }

    /// The sum of a metric over the series that have these labels.
    fn sum(&self, name: &str, labels: &[(&str, &str)]) -> f64 {
        let number = |sample: &Sample| match sample.value {
            Value::Counter(number) | Value::Gauge(number) | Value::Untyped(number) => number,
            ref other => panic!("{name} is {other:?}"),
        };
        self.samples(name, labels).map(number).sum()
    }

    /// As [`Self::sum`], of what is counted.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small counts, which are told as whole numbers"
    )]
    fn count(&self, name: &str, labels: &[(&str, &str)]) -> u64 {
        let sum = self.sum(name, labels);
        assert!(sum >= 0.0 && sum.fract() == 0.0, "{name} {labels:?} is {sum}");
        sum as u64
    }

    /// What is told, by the names of [`meters::ALL`].
    fn names(&self) -> BTreeSet<String> {
        let known = |name: &str| meters::ALL.iter().any(|meter| meter.name == name);
        let of = |sample: &Sample| {
            let name = sample.metric.as_str();
            let base = ["_sum", "_count", "_bucket"]
                .iter()
                .find_map(|end| name.strip_suffix(end));
            base.filter(|base| known(base)).unwrap_or(name).to_owned()
        };
        self.0.samples.iter().map(of).collect()
    }
}

const UPLOAD: &str = "/v1/sessions/<session>/robots/<robot>/maps";

/// Four robots push to a session, one twice, one from elsewhere, and are merged; some requests go wrong. Gives the job
/// and the bytes of the files that were pushed.
async fn drive(server: &TestServer) -> (Job, u64) {
    let (maps, _) = three_robots();
    let settings = json!({ "auto_merge": false });
    let made = server.put("/v1/sessions/hall").json(&settings).send().await;
    assert_eq!(made.expect("an answer").status(), StatusCode::CREATED);
    let mut bytes = 0;
    // the last one has been nowhere that the others know
    let pushes = [
        ("a", &maps[0]),
        ("b", &maps[1]),
        ("c", &maps[2]),
        ("a", &maps[0]),
        ("d", &scrap(7)),
    ];
    for (robot, map) in pushes {
        let files = Files::of(robot, map);
        server.push("hall", robot, &files).await;
        bytes += files.yaml.len() + files.image.len();
    }
    let merge = server.post("/v1/sessions/hall/merges").header("idempotency-key", "m");
    let job: Job = read(merge.send().await.expect("an answer")).await;
    let job = server.ended(job.id).await;
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
    for (path, status) in [
        ("/v1/jobs/nobody", StatusCode::BAD_REQUEST),
        ("/nowhere/hall", StatusCode::NOT_FOUND),
    ] {
        let answer = server.get(path).send().await.expect("an answer");
        assert_eq!(answer.status(), status, "{path}");
    }
    (job, bytes as u64)
}

#[tokio::test]
async fn a_merge_moves_the_figures_that_it_must_move() {
    let server = TestServer::start(&["--workers", "1", "--threads", "1"]);
    let before = Figures::of(&server).await;
    assert_eq!(before.count("mapweld_workers", &[]), 1);
    let reclaims = before.samples("mapweld_lease_reclaims_total", &[]).count();
    assert_eq!(reclaims, 2, "told before the first one");
    let (job, bytes) = drive(&server).await;
    let after = Figures::at_rest(&server).await;
    for (name, labels, moved) in [
        (
            "mapweld_http_requests_total",
            &[("route", UPLOAD), ("method", "POST"), ("status", "201")][..],
            4,
        ),
        (
            "mapweld_http_requests_total",
            &[("route", UPLOAD), ("status", "200")],
            1,
        ),
        (
            "mapweld_http_requests_total",
            &[("route", "/v1/jobs/<job>"), ("status", "400")],
            1,
        ),
        (
            "mapweld_http_requests_total",
            &[("route", "none"), ("status", "404")],
            1,
        ),
        (
            "mapweld_http_request_seconds_count",
            &[("route", UPLOAD), ("method", "POST")],
            5,
        ),
        ("mapweld_uploads_total", &[("outcome", "created")], 4),
        ("mapweld_uploads_total", &[("outcome", "known")], 1),
        ("mapweld_named_requests_total", &[("outcome", "begun")], 1),
        ("mapweld_job_attempts_total", &[("outcome", "published")], 1),
        ("mapweld_job_attempts_total", &[], 1),
        ("mapweld_job_wait_seconds_count", &[], 1),
        ("mapweld_job_attempt_seconds_count", &[], 1),
        ("mapweld_lease_reclaims_total", &[], 0),
        ("mapweld_workers_busy", &[], 0),
        ("mapweld_queue_jobs", &[("state", "queued")], 0),
        ("mapweld_queue_jobs", &[("state", "running")], 0),
        ("mapweld_http_shed_total", &[], 0),
        ("mapweld_store_errors_total", &[], 0),
    ] {
        assert_eq!(after.count(name, labels), moved, "{name} {labels:?}");
    }
    // what a form adds to its files is some hundreds of bytes
    let received = after.count("mapweld_upload_bytes_total", &[]);
    assert!(
        (bytes..bytes + 5 * 1000).contains(&received),
        "{received}, the files have {bytes}"
    );
    assert!(!job.timings.is_empty());
    for stage in &job.timings {
        let labels = [("stage", stage.stage.as_str())];
        assert_eq!(after.count("mapweld_job_stage_seconds_count", &labels), 1, "{stage:?}");
        let seconds = after.sum("mapweld_job_stage_seconds_sum", &labels);
        assert!((seconds - stage.seconds).abs() < 1e-6, "{stage:?}: {seconds}");
    }
    let version: Version = server.read("/v1/sessions/hall/versions/latest").await;
    let outcomes = outcomes(&version);
    assert!(
        outcomes.keys().any(|(outcome, _)| *outcome == "not_placed"),
        "{outcomes:?}"
    );
    for ((outcome, reason), count) in outcomes {
        let labels = [("outcome", outcome), ("reason", reason.as_str())];
        assert_eq!(after.count("mapweld_robots_total", &labels), count, "{labels:?}");
    }
    told_in_words_of_ours(&after);
}

/// How many robots of a version are placed, and not placed for which reason.
fn outcomes(version: &Version) -> BTreeMap<(&'static str, String), u64> {
    let result = version.result.read().expect("a result");
    let mut outcomes = BTreeMap::new();
    for map in &result.maps {
        let outcome = match map.status {
            PlacementStatus::Placed => ("placed", String::new()),
            PlacementStatus::NotPlaced => ("not_placed", map.reason.as_ref().expect("a reason").code.as_str()),
        };
        *outcomes.entry(outcome).or_default() += 1;
    }
    outcomes
}

/// All that the table says is told, with its labels and no others, and no name of a caller's among them.
fn told_in_words_of_ours(figures: &Figures) {
    let known: BTreeSet<String> = meters::ALL.iter().map(|meter| meter.name.to_owned()).collect();
    assert_eq!(figures.names(), known, "what is told is what the table says");
    for sample in &figures.0.samples {
        let of = |meter: &&meters::Meter| sample.metric.starts_with(meter.name);
        let meter = meters::ALL.iter().find(of).expect("it is in the table");
        for label in sample.labels.keys().filter(|label| *label != "le") {
            assert!(meter.labels.contains(&label.as_str()), "{} has {label}", meter.name);
        }
        for value in sample.labels.values() {
            let foreign = ["hall", "nowhere", "nobody"].iter().any(|name| value.contains(name));
            assert!(!foreign, "{value:?} is a name of a caller's");
        }
    }
}

#[test]
fn the_dashboard_shows_all_that_is_measured_and_nothing_else() {
    let shown = shown_on_the_dashboard();
    assert!(shown.len() > 10, "found only {shown:?}");
    let names_of = |meter: &meters::Meter| -> Vec<String> {
        let ends: &[&str] = match meter.kind {
            Kind::Histogram => &["_bucket", "_sum", "_count"],
            Kind::Counter | Kind::Gauge => &[""],
        };
        ends.iter().map(|end| format!("{}{end}", meter.name)).collect()
    };
    for name in &shown {
        let told = meters::ALL.iter().any(|meter| names_of(meter).contains(name));
        assert!(told, "the dashboard shows {name}, which no server tells");
    }
    for meter in meters::ALL {
        let is_shown = names_of(meter).iter().any(|name| shown.contains(name));
        assert!(is_shown, "the dashboard does not show {}", meter.name);
    }
}

/// The names in the expressions of the dashboard's panels and variables.
fn shown_on_the_dashboard() -> BTreeSet<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/grafana/mapweld.json");
    let text = std::fs::read_to_string(path).expect("the dashboard is there");
    let dashboard: Json = serde_json::from_str(&text).expect("JSON");
    let mut found = BTreeSet::new();
    collect(&dashboard, &mut found);
    found
}

fn collect(value: &Json, found: &mut BTreeSet<String>) {
    match value {
        Json::Object(members) => {
            for (name, member) in members {
                match member.as_str() {
                    Some(expression) if matches!(name.as_str(), "expr" | "query" | "definition") => {
                        let words = expression.split(|at: char| !(at.is_ascii_alphanumeric() || at == '_'));
                        found.extend(words.filter(|word| word.starts_with("mapweld_")).map(str::to_owned));
                    }
                    _ => collect(member, found),
                }
            }
        }
        Json::Array(members) => members.iter().for_each(|member| collect(member, found)),
        _ => {}
    }
}

#[tokio::test]
async fn a_lost_worker_and_a_shed_request_are_counted() {
    if !cfg!(debug_assertions) {
        return; // release builds have no failpoints
    }
    let options = ["--workers", "1", "--lease", "1s"];
    let dying = TestServer::start(&[&options[..], &["--failpoint", "mid_merge:kill"]].concat());
    let path = "/v1/sessions/hall/robots/r1/maps";
    // the worker may take the server down before the answer is out
    let _ = dying
        .post(path)
        .multipart(Files::of("m", &scrap(1)).form())
        .send()
        .await;
    let folder = dying.ended_by_itself().await;
    let server = TestServer::start_in(folder, &[&options[..], &["--max-queued", "0"]].concat());
    let jobs: mapweld::api::Page<Job> = server.read("/v1/sessions/hall/merges").await;
    let job = server.ended(jobs.items[0].id).await;
    assert_eq!((job.state, job.attempt), (JobState::Succeeded, 2));
    let refused = server.post("/v1/sessions/hall/merges").send().await.expect("an answer");
    assert_eq!(refused.status(), StatusCode::TOO_MANY_REQUESTS);
    let figures = Figures::of(&server).await;
    let reclaimed = figures.count("mapweld_lease_reclaims_total", &[("outcome", "begun_again")]);
    let shed = figures.count("mapweld_http_shed_total", &[("reason", "queue")]);
    let all = figures.count("mapweld_http_shed_total", &[]);
    assert_eq!((reclaimed, shed, all), (1, 1, 1));
}

#[tokio::test]
async fn figures_are_for_keys_that_may_look() {
    let server = TestServer::start(&["--workers", "0"]);
    let store = SqliteStore::open_file_beside(&server.folder().join("mapweld.sqlite"))
        .await
        .expect("opens");
    for (scope, status) in [
        (Scope::Read, StatusCode::OK),
        (Scope::Operator, StatusCode::OK),
        (robots("hall", "r1"), StatusCode::FORBIDDEN),
    ] {
        let key = keep(&store, scope.clone(), |_| {}).await;
        let answer = server.get("/metrics").bearer_auth(key.reveal()).send().await;
        assert_eq!(answer.expect("an answer").status(), status, "{scope}");
    }
    let stranger = server.get("/metrics").send().await.expect("an answer");
    assert_eq!(stranger.status(), StatusCode::UNAUTHORIZED);
}

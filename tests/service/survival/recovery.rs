//! How soon a job goes on whose worker died or stands still in the middle of it, and what a worker does that wakes up
//! from standing still.

use std::time::{Duration, Instant};

use mapweld::api::{Job, Page, VersionSummary};
use mapweld::model::{JobId, JobState, Timestamp};
use reqwest::Client;

use super::home::Home;
use super::replica::{Replica, client, ended_job, push, read};
use super::{PATIENCE, tell};

const LEASE: Duration = Duration::from_secs(2);
/// How often a worker looks at the queue when nobody tells it anything.
const POLL: Duration = Duration::from_secs(1);
/// What a busy machine may add.
const SLACK: Duration = Duration::from_secs(2);
const OPTIONS: [&str; 6] = ["--lease", "2s", "--workers", "1", "--threads", "1"];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_whose_worker_dies_goes_on_elsewhere_within_its_lease_and_a_poll() {
    let Some((home, client)) = ready() else { return };
    let mut dying = Replica::start(&home, &OPTIONS, Some("mid_merge:kill")).expect("it comes up");
    begin(&client, dying.url()).await;
    dying.ended(PATIENCE).await.expect("it dies in the middle of the job");
    let died = now();
    let other = Replica::up(&home, &OPTIONS);
    let (_, recovered) = recovery(&client, &other, died).await;
    tell(&format!(
        "a job goes on {:.2} s after its worker's death; lease {LEASE:?}, poll {POLL:?}",
        recovered.as_secs_f64()
    ));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_whose_worker_stands_still_goes_on_elsewhere_and_the_worker_that_wakes_up_publishes_nothing() {
    let Some((home, client)) = ready() else { return };
    let frozen = Replica::start(&home, &OPTIONS, Some("mid_merge:stop")).expect("it comes up");
    begin(&client, frozen.url()).await;
    let began = Instant::now();
    while !frozen.is_stopped() {
        assert!(began.elapsed() < PATIENCE, "it does not stop");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let stopped = now();
    let other = Replica::up(&home, &OPTIONS);
    let (job, recovered) = recovery(&client, &other, stopped).await;

    frozen.signal("CONT");
    // it has given up the old job when it does a new one: it has one worker
    other.kill();
    let again = push(&client, frozen.url(), "hall", "r1", 2)
        .await
        .done()
        .expect("it lives");
    let second = ended_job(&client, frozen.url(), again.job.expect("a job")).await;
    assert_eq!(second.state, JobState::Succeeded, "{second:?}");
    let versions: Page<VersionSummary> = read(&client, format!("{}/v1/sessions/hall/versions", frozen.url())).await;
    let told: Vec<_> = versions
        .items
        .iter()
        .map(|version| (version.number.get(), version.job))
        .collect();
    assert_eq!(told, [(2, second.id), (1, job)]);
    tell(&format!(
        "a job goes on {:.2} s after its worker stood still; lease {LEASE:?}, poll {POLL:?}",
        recovered.as_secs_f64()
    ));
}

fn ready() -> Option<(Home, Client)> {
    if !cfg!(debug_assertions) {
        tell("SKIPPED: recovery from a death in the middle of a job: release builds have no failpoints");
        return None;
    }
    Some((Home::postgres()?, client()))
}

/// Pushes a first map. The worker may take the server down before the answer is out: what came of it is seen later.
async fn begin(client: &Client, url: &str) {
    let _ = push(client, url, "hall", "r1", 1).await;
}

/// The one job, and how long after `lost` it was begun again; it must have ended well.
async fn recovery(client: &Client, other: &Replica, lost: Timestamp) -> (JobId, Duration) {
    let jobs: Page<Job> = read(client, format!("{}/v1/sessions/hall/merges", other.url())).await;
    assert_eq!(jobs.items.len(), 1, "one map, one job");
    let job = ended_job(client, other.url(), jobs.items[0].id).await;
    assert_eq!((job.state, job.attempt), (JobState::Succeeded, 2), "{job:?}");
    let begun_again = job.started_at.expect("it was begun");
    let took = Duration::try_from(begun_again.duration_since(lost)).expect("after it was lost");
    assert!(took <= LEASE + POLL + SLACK, "{took:?}");
    (job.id, took)
}

fn now() -> Timestamp {
    Timestamp::now()
}

//! Whoever waits is told, whichever replica does the work: long polls and event streams.

use std::time::{Duration, Instant};

use mapweld::model::JobState;

use super::home::Home;
use super::replica::{Replica, client, ended_job, push};
use super::{PATIENCE, tell};

const WORKS: [&str; 4] = ["--workers", "1", "--threads", "1"];
const WATCHES: [&str; 2] = ["--workers", "0"];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_of_one_replica_is_told_what_another_one_does() {
    let Some(home) = Home::postgres() else { return };
    let (works, watches) = (Replica::up(&home, &WORKS), Replica::up(&home, &WATCHES));
    let client = client();
    // the map comes in where nobody works, and is merged where nobody has asked
    let first = push(&client, watches.url(), "hall", "r1", 1)
        .await
        .done()
        .expect("is taken in");
    let job = ended_job(&client, watches.url(), first.job.expect("a job")).await;
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");

    let events = client
        .get(format!("{}/v1/sessions/hall/events", watches.url()))
        .send()
        .await;
    let mut events = events.expect("the stream begins");
    let second = push(&client, works.url(), "hall", "r2", 2)
        .await
        .done()
        .expect("is taken in");
    let pushed = Instant::now();
    let mut heard = String::new();
    while !heard.contains("\"number\":2") {
        let chunk = tokio::time::timeout(PATIENCE, events.chunk()).await.expect("in time");
        let chunk = chunk.expect("the stream goes on").expect("the stream goes on");
        heard.push_str(&String::from_utf8_lossy(&chunk));
    }
    let told = pushed.elapsed();
    assert!(
        heard.contains("event: version") || heard.contains("event:version"),
        "{heard}"
    );
    let job = ended_job(&client, works.url(), second.job.expect("a job")).await;
    let took = Duration::try_from(job.finished_at.expect("it ended").duration_since(job.created_at)).expect("later");
    tell(&format!(
        "a version is told by the other replica {:.2} s after the push that caused it; the job took {:.2} s",
        told.as_secs_f64(),
        took.as_secs_f64()
    ));
}

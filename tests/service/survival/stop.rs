//! SIGTERM under load: who was being served is served to the end, and the jobs go on elsewhere at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use mapweld::api::Session;
use reqwest::Client;
use tokio::task::JoinSet;

use super::home::Home;
use super::ledger::{Acknowledged, Ledger};
use super::replica::{Answer, Replica, ask, client, push};
use super::tell;

/// Longest time from SIGTERM to the end.
const ENDED: Duration = Duration::from_secs(30);
const CALLERS: usize = 12;
/// Leases that are far too long to be waited for: jobs that go on were given back.
const OPTIONS: [&str; 8] = [
    "--lease",
    "10m",
    "--workers",
    "2",
    "--threads",
    "1",
    "--max-uploads",
    "64",
];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_over_sqlite_that_is_told_to_stop_under_load_fails_no_request() {
    let home = Home::sqlite();
    let server = Replica::up(&home, &OPTIONS);
    let (ledger, figures) = stopped_under_load(server).await;
    let next = Replica::up(&home, &OPTIONS);
    audited("SQLite", ledger, &next, &figures).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_replica_that_is_told_to_stop_under_load_fails_no_request_and_leaves_its_jobs_to_the_others() {
    let Some(home) = Home::postgres() else { return };
    let server = Replica::up(&home, &OPTIONS);
    let (ledger, figures) = stopped_under_load(server).await;
    let other = Replica::up(&home, &OPTIONS);
    audited("PostgreSQL", ledger, &other, &figures).await;
}

/// With leases of ten minutes the audit ends only if every job was given back.
async fn audited(name: &str, mut ledger: Ledger, server: &Replica, figures: &str) {
    let began = Instant::now();
    let counted = ledger.audit(&client(), server.url()).await;
    tell(&format!(
        "{name}: SIGTERM under load: {figures}; {counted:?} complete {:.2} s after the next server was up",
        began.elapsed().as_secs_f64()
    ));
}

/// What a caller has seen: when it asked, and why there was no answer.
struct Failure {
    asked: Instant,
    why: String,
}

async fn stopped_under_load(mut server: Replica) -> (Ledger, String) {
    let seeds = Arc::new(AtomicU32::new(1));
    let mut callers = JoinSet::new();
    for caller in 0..CALLERS {
        let (url, seeds) = (server.url().to_owned(), Arc::clone(&seeds));
        callers.spawn(async move { call_until_refused(&client(), &url, caller, &seeds).await });
    }
    // until there is load: enough maps for jobs to be under way
    while seeds.load(Ordering::Relaxed) < 60 {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let told = Instant::now();
    server.signal("TERM");
    let status = server.ended(ENDED).await;
    let took = told.elapsed();
    let status = status.unwrap_or_else(|| panic!("still there after {took:?}"));
    assert_eq!(status.code(), Some(0), "{status}");
    let (mut ledger, mut answered) = (Ledger::default(), 0);
    for (acknowledged, count, failure) in callers.join_all().await {
        answered += count;
        for ack in acknowledged {
            ledger.add(ack);
        }
        // who asked before the signal is answered; who comes when the door is closed is not
        assert!(failure.asked >= told, "a request in flight failed: {}", failure.why);
    }
    (
        ledger,
        format!(
            "{answered} requests answered by then, 0 in flight failed, exit 0 after {:.2} s",
            took.as_secs_f64()
        ),
    )
}

/// Pushes and reads until nobody answers.
async fn call_until_refused(
    client: &Client,
    url: &str,
    caller: usize,
    seeds: &AtomicU32,
) -> (Vec<Acknowledged>, usize, Failure) {
    let (mut acknowledged, mut answered) = (Vec::new(), 0);
    let session = format!("hall-{}", caller % 3);
    loop {
        let seed = seeds.fetch_add(1, Ordering::Relaxed);
        let asked = Instant::now();
        match push(client, url, &session, &format!("r{caller}"), seed).await {
            Answer::Done(pushed) => acknowledged.push(Acknowledged { seed, pushed }),
            Answer::Later(status, problem) => panic!("refused: {status} {problem:?}"),
            Answer::Broken(why) => return (acknowledged, answered, Failure { asked, why }),
        }
        let asked = Instant::now();
        match ask::<Session>(client.get(format!("{url}/v1/sessions/{session}"))).await {
            Answer::Done(_) => answered += 2,
            Answer::Later(status, problem) => panic!("refused: {status} {problem:?}"),
            Answer::Broken(why) => return (acknowledged, answered + 1, Failure { asked, why }),
        }
    }
}

//! `kill -9` at random moments and at failpoints: nothing that was acknowledged is lost, no job is stuck, no version is
//! doubled or missing.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use mapweld::failpoint::Point;
use reqwest::Client;
use tokio::task::JoinSet;

use super::home::Home;
use super::ledger::{Acknowledged, Ledger};
use super::replica::{Answer, Replica, client, push};
use super::{Dice, full_form, tell};

/// Kills among the other tests.
const SHORT: usize = 16;
/// After so many kills their sessions are compared, and others are begun; all are compared at the end.
const EPOCH: usize = 10;
/// Short leases: a killed server's jobs go on soon. Attempts without end: a job is begun anew after every kill.
const OPTIONS: [&str; 8] = [
    "--lease",
    "1s",
    "--workers",
    "2",
    "--threads",
    "1",
    "--max-attempts",
    "100000",
];
/// A failpoint that is not reached within this time is given up for a kill from outside.
const REACHED: Duration = Duration::from_secs(8);
/// Robots that push at one time, to as many sessions in turn.
const ROBOTS: usize = 4;
const SESSIONS: usize = 2;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_over_sqlite_that_is_killed_again_and_again_loses_nothing() {
    survive("SQLite", &Home::sqlite(), 1).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_over_postgresql_that_is_killed_again_and_again_loses_nothing() {
    let Some(home) = Home::postgres() else { return };
    survive("PostgreSQL", &home, 2).await;
}

async fn survive(name: &str, home: &Home, seed: u64) {
    let kills = full_form("MAPWELD_KILLS", SHORT);
    let began = Instant::now();
    let (mut dice, mut ledger, client) = (Dice::new(seed), Ledger::default(), client());
    let mut deaths: BTreeMap<&str, usize> = BTreeMap::new();
    let seeds = Arc::new(AtomicU32::new(1));
    let mut counted = None;
    for kill in 0..kills {
        let (acknowledged, death) = until_death(home, kill, &client, &seeds, &mut dice).await;
        for ack in acknowledged {
            ledger.add(ack);
        }
        *deaths.entry(death).or_default() += 1;
        let is_last = kill + 1 == kills;
        if (kill + 1) % EPOCH == 0 || is_last {
            let server = Replica::up(home, &OPTIONS);
            // at the end everything, and meanwhile what is new
            let sessions = if is_last {
                "hall-".to_owned()
            } else {
                format!("hall-{}-", kill / EPOCH)
            };
            counted = Some(ledger.audit_of(&client, server.url(), &sessions).await);
            server.kill();
        }
    }
    let counted = counted.expect("at least one kill");
    assert!(
        ledger.uploads() > kills,
        "hardly anything was pushed: {}",
        ledger.uploads()
    );
    tell(&format!(
        "{name}: {kills} kills ({deaths:?}), {} acknowledged uploads, {counted:?}: 0 lost, 0 jobs stuck, 0 versions \
         doubled or missing; {:.0} s",
        ledger.uploads(),
        began.elapsed().as_secs_f64()
    ));
}

/// A server with robots that push to it, until it dies: at a failpoint or, every other time, at a random moment.
async fn until_death(
    home: &Home,
    kill: usize,
    client: &Client,
    seeds: &Arc<AtomicU32>,
    dice: &mut Dice,
) -> (Vec<Acknowledged>, &'static str) {
    // release builds have no failpoints
    let at_point = cfg!(debug_assertions) && kill % 2 == 1;
    let point = Point::ALL[kill / 2 % Point::ALL.len()];
    let order = format!("{}:kill:{}", point.as_str(), 1 + dice.below(3));
    let Some(mut server) = Replica::start(home, &OPTIONS, at_point.then_some(&order)) else {
        assert!(at_point, "the server does not come up: {}", log(home));
        return (Vec::new(), point.as_str());
    };
    let mut robots = JoinSet::new();
    for robot in 0..ROBOTS {
        let session = format!("hall-{}-{}", kill / EPOCH, robot % SESSIONS);
        let (client, url, seeds) = (client.clone(), server.url().to_owned(), Arc::clone(seeds));
        robots.spawn(async move { push_until_broken(&client, &url, &session, &format!("r{robot}"), &seeds).await });
    }
    let mut death = "random";
    if at_point {
        if server.ended(REACHED).await.is_some() {
            death = point.as_str();
        }
    } else {
        tokio::time::sleep(dice.milliseconds(5, 800)).await;
    }
    server.kill();
    (robots.join_all().await.concat(), death)
}

async fn push_until_broken(
    client: &Client,
    url: &str,
    session: &str,
    robot: &str,
    seeds: &AtomicU32,
) -> Vec<Acknowledged> {
    let mut acknowledged = Vec::new();
    loop {
        let seed = seeds.fetch_add(1, Ordering::Relaxed);
        match push(client, url, session, robot, seed).await {
            Answer::Done(pushed) => acknowledged.push(Acknowledged { seed, pushed }),
            Answer::Later(status, problem) => panic!("a healthy server refuses: {status} {problem:?}"),
            Answer::Broken(_) => return acknowledged,
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

fn log(home: &Home) -> String {
    std::fs::read_to_string(home.log()).unwrap_or_default()
}

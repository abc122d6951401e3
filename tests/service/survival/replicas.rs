//! Three replicas on one database and one folder of blobs, killed and frozen while robots push: every job ends, versions
//! have no gaps, each is published once.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use reqwest::Client;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use super::home::Home;
use super::ledger::{Acknowledged, Ledger};
use super::replica::{Replica, client, merge, push};
use super::{Dice, full_form, tell};

/// Jobs among the other tests.
const SHORT: usize = 40;
const REPLICAS: usize = 3;
const ROBOTS: usize = 20;
const SESSIONS: usize = 5;
const LEASE: Duration = Duration::from_secs(2);
const OPTIONS: [&str; 8] = [
    "--lease",
    "2s",
    "--workers",
    "2",
    "--threads",
    "1",
    "--max-attempts",
    "100000",
];

/// Where the replicas are reached right now.
type Addresses = Arc<Mutex<Vec<String>>>;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_of_twenty_robots_take_effect_once_while_three_replicas_are_killed_and_frozen() {
    let Some(home) = Home::postgres() else { return };
    let jobs = full_form("MAPWELD_JOBS", SHORT);
    let began = Instant::now();
    let replicas: Vec<Replica> = (0..REPLICAS).map(|_| Replica::up(&home, &OPTIONS)).collect();
    let addresses: Addresses = Arc::new(Mutex::new(replicas.iter().map(|r| r.url().to_owned()).collect()));
    let (enough, seeds) = (CancellationToken::new(), Arc::new(AtomicU32::new(1)));
    let ledger = Arc::new(Mutex::new(Ledger::default()));
    let mut robots = JoinSet::new();
    for robot in 0..ROBOTS {
        let (addresses, ledger, seeds, enough) = (
            Arc::clone(&addresses),
            Arc::clone(&ledger),
            Arc::clone(&seeds),
            enough.clone(),
        );
        robots.spawn(async move {
            let mut robot = Robot::new(robot, addresses);
            while !enough.is_cancelled() {
                robot.step(&ledger, &seeds).await;
                if lock(&ledger).jobs() >= jobs {
                    enough.cancel();
                }
            }
        });
    }
    let (replicas, kills, freezes) = chaos(&home, replicas, &addresses, &enough).await;
    robots.join_all().await;
    let mut ledger = Arc::into_inner(ledger)
        .expect("the robots are gone")
        .into_inner()
        .unwrap_or_else(PoisonError::into_inner);
    let client = client();
    let counted = ledger.audit(&client, replicas[0].url()).await;
    // whichever replica is asked: it is one service
    assert_eq!(ledger.audit(&client, replicas[2].url()).await, counted);
    assert!(counted.jobs >= jobs, "{counted:?}");
    assert!(kills > 0 && freezes > 0, "{kills} kills, {freezes} freezes");
    tell(&format!(
        "{REPLICAS} replicas, {ROBOTS} robots, {kills} kills, {freezes} freezes past the lease, {} acknowledged uploads, \
         {counted:?}: every job ended, versions without gaps, each published once; {:.0} s",
        ledger.uploads(),
        began.elapsed().as_secs_f64()
    ));
}

/// Kills and freezes replicas, one after the other, until there is enough. All are well when it ends.
async fn chaos(
    home: &Home,
    mut replicas: Vec<Replica>,
    addresses: &Addresses,
    enough: &CancellationToken,
) -> (Vec<Replica>, usize, usize) {
    let mut dice = Dice::new(3);
    let (mut kills, mut freezes) = (0, 0);
    loop {
        let at = dice.below(REPLICAS);
        if (kills + freezes) % 2 == 0 {
            let dead = replicas.remove(at);
            dead.kill();
            replicas.insert(at, Replica::up(home, &OPTIONS));
            replicas[at].url().clone_into(&mut lock(addresses)[at]);
            kills += 1;
        } else {
            replicas[at].signal("STOP");
            tokio::time::sleep(LEASE + dice.milliseconds(200, 1200)).await;
            // what it wakes up with is a lease that others hold
            replicas[at].signal("CONT");
            freezes += 1;
        }
        if enough.is_cancelled() && freezes > 0 {
            return (replicas, kills, freezes);
        }
        tokio::time::sleep(dice.milliseconds(50, 500)).await;
    }
}

/// A robot that pushes to one replica after the other.
struct Robot {
    name: String,
    session: String,
    client: Client,
    addresses: Addresses,
    dice: Dice,
    has_pushed: bool,
}

impl Robot {
    fn new(number: usize, addresses: Addresses) -> Self {
        Self {
            name: format!("r{number}"),
            session: format!("hall-{}", number % SESSIONS),
            // a frozen replica is given up for another one
            client: Client::builder()
                .timeout(Duration::from_secs(2))
                .build()
                .expect("a client"),
            addresses,
            dice: Dice::new(100 + number as u64),
            has_pushed: false,
        }
    }

    /// Pushes a map or, now and then, asks for a merge.
    async fn step(&mut self, ledger: &Mutex<Ledger>, seeds: &AtomicU32) {
        let url = lock(&self.addresses)[self.dice.below(REPLICAS)].clone();
        if self.has_pushed && self.dice.below(2) == 0 {
            if let Some(job) = merge(&self.client, &url, &self.session).await.done() {
                lock(ledger).add_merge(job);
            }
        } else {
            let seed = seeds.fetch_add(1, Ordering::Relaxed);
            if let Some(pushed) = push(&self.client, &url, &self.session, &self.name, seed).await.done() {
                self.has_pushed = true;
                lock(ledger).add(Acknowledged { seed, pushed });
            }
        }
        tokio::time::sleep(self.dice.milliseconds(200, 1500)).await;
    }
}

fn lock<T>(of: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

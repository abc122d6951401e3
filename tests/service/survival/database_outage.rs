//! A database that goes away: refusals that say when to come again, nothing wrong, and no need of a hand to heal.

use std::time::{Duration, Instant};

use mapweld::api::Session;
use reqwest::{Client, RequestBuilder};
use tokio::task::JoinSet;

use super::home::Home;
use super::ledger::{Acknowledged, Ledger};
use super::proxy::{Proxy, Way};
use super::replica::{Answer, Replica, ask, client, ended_job, is_storage, push};
use super::tell;
use crate::postgres::Database;

/// Longest time to heal.
const HEALED: Duration = Duration::from_secs(10);
/// Longest time for a refusal.
const REFUSED: Duration = Duration::from_secs(12);
const OPTIONS: [&str; 8] = [
    "--lease",
    "2s",
    "--workers",
    "1",
    "--threads",
    "1",
    "--max-attempts",
    "1000",
];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_database_that_is_cut_silenced_or_slow_causes_refusals_and_nothing_worse() {
    let Some(database) = Database::fresh() else { return };
    let proxy = Proxy::to(database.socket()).await;
    let home = Home::over(database.url_by_port(proxy.port()));
    let server = Replica::up(&home, &OPTIONS);
    let (client, mut ledger, mut seed) = (client(), Ledger::default(), 0);
    healed(&client, &server, &mut ledger, &mut seed).await;
    for way in [Way::Cut, Way::Silent, Way::Cut] {
        proxy.set(way);
        for _ in 0..2 {
            everything_is_refused(&client, &server, way).await;
        }
        let alive = client
            .get(format!("{}/livez", server.url()))
            .send()
            .await
            .expect("an answer");
        assert!(alive.status().is_success(), "{way:?}: the process lives");
        proxy.set(Way::Open);
        let took = healed(&client, &server, &mut ledger, &mut seed).await;
        tell(&format!(
            "database {way:?}: only 503 with Retry-After; healed {:.2} s after",
            took.as_secs_f64()
        ));
    }
    proxy.set(Way::Slow(Duration::from_millis(50)));
    let (mut slow, began) = (0, Instant::now());
    while slow < 3 {
        seed += 1;
        match push(&client, server.url(), "hall", "r1", seed).await {
            Answer::Done(pushed) => {
                ledger.add(Acknowledged { seed, pushed });
                slow += 1;
            }
            Answer::Later(status, problem) => assert!(is_storage(status, &problem), "{problem:?}"),
            Answer::Broken(why) => panic!("slow: {why}"),
        }
        assert!(
            began.elapsed() < super::PATIENCE,
            "a slow database is no reason to do nothing"
        );
    }
    proxy.set(Way::Open);
    healed(&client, &server, &mut ledger, &mut seed).await;
    let counted = ledger.audit(&client, server.url()).await;
    tell(&format!(
        "after the outages of the database: {counted:?}, nothing lost, no job stuck"
    ));
}

/// One request of each kind at once.
async fn everything_is_refused(client: &Client, server: &Replica, way: Way) {
    let below = format!("{}/v1/sessions/hall", server.url());
    let json =
        |request: RequestBuilder, body: &'static str| request.header("content-type", "application/json").body(body);
    let requests = [
        client.get(format!("{}/readyz", server.url())),
        client.get(&below),
        client.get(format!("{below}/versions/latest")),
        json(client.put(format!("{}/v1/sessions/other", server.url())), "{}"),
        json(client.patch(&below), r#"{"title":"Ward 3"}"#),
        json(client.post(format!("{below}/merges")), "{}"),
        client
            .post(format!("{below}/robots/r2/maps"))
            .multipart(crate::http::rooms::Files::of("m", &crate::http::rooms::scrap(9)).form()),
    ];
    let mut asked = JoinSet::new();
    for request in requests {
        asked.spawn(async move {
            let began = Instant::now();
            (ask::<serde_json::Value>(request).await, began.elapsed())
        });
    }
    for (answer, took) in asked.join_all().await {
        match answer {
            Answer::Later(status, problem) => {
                assert!(is_storage(status, &problem), "{way:?}: {status} {problem:?}");
                assert!(took < REFUSED, "{way:?}: {took:?} for {problem:?}");
            }
            Answer::Done(value) => panic!("{way:?}: there is no database, and the answer was {value}"),
            Answer::Broken(why) => panic!("{way:?}: {why}"),
        }
    }
}

/// How long it takes until the server is ready, takes in a map and merges it.
async fn healed(client: &Client, server: &Replica, ledger: &mut Ledger, seed: &mut u32) -> Duration {
    let began = Instant::now();
    *seed += 1;
    let pushed = loop {
        let is_ready: Answer<serde_json::Value> = ask(client.get(format!("{}/readyz", server.url()))).await;
        if is_ready.done().is_some() {
            match push(client, server.url(), "hall", "r1", *seed).await {
                Answer::Done(pushed) => break pushed,
                Answer::Later(..) => {}
                Answer::Broken(why) => panic!("{why}"),
            }
        }
        assert!(began.elapsed() < HEALED, "it does not heal by itself");
        tokio::time::sleep(Duration::from_millis(20)).await;
    };
    let took = began.elapsed();
    assert!(took < HEALED, "healed only after {took:?}");
    let job = pushed.job.expect("a job");
    ledger.add(Acknowledged { seed: *seed, pushed });
    let session: Answer<Session> = ask(client.get(format!("{}/v1/sessions/hall", server.url()))).await;
    assert!(session.done().is_some());
    ended_job(client, server.url(), job).await;
    took
}

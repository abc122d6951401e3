//! How a server begins and ends, gently and not.

use std::time::{Duration, Instant};

use mapweld::api::{Job, Map, Version};
use mapweld::model::JobState;

use super::rooms::{Files, scrap, three_robots};
use super::server::{TestServer, command};

#[tokio::test]
async fn a_map_that_was_acknowledged_survives_the_servers_death_and_becomes_a_version() {
    // no worker: the merge has not begun when the server dies
    let server = TestServer::start(&["--workers", "0"]);
    let ([a, b, _], _) = three_robots();
    let (_, first) = server.push("hall", "a", &Files::of("a", &a)).await;
    let (_, second) = server.push("hall", "b", &Files::of("b", &b)).await;
    let picture = server
        .get(&format!("/v1/sessions/hall/maps/{}.png", second.map.id))
        .send()
        .await
        .expect("an answer")
        .bytes()
        .await
        .expect("a picture");
    let folder = server.kill().await;

    let server = TestServer::start_in(folder, &[]);
    for pushed in [&first, &second] {
        let path = format!("/v1/sessions/hall/maps/{}", pushed.map.id);
        assert_eq!(server.read::<Map>(&path).await, pushed.map);
    }
    let again = server
        .get(&format!("/v1/sessions/hall/maps/{}.png", second.map.id))
        .send();
    assert_eq!(
        again.await.expect("an answer").bytes().await.expect("a picture"),
        picture
    );
    let job = server.ended(first.job.expect("a job")).await;
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
    let version: Version = server.read("/v1/sessions/hall/versions/1").await;
    assert_eq!(version.inputs.len(), 2);
    assert_eq!(version.inputs[1].digest, second.map.digest);
}

#[tokio::test]
async fn a_server_that_is_told_to_stop_answers_who_waits_and_ends_well() {
    let server = TestServer::start(&["--workers", "0"]);
    let (_, pushed) = server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    let id = pushed.job.expect("a job");
    let waiting = tokio::spawn(server.get(&format!("/v1/jobs/{id}?wait=60")).send());
    let events = server
        .get("/v1/sessions/hall/events")
        .send()
        .await
        .expect("the stream begins");
    // an answer to a later request on another connection: the wait, which was sent before, is under way
    server.read::<Job>(&format!("/v1/jobs/{id}")).await;
    let began = Instant::now();
    let (status, _folder) = server.terminate().await;
    assert!(status.success(), "{status}");
    assert!(began.elapsed() < Duration::from_secs(15), "{:?}", began.elapsed());
    if let Ok(answer) = waiting.await.expect("no panic") {
        let job: Job = answer.json().await.expect("the job as it was");
        assert_eq!(job.state, JobState::Queued);
    }
    events.bytes().await.expect("the stream ends in order");
}

#[tokio::test]
async fn a_job_that_runs_when_the_server_stops_is_done_by_the_next_one() {
    let server = TestServer::start(&[]);
    let ([a, b, c], _) = three_robots();
    let mut last = None;
    for (name, map) in [("a", &a), ("b", &b), ("c", &c)] {
        last = server.push("hall", name, &Files::of(name, map)).await.1.job;
    }
    let (status, folder) = server.terminate().await;
    assert!(status.success(), "{status}");
    let server = TestServer::start_in(folder, &[]);
    let job = server.ended(last.expect("a job")).await;
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
    let version: Version = server.read("/v1/sessions/hall/versions/latest").await;
    assert_eq!(version.inputs.len(), 3);
}

#[tokio::test]
async fn a_folder_is_served_by_one_process_at_a_time() {
    let server = TestServer::start(&["--workers", "0"]);
    let folder = server.folder();
    let second = command(folder, &[]).output().expect("the binary runs");
    assert!(!second.status.success());
    let told = String::from_utf8_lossy(&second.stderr).into_owned();
    assert!(told.contains("in use by another process"), "{told}");
}

#[test]
fn a_server_without_keys_is_not_opened_to_other_machines_by_accident() {
    let folder = tempfile::tempdir().expect("a folder");
    let refused = command(folder.path(), &[])
        .args(["--listen", "0.0.0.0:0"])
        .output()
        .expect("the binary runs");
    // clap takes an option once: the two addresses are the caller's mistake as well
    assert_eq!(refused.status.code(), Some(2));
    let refused = std::process::Command::new(env!("CARGO_BIN_EXE_mapweld"))
        .args(["serve", "--listen", "0.0.0.0:0", "--data"])
        .arg(folder.path())
        .output()
        .expect("the binary runs");
    assert_eq!(refused.status.code(), Some(2));
    let told = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(told.contains("--insecure"), "{told}");
}

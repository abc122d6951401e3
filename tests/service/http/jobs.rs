//! Merges: asked for, waited for, cancelled.

use std::time::Instant;

use mapweld::api::{Job, MergeResult, Page, PlacementStatus};
use mapweld::model::JobState;
use reqwest::StatusCode;

use super::rooms::{Files, scrap, three_robots};
use super::server::{PATIENCE, TestServer, json};

#[tokio::test]
async fn uploads_that_arrive_while_a_job_waits_share_it() {
    let server = TestServer::start(&["--workers", "0"]);
    let (_, first) = server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    let (_, second) = server.push("hall", "r2", &Files::of("m", &scrap(2))).await;
    assert_eq!(first.job, second.job);
    let job: Job = server.read(&format!("/v1/jobs/{}", first.job.expect("a job"))).await;
    assert_eq!((job.state, job.attempt), (JobState::Queued, 0));
}

#[tokio::test]
async fn a_wait_ends_when_the_job_does() {
    let server = TestServer::start(&["--workers", "0"]);
    let (_, pushed) = server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    let id = pushed.job.expect("a job");
    let began = Instant::now();
    let (waited, cancelled) = tokio::join!(server.ended(id), async {
        // the job as it is: the wait above is under way or begins with the end
        let job: Job = server.read(&format!("/v1/jobs/{id}?wait=0.05")).await;
        assert_eq!(job.state, JobState::Queued);
        let path = format!("/v1/jobs/{id}:cancel");
        json::<Job>(server.post(&path).send().await.expect("an answer")).await
    });
    assert_eq!(
        (waited.state, cancelled.state),
        (JobState::Cancelled, JobState::Cancelled)
    );
    assert!(began.elapsed() < PATIENCE / 2, "the wait did not end early");
}

#[tokio::test]
async fn a_merge_is_queued_and_says_where_to_follow_it() {
    let server = TestServer::start(&["--workers", "0"]);
    server.put("/v1/sessions/hall").send().await.expect("an answer");
    let queued = server.post("/v1/sessions/hall/merges").send().await.expect("an answer");
    assert_eq!(queued.status(), StatusCode::ACCEPTED);
    assert!(queued.headers().contains_key("retry-after"));
    let location = queued.headers()["location"].to_str().expect("a path").to_owned();
    let job: Job = server.read(&location).await;
    let listed: Page<Job> = server.read("/v1/sessions/hall/merges").await;
    assert_eq!(listed.items[0].id, job.id);
}

#[tokio::test]
async fn a_dry_run_answers_and_publishes_nothing() {
    let server = TestServer::start(&[]);
    let settings = serde_json::json!({ "auto_merge": false });
    server
        .put("/v1/sessions/hall")
        .json(&settings)
        .send()
        .await
        .expect("an answer");
    let ([a, b, _], _) = three_robots();
    server.push("hall", "a", &Files::of("a", &a)).await;
    server.push("hall", "b", &Files::of("b", &b)).await;
    let request = serde_json::json!({ "dry_run": true });
    let queued = server.post("/v1/sessions/hall/merges").json(&request).send().await;
    let queued: Job = json(queued.expect("an answer")).await;
    let job = server.ended(queued.id).await;
    assert_eq!((job.state, job.version), (JobState::Succeeded, None));
    let result: MergeResult = job.result.expect("an answer").read().expect("a result");
    assert_eq!(result.maps.len(), 2);
    assert_eq!(result.maps[0].status, PlacementStatus::Placed);
    let versions: Page<serde_json::Value> = server.read("/v1/sessions/hall/versions").await;
    assert_eq!(versions.items, Vec::<serde_json::Value>::new());
}

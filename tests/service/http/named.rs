//! `Idempotency-Key`: a change takes effect once, however often it is asked for.

use std::time::Duration;

use mapweld::api::{Constraint, Job, Page, ProblemCode, Pushed, Session};
use mapweld::model::{JobState, Scope, Timestamp};
use mapweld::store::{Attempt, CallEnd, CallStore as _, SqliteStore};
use reqwest::{RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;

use super::access::{keep, robots};
use super::rooms::{Files, scrap};
use super::server::{PATIENCE, TestServer, json as read, problem};

async fn answer(request: RequestBuilder) -> Response {
    request.send().await.expect("an answer")
}

/// Status, location, whether it was given before, body.
async fn told(request: RequestBuilder) -> (u16, Option<String>, bool, Value) {
    let answer = answer(request).await;
    let header = |name: &str| Some(answer.headers().get(name)?.to_str().ok()?.to_owned());
    let (status, location) = (answer.status().as_u16(), header("location"));
    let replayed = header("idempotency-replayed").as_deref() == Some("true");
    (status, location, replayed, answer.json().await.expect("JSON"))
}

/// A POST under a name.
fn named(server: &TestServer, path: &str, name: &str) -> RequestBuilder {
    server.post(path).header("idempotency-key", name)
}

/// The same answer twice, the second time as one that was given before; gives its body.
async fn twice(request: impl Fn() -> RequestBuilder) -> Value {
    let (status, location, replayed, body) = told(request()).await;
    assert!((200..300).contains(&status) && !replayed, "{status}: {body}");
    assert_eq!(told(request()).await, (status, location, true, body.clone()));
    body
}

#[tokio::test]
async fn every_change_that_is_named_is_answered_again_and_not_made_again() {
    let server = TestServer::start(&["--workers", "0"]);
    let post = |path: &str, name: &str, body: Value| named(&server, path, name).json(&body);
    let session = twice(|| post("/v1/sessions", "make", json!({ "title": "Ward", "auto_merge": false }))).await;
    let sessions: Page<Session> = server.read("/v1/sessions").await;
    assert_eq!(sessions.items.len(), 1);
    let id = session["id"].as_str().expect("an id");

    // each form has boundaries of its own
    let files = Files::of("m", &scrap(1));
    let pushed = twice(|| {
        let path = format!("/v1/sessions/{id}/robots/r1/maps");
        let request = server.post(&path).header("idempotency-key", "push");
        request.multipart(files.form())
    })
    .await;
    let pushed: Pushed = serde_json::from_value(pushed).expect("pushed");
    assert!(pushed.created, "the first answer, not that of the second push");

    let merges = format!("/v1/sessions/{id}/merges");
    let job: Job = serde_json::from_value(twice(|| post(&merges, "merge", json!({}))).await).expect("a job");
    let rule = json!({ "rule": { "apart": { "robots": ["r1", "r2"] } } });
    let constraints = format!("/v1/sessions/{id}/constraints");
    twice(|| post(&constraints, "rule", rule.clone())).await;
    let cancel = format!("/v1/jobs/{}:cancel", job.id);
    twice(|| post(&cancel, "cancel", json!({}))).await;

    let jobs: Page<Job> = server.read(&merges).await;
    let constraints: Page<Constraint> = server.read(&constraints).await;
    assert_eq!((jobs.items.len(), constraints.items.len()), (1, 1));
    assert_eq!(jobs.items[0].state, JobState::Cancelled);

    // they hold across a restart, and without a name everything is made again
    let server = TestServer::start_in(server.kill().await, &["--workers", "0"]);
    let request = server.post(&merges).header("idempotency-key", "merge").json(&json!({}));
    let (status, _, replayed, body) = told(request).await;
    assert_eq!((status, replayed), (202, true));
    assert_eq!(body["id"], json!(job.id));
    assert_eq!(body["state"], "queued", "as it was told first");
    let other: Job = read(answer(server.post(&merges)).await).await;
    assert_ne!(other.id, job.id);
}

#[tokio::test]
async fn an_answer_that_tells_of_what_was_deleted_since_is_not_given_again() {
    let server = TestServer::start(&["--workers", "0"]);
    let post = |path: &str, name: &str, body: Value| named(&server, path, name).json(&body);
    let delete = async |path: &str| {
        let answer = answer(server.request("DELETE", path)).await;
        assert_eq!(answer.status(), StatusCode::NO_CONTENT);
    };
    let gone = async |request: RequestBuilder| {
        let refused = problem(request).await;
        let told = (refused.code, refused.status, refused.errors[0].field.as_str());
        assert_eq!(told, (ProblemCode::Gone, 410, "idempotency-key"), "{refused:?}");
    };
    let make = || post("/v1/sessions", "make", json!({ "auto_merge": false }));
    let session = twice(make).await;
    let path = format!("/v1/sessions/{}", session["id"].as_str().expect("an id"));

    let constraints = format!("{path}/constraints");
    let rule = || {
        let rule = json!({ "rule": { "apart": { "robots": ["r1", "r2"] } } });
        post(&constraints, "rule", rule)
    };
    let constraint = twice(rule).await;
    delete(&format!("{constraints}/{}", constraint["id"].as_str().expect("an id"))).await;
    gone(rule()).await;

    let scrap = Files::of("m", &scrap(1));
    let maps = format!("{path}/robots/r1/maps");
    let push = || {
        let request = named(&server, &maps, "push");
        request.multipart(scrap.form())
    };
    twice(push).await;
    let merge = || post(&format!("{path}/merges"), "merge", json!({}));
    let cancel = format!("/v1/jobs/{}:cancel", twice(merge).await["id"].as_str().expect("an id"));
    let cancel = || post(&cancel, "cancel", json!({}));
    twice(cancel).await;

    delete(&path).await;
    for request in [make(), push(), merge(), cancel()] {
        gone(request).await;
    }
    let sessions: Page<Session> = server.read("/v1/sessions").await;
    assert!(sessions.items.is_empty(), "nothing is made again");
    let other = twice(|| post("/v1/sessions", "make-another", json!({}))).await;
    assert_ne!(other["id"], session["id"]);
}

#[tokio::test]
async fn a_name_that_stands_for_another_request_or_is_none_is_refused() {
    let server = TestServer::start(&["--workers", "0"]);
    let make = |name: &'static str, title: &str| {
        let request = server.post("/v1/sessions").header("idempotency-key", name);
        request.json(&json!({ "title": title }))
    };
    let ward: Session = read(answer(make("a", "Ward")).await).await;
    let refused = problem(make("a", "Hall")).await;
    assert_eq!((refused.code, refused.status), (ProblemCode::IdempotencyKeyReused, 422));
    assert_eq!(refused.errors[0].value.as_deref(), Some("a"));
    let elsewhere = server.post(&format!("/v1/sessions/{}/merges", ward.id));
    let refused = problem(
        elsewhere
            .header("idempotency-key", "a")
            .json(&json!({ "title": "Ward" })),
    )
    .await;
    assert_eq!(refused.code, ProblemCode::IdempotencyKeyReused);
    for bad in ["two words", ""] {
        let refused = problem(make("b", "Ward").header("idempotency-key", bad)).await;
        assert_eq!(
            (refused.code, refused.errors[0].field.as_str()),
            (ProblemCode::BadRequest, "idempotency-key")
        );
    }
    // a refusal has changed nothing: the name is free for the request that is right
    assert_eq!(
        problem(make("c", &"x".repeat(1000))).await.code,
        ProblemCode::InvalidRequest
    );
    let right: Session = read(answer(make("c", "Hall")).await).await;
    assert_ne!(right.id, ward.id);
    // what changes nothing or is idempotent by itself is not named
    let put = server
        .put("/v1/sessions/hall")
        .header("idempotency-key", "a")
        .json(&json!({}));
    assert_eq!(answer(put).await.status(), StatusCode::CREATED);
    let sessions: Page<Session> = server.read("/v1/sessions").await;
    assert_eq!(sessions.items.len(), 3);
}

#[tokio::test]
async fn names_are_each_keys_own() {
    let server = TestServer::start(&["--workers", "0"]);
    let store = SqliteStore::open_file_beside(&server.folder().join("mapweld.sqlite"))
        .await
        .expect("opens");
    let keys = [
        keep(&store, Scope::Operator, |_| {}).await,
        keep(&store, Scope::Admin, |_| {}).await,
        keep(&store, robots("hall", "r1"), |_| {}).await,
    ];
    let mut made = Vec::new();
    for key in &keys[..2] {
        let request = server.post("/v1/sessions").bearer_auth(key.reveal());
        let session: Session = read(answer(request.header("idempotency-key", "a")).await).await;
        made.push(session.id);
    }
    assert_ne!(made[0], made[1]);
    // who may not is refused before anything is told
    let request = server.post("/v1/sessions").bearer_auth(keys[2].reveal());
    let refused = problem(request.header("idempotency-key", "a")).await;
    assert_eq!(refused.code, ProblemCode::Forbidden);
}

/// Hangs up at many moments, of which some fall between the name's entry and the answer.
#[tokio::test]
async fn a_caller_that_hangs_up_before_its_answer_is_told_it_when_it_comes_again() {
    const CALLERS: u64 = 100;
    // an attempt that nobody ends holds its name for a minute
    const SOON: Duration = Duration::from_secs(30);
    let server = TestServer::start(&["--workers", "0"]);
    for caller in 0..CALLERS {
        let mut socket = TcpStream::connect(server.address()).await.expect("it listens");
        let request = format!(
            "POST /v1/sessions HTTP/1.1\r\nhost: x\r\nidempotency-key: {caller}\r\ncontent-type: application/json\r\n\
             content-length: 2\r\n\r\n{{}}"
        );
        socket.write_all(request.as_bytes()).await.expect("it reads");
        // up to 5 ms: a request takes less
        tokio::time::sleep(Duration::from_micros(50 * caller)).await;
    }
    let began = std::time::Instant::now();
    for caller in 0..CALLERS {
        loop {
            let again = named(&server, "/v1/sessions", &caller.to_string());
            let again = answer(again.header("content-type", "application/json").body("{}")).await;
            match again.status() {
                StatusCode::CREATED => break,
                StatusCode::CONFLICT => assert!(again.headers().contains_key("retry-after")),
                other => panic!("{other}"),
            }
            assert!(began.elapsed() < SOON, "the name of caller {caller} stays held");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
    let sessions: Page<Session> = server.read("/v1/sessions?page_size=200").await;
    assert_eq!(sessions.items.len() as u64, CALLERS);
    assert!(sessions.next_page_token.is_none(), "no caller has made two");
}

#[tokio::test]
async fn a_change_whose_answer_was_lost_with_the_server_is_not_made_twice() {
    if !cfg!(debug_assertions) {
        return; // release builds have no failpoints
    }
    let server = TestServer::start(&["--workers", "0", "--failpoint", "before_answer:kill:2"]);
    let make = |server: &TestServer| {
        let request = server.post("/v1/sessions").header("idempotency-key", "make");
        request.json(&json!({ "auto_merge": false }))
    };
    let session: Session = read(answer(make(&server)).await).await;
    let merges = format!("/v1/sessions/{}/merges", session.id);
    let merge = |server: &TestServer| {
        let request = server.post(&merges).header("idempotency-key", "merge");
        request.json(&json!({}))
    };
    merge(&server).send().await.expect_err("it dies before it answers");
    let server = TestServer::start_in(server.kill().await, &["--workers", "0"]);
    let refused = problem(merge(&server)).await;
    assert_eq!((refused.code, refused.status), (ProblemCode::IdempotencyKeyInUse, 409));
    let queued: Page<Job> = server.read(&merges).await;
    assert_eq!(queued.items.len(), 1, "it was committed");
    // as if the lease had run out
    let store = SqliteStore::open_file_beside(&server.folder().join("mapweld.sqlite"))
        .await
        .expect("opens");
    let lost = Attempt {
        owner: "anyone".to_owned(),
        name: "merge".parse().expect("a name"),
        makes: queued.items[0].id.uuid(),
        token: 1,
    };
    store
        .end_call(&lost, CallEnd::Unknown, Timestamp::now())
        .await
        .expect("the store answers");
    let (status, location, replayed, body) = told(merge(&server)).await;
    assert_eq!((status, replayed), (202, false));
    assert_eq!(body["id"], json!(queued.items[0].id));
    assert_eq!(location, Some(format!("/v1/jobs/{}", queued.items[0].id)));
    let jobs: Page<Job> = server.read(&merges).await;
    assert_eq!(jobs.items.len(), 1);
    assert!(told(merge(&server)).await.2, "now it is kept");
}

#[tokio::test]
async fn names_are_forgotten_after_their_time_and_swept() {
    let server = TestServer::start(&["--workers", "0", "--keep-answers", "1s", "--sweep-every", "200ms"]);
    let make = || {
        server
            .post("/v1/sessions")
            .header("idempotency-key", "a")
            .json(&json!({}))
    };
    let first: Session = read(answer(make()).await).await;
    let began = std::time::Instant::now();
    loop {
        let session: Session = read(answer(make()).await).await;
        if session.id != first.id {
            break;
        }
        assert!(began.elapsed() < PATIENCE, "it is never forgotten");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    assert!(
        began.elapsed() >= Duration::from_millis(900),
        "it was forgotten too early"
    );
}

//! Under load: what is beyond the bounds is refused in words, probes pass, and nothing that was acknowledged is lost.

#![expect(clippy::print_stderr, reason = "measurements are told")]

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use mapweld::api::{Map, ProblemCode};
use reqwest::{RequestBuilder, StatusCode};
use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::task::JoinSet;

use super::rooms::{Files, scrap, three_robots};
use super::server::{PATIENCE, TestServer, problem};
use crate::survival::full_form;

/// A connection on which this was sent.
async fn sent(server: &TestServer, text: &str) -> TcpStream {
    let mut socket = TcpStream::connect(server.address()).await.expect("it listens");
    socket.write_all(text.as_bytes()).await.expect("it reads");
    socket
}

/// An upload that never ends, and that the server has begun to read: only then it asks for the body.
async fn slow_upload(server: &TestServer) -> TcpStream {
    let head = "POST /v1/sessions/s/robots/r/maps HTTP/1.1\r\nhost: x\r\ncontent-type: image/png\r\n\
                content-length: 9\r\nexpect: 100-continue\r\n\r\n";
    let mut socket = sent(server, head).await;
    let mut answer = [0; 12];
    let read = tokio::time::timeout(PATIENCE, socket.read_exact(&mut answer)).await;
    read.expect("in time").expect("an answer");
    assert_eq!(&answer, b"HTTP/1.1 100");
    socket
}

/// Asks until the answer has this status; gives that answer's problem code, if it is one.
async fn until_status(request: impl Fn() -> RequestBuilder, wanted: StatusCode) -> Option<String> {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let answer = request().send().await.expect("an answer");
        let (status, headers) = (answer.status(), answer.headers().clone());
        if status == wanted {
            let refused = status == StatusCode::SERVICE_UNAVAILABLE || status == StatusCode::TOO_MANY_REQUESTS;
            assert_eq!(refused, headers.contains_key("retry-after"), "{headers:?}");
            let body: Value = answer.json().await.unwrap_or_default();
            return body["code"].as_str().map(str::to_owned);
        }
        assert!(Instant::now() < deadline, "{status}, not {wanted}");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

#[tokio::test]
async fn requests_beyond_the_bound_are_refused_in_words_and_probes_are_answered() {
    let server = TestServer::start(&["--workers", "0", "--max-requests", "1"]);
    let slow = slow_upload(&server).await;
    let methods = || server.get("/v1/methods");
    let code = until_status(methods, StatusCode::SERVICE_UNAVAILABLE).await;
    assert_eq!(code.as_deref(), Some("overloaded"));
    for probe in ["/livez", "/readyz"] {
        let answer = server.get(probe).send().await.expect("an answer");
        assert_eq!(answer.status(), StatusCode::OK, "{probe}");
    }
    drop(slow);
    until_status(methods, StatusCode::OK).await;
}

#[tokio::test]
async fn event_streams_have_a_bound_of_their_own() {
    let server = TestServer::start(&["--workers", "0", "--max-waiting", "1", "--max-requests", "1"]);
    server.put("/v1/sessions/hall").send().await.expect("an answer");
    let events = || server.get("/v1/sessions/hall/events");
    let first = events().send().await.expect("an answer");
    assert_eq!(first.status(), StatusCode::OK);
    let second = problem(events()).await;
    assert_eq!(second.code, ProblemCode::Overloaded);
    let other = server.get("/v1/sessions/hall").send().await.expect("an answer");
    assert_eq!(other.status(), StatusCode::OK, "who waits takes no place of who works");
    drop(first);
    until_status(events, StatusCode::OK).await;
}

/// The answer to one request on a connection of its own, to its end.
async fn one_answer(server: &TestServer, path: &str) -> String {
    let mut socket = sent(server, &format!("GET {path} HTTP/1.1\r\nhost: x\r\n\r\n")).await;
    let mut answer = String::new();
    let read = tokio::time::timeout(PATIENCE, socket.read_to_string(&mut answer)).await;
    read.expect("the connection is closed").expect("it can be read");
    answer
}

#[tokio::test]
async fn connections_beyond_the_bound_are_answered_once_and_probes_pass() {
    let server = TestServer::start(&["--workers", "0", "--max-connections", "2"]);
    let mut kept = Vec::new();
    for _ in 0..2 {
        let mut socket = sent(&server, "GET /livez HTTP/1.1\r\nhost: x\r\n\r\n").await;
        let mut answer = [0; 12];
        socket.read_exact(&mut answer).await.expect("an answer");
        assert_eq!(&answer, b"HTTP/1.1 200");
        kept.push(socket);
    }
    let probe = one_answer(&server, "/livez").await;
    assert!(probe.starts_with("HTTP/1.1 200"), "{probe}");
    let refused = one_answer(&server, "/v1/methods").await;
    assert!(refused.starts_with("HTTP/1.1 503"), "{refused}");
    assert!(
        refused.contains("retry-after: 1") && refused.contains("at most 2 at one time"),
        "{refused}"
    );
    drop(kept);
    until_status(|| server.get("/v1/methods"), StatusCode::OK).await;
}

#[tokio::test]
async fn a_head_that_trickles_in_is_given_up() {
    let server = TestServer::start(&["--workers", "0", "--head-time", "300ms"]);
    let mut socket = sent(&server, "GET /livez HTTP/1.1\r\nx: ").await;
    let trickle = async {
        loop {
            // a byte now and then, as slowly as such callers do
            tokio::time::sleep(Duration::from_millis(50)).await;
            if socket.write_all(b"x").await.is_err() {
                break;
            }
            let mut byte = [0];
            let heard = tokio::time::timeout(Duration::from_millis(1), socket.read(&mut byte)).await;
            if matches!(heard, Ok(Ok(0) | Err(_))) {
                break;
            }
        }
    };
    let ended = tokio::time::timeout(PATIENCE, trickle).await;
    assert!(ended.is_ok(), "the connection is kept");
}

fn percentile(mut times: Vec<Duration>, share: f64) -> Duration {
    times.sort();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "some hundreds of measurements"
    )]
    let at = ((times.len() - 1) as f64 * share).ceil() as usize;
    times[at]
}

async fn probe(server: &TestServer) -> Duration {
    let began = Instant::now();
    let answer = server.get("/livez").send().await.expect("an answer");
    assert_eq!(answer.status(), StatusCode::OK);
    began.elapsed()
}

#[tokio::test(flavor = "multi_thread")]
async fn livez_answers_within_50_ms_while_all_workers_merge() {
    let server = TestServer::start(&["--workers", "2", "--max-queued", "200"]);
    let (maps, _) = three_robots();
    let mut idle = Vec::new();
    for _ in 0..300 {
        idle.push(probe(&server).await);
    }
    for hall in 0..6 {
        for (robot, map) in ["a", "b", "c"].iter().zip(&maps) {
            server
                .push(&format!("hall-{hall}"), robot, &Files::of(robot, map))
                .await;
        }
    }
    let mut busy = Vec::new();
    loop {
        let depth: Value = server.read("/readyz").await;
        let working = depth["running"].as_u64().expect("a count");
        if working < 2 && depth["queued"] == 0 {
            break;
        }
        if working == 2 {
            for _ in 0..10 {
                busy.push(probe(&server).await);
            }
        }
    }
    let measured = busy.len();
    assert!(measured >= 50, "only {measured} probes while both workers merged");
    let (idle, busy) = (percentile(idle, 0.99), percentile(busy, 0.99));
    eprintln!("/livez p99: {idle:?} at rest, {busy:?} while all workers merge ({measured} probes)");
    // Beside other tests, what the machine takes at rest it takes for others' work; `tests/load.sh` has it for itself.
    let alone = full_form("MAPWELD_UPLOADS", 0) > 0;
    let others = if alone { Duration::ZERO } else { idle };
    assert!(busy < Duration::from_millis(50) + others, "{busy:?}, at rest {idle:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn above_its_capacity_a_server_answers_only_429_and_503_and_loses_nothing_that_it_took() {
    const ROBOTS: u32 = 24;
    const PUSHES: u32 = 6;
    const QUEUED: u64 = 10;
    let server = TestServer::start(&[
        "--workers",
        "0",
        "--max-uploads",
        "4",
        "--max-requests",
        "8",
        "--max-queued",
        "10",
    ]);
    let mut robots = JoinSet::new();
    for robot in 0..ROBOTS {
        let requests: Vec<RequestBuilder> = (0..PUSHES)
            .map(|push| {
                let files = Files::of("m", &scrap(robot * PUSHES + push + 1));
                let session = robot * PUSHES + push;
                server
                    .post(&format!("/v1/sessions/s{session}/robots/r/maps"))
                    .multipart(files.form())
            })
            .collect();
        robots.spawn(async move {
            let mut answers = Vec::new();
            for request in requests {
                let answer = request.send().await.expect("an answer");
                let told = answer.headers().contains_key("retry-after");
                answers.push((
                    answer.status().as_u16(),
                    told,
                    answer.json::<Value>().await.expect("JSON"),
                ));
            }
            answers
        });
    }
    let mut statuses = BTreeMap::<u16, u32>::new();
    let mut kept = Vec::new();
    for (status, told, body) in robots.join_all().await.into_iter().flatten() {
        *statuses.entry(status).or_default() += 1;
        match status {
            201 => kept.push(serde_json::from_value::<Map>(body["map"].clone()).expect("a map")),
            429 | 503 => assert!(told, "{body}"),
            other => panic!("{other}: {body}"),
        }
    }
    eprintln!("{ROBOTS} robots at once, {PUSHES} pushes each: {statuses:?}");
    assert_eq!(kept.len() as u64, QUEUED, "as many sessions as the queue holds jobs");
    let depth: Value = server.read("/readyz").await;
    assert_eq!(depth["queued"], QUEUED);
    let server = TestServer::start_in(server.kill().await, &["--workers", "0"]);
    for map in kept {
        let path = format!("/v1/sessions/{}/maps/{}", map.session, map.id);
        assert_eq!(server.read::<Map>(&path).await, map);
    }
}

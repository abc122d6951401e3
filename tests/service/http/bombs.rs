//! Requests that are made to exhaust a server are refused in words, and its memory stays within bounds that are told
//! beforehand.

use mapweld::api::Problem;
use mapweld::model::Scope;
use mapweld::store::SqliteStore;
use serde_json::Value;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

use super::access::keep;
use super::bomb_corpus::all;
use super::rooms::{Files, scrap};
use super::server::{PATIENCE, TestServer};
use crate::survival::tell;

/// What a request may be at most: the default of `--max-body-bytes`.
const LIMIT: u64 = 128 << 20;

/// What the server may need besides.
const ROOM: u64 = 64_000_000;

/// The longest refusal: it does not grow with what was sent.
const ANSWER_MAX: usize = 8 << 10;

#[tokio::test]
async fn every_bomb_is_refused_in_words_and_memory_stays_within_the_limit_and_64_mb() {
    let body_max = LIMIT.to_string();
    let server = TestServer::start(&["--workers", "1", "--max-body-bytes", &body_max]);
    let at_rest = server.peak_memory();
    let mut peak = (at_rest, "at rest");
    let bombs = all();
    for bomb in &bombs {
        let bomb = bomb();
        let mut request = server.request(bomb.method, &bomb.path).body(bomb.body);
        for (name, value) in bomb.headers {
            request = request.header(name, value);
        }
        let answer = request
            .send()
            .await
            .unwrap_or_else(|error| panic!("{}: {error:?}", bomb.name));
        let (status, headers) = (answer.status(), answer.headers().clone());
        let text = answer.text().await.expect("a body");
        let start: String = text.chars().take(400).collect();
        assert!(status.is_client_error(), "{}: {status}: {start}", bomb.name);
        assert_eq!(headers["content-type"], "application/problem+json", "{}", bomb.name);
        assert!(
            text.len() <= ANSWER_MAX,
            "{}: an answer of {} bytes",
            bomb.name,
            text.len()
        );
        let problem: Problem = serde_json::from_str(&text).expect("a problem");
        assert!(
            !problem.errors.is_empty() && problem.errors.iter().all(|error| error.limit.is_some()),
            "{}: {start}",
            bomb.name
        );
        let now = server.peak_memory();
        if now > peak.0 {
            peak = (now, bomb.name);
        }
        assert!(now < LIMIT + ROOM, "{}: {} MB at most", bomb.name, now / 1_000_000);
    }
    tell(&format!(
        "{} bombs, all refused: peak memory {} MB ({}), {} MB at rest; limit {} MB + 64 MB",
        bombs.len(),
        peak.0 / 1_000_000,
        peak.1,
        at_rest / 1_000_000,
        LIMIT / 1_000_000,
    ));
    let sessions: Value = server.read("/v1/sessions").await;
    assert_eq!(
        sessions["items"],
        serde_json::json!([]),
        "what is refused makes nothing"
    );
    let (status, pushed) = server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    assert_eq!(status.as_u16(), 201, "a robot's map is still taken");
    server.ended(pushed.job.expect("a merge follows")).await;
}

/// The status of the answer to a body of zeros that is sent to its end before anybody listens for the answer, as simple
/// clients do.
async fn answer_to_zeros(server: &TestServer, head: &str, megabytes: usize) -> String {
    let mut socket = TcpStream::connect(server.address()).await.expect("it listens");
    let head = format!("{head} HTTP/1.1\r\nhost: x\r\ncontent-length: {}\r\n", megabytes << 20);
    socket.write_all(head.as_bytes()).await.expect("it reads");
    socket
        .write_all(b"content-type: image/png\r\n\r\n")
        .await
        .expect("it reads");
    let zeros = vec![0; 1 << 20];
    for _ in 0..megabytes {
        socket.write_all(&zeros).await.expect("the server reads on");
    }
    let mut answer = vec![0; 12];
    let read = tokio::time::timeout(PATIENCE, socket.read_exact(&mut answer)).await;
    read.expect("in time").expect("an answer");
    String::from_utf8(answer).expect("ASCII")
}

#[tokio::test]
async fn who_sends_to_the_end_before_he_listens_still_learns_why_he_is_refused() {
    let server = TestServer::start(&["--workers", "0", "--max-body-bytes", "1000000"]);
    let at_rest = server.peak_memory();
    let maps = "POST /v1/sessions/hall/robots/r1/maps?resolution=0.05&origin=0,0,0";
    for (head, status) in [(maps, "413"), ("POST /nowhere", "404"), ("POST /v1/methods", "405")] {
        let answer = answer_to_zeros(&server, head, 48).await;
        assert_eq!(answer, format!("HTTP/1.1 {status}"), "{head}");
    }
    let needed = server.peak_memory() - at_rest;
    assert!(needed < 16_000_000, "what is thrown away is not held: {needed} bytes");
    keep_key(&server).await;
    let answer = answer_to_zeros(&server, maps, 48).await;
    assert_eq!(answer, "HTTP/1.1 401");
}

/// From now on the server asks for keys.
async fn keep_key(server: &TestServer) {
    let store = SqliteStore::open_file_beside(&server.folder().join("mapweld.sqlite"))
        .await
        .expect("opens");
    keep(&store, Scope::Admin, |_| {}).await;
}

//! The client against a server that follows a script.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;

use super::*;
use crate::api::ProblemCode;

const PUSHED: &str = r#"{"created":true,"map":{"id":"01939f3e-7a52-7c1e-b5e6-3d8f0f6f2a10","session":"s","robot":"r",
    "sequence":1,"digest":"0000000000000000000000000000000000000000000000000000000000000000","width":2,"height":1,
    "resolution":0.05,"origin":{"x":0,"y":0,"yaw":0},"known_area_m2":0.005,
    "counts":{"unknown":0,"free":1,"occupied":1},"frame_id":null,"warnings":[],
    "received_at":"2026-11-22T10:00:00Z"}}"#;

/// Answers one connection after the other as the script says; an empty answer is a broken connection.
async fn scripted(answers: Vec<String>) -> (String, Arc<Mutex<Vec<String>>>) {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let address = format!("http://{}", listener.local_addr().expect("an address"));
    let asked = Arc::new(Mutex::new(Vec::new()));
    let seen = Arc::clone(&asked);
    tokio::spawn(async move {
        for answer in answers {
            let (mut socket, _) = listener.accept().await.expect("a connection");
            let request = read_request(&mut socket).await;
            seen.lock().expect("no panic").push(request);
            socket.write_all(answer.as_bytes()).await.expect("the client listens");
        }
    });
    (address, asked)
}

async fn read_request(socket: &mut tokio::net::TcpStream) -> String {
    let mut request = Vec::new();
    let mut buffer = [0; 4096];
    loop {
        let count = socket.read(&mut buffer).await.expect("the client speaks");
        request.extend_from_slice(&buffer[..count]);
        let text = String::from_utf8_lossy(&request).to_lowercase();
        let body = text.split_once("\r\n\r\n").map(|(_, body)| body.len());
        let length = text
            .lines()
            .find_map(|line| line.strip_prefix("content-length: ")?.parse::<usize>().ok());
        if count == 0 || body.is_some_and(|body| body >= length.unwrap_or(0)) {
            return String::from_utf8_lossy(&request).into_owned();
        }
    }
}

fn answer(status: &str, headers: &str, body: &str) -> String {
    let length = body.len();
    format!("HTTP/1.1 {status}\r\nconnection: close\r\ncontent-length: {length}\r\n{headers}\r\n{body}")
}

#[tokio::test]
async fn a_key_goes_with_every_request_and_is_told_to_nobody_else() {
    let (server, asked) = scripted(vec![answer("201 Created", "", PUSHED)]).await;
    let key = format!("mapweld_{}_{}", "0".repeat(32), "ab".repeat(32));
    let client = client(&server).with_key(&key).expect("a key");
    client.push_map_once(&recipient(), &upload()).await.expect("is pushed");
    let asked = asked.lock().expect("no panic").concat().to_lowercase();
    assert!(asked.contains(&format!("authorization: bearer {key}\r\n")), "{asked}");
    assert!(!format!("{client:?}").contains("abab"), "a secret in Debug");
    let mistake = Client::new(&server, Patience::default(), 1)
        .expect("a server")
        .with_key("mapweld_x");
    assert!(matches!(mistake, Err(ClientError::BadKey)));
}

fn problem(code: ProblemCode) -> String {
    serde_json::to_string(&api::Problem::new(code, "as the script says")).expect("a problem serialises")
}

fn client(server: &str) -> Client {
    let patience = Patience {
        first_wait: Duration::from_millis(5),
        longest_wait: Duration::from_millis(20),
        give_up_after: Duration::from_secs(5),
    };
    Client::new(server, patience, 1).expect("an address")
}

fn recipient() -> Recipient {
    Recipient {
        session: "s".parse().expect("a name"),
        robot: "r".parse().expect("a name"),
    }
}

fn upload() -> Upload {
    Upload {
        map: FilePart::new("m.yaml", "image: m.pgm"),
        image: FilePart::new("m.pgm", "P2 2 1 255 0 254"),
    }
}

#[tokio::test]
async fn a_push_sends_both_files_under_their_names() {
    let (server, asked) = scripted(vec![answer("201 Created", "", PUSHED)]).await;
    let pushed = client(&server)
        .push_map(&recipient(), &upload())
        .await
        .expect("it is taken");
    assert!(pushed.created && pushed.job.is_none());
    let asked = asked.lock().expect("no panic");
    let request = &asked[0];
    assert!(
        request.starts_with("POST /v1/sessions/s/robots/r/maps HTTP/1.1"),
        "{request}"
    );
    for part in [
        "name=\"map\"; filename=\"m.yaml\"",
        "name=\"image\"; filename=\"m.pgm\"",
        "P2 2 1 255 0 254",
    ] {
        assert!(request.contains(part), "{part} is missing in {request}");
    }
}

#[tokio::test]
async fn a_push_is_tried_again_while_the_server_is_overloaded_broken_off_or_behind_a_proxy() {
    let (server, asked) = scripted(vec![
        answer("503 Service Unavailable", "", &problem(ProblemCode::Overloaded)),
        String::new(),
        answer("502 Bad Gateway", "", "<html>nginx</html>"),
        answer("200 OK", "", PUSHED),
    ])
    .await;
    client(&server)
        .push_map(&recipient(), &upload())
        .await
        .expect("it is taken in the end");
    let asked = asked.lock().expect("no panic");
    assert_eq!(asked.len(), 4);
    assert!(
        asked.iter().all(|request| request.contains("P2 2 1 255 0 254")),
        "each attempt sends the whole map"
    );
}

/// The value of a header of a request.
fn header_of<'a>(request: &'a str, name: &str) -> Option<&'a str> {
    let line = request
        .lines()
        .find(|line| line.to_lowercase().starts_with(&format!("{name}: ")))?;
    Some(&line[name.len() + 2..])
}

#[tokio::test]
async fn all_attempts_of_a_push_have_one_name_and_the_digest_of_their_body() {
    let (server, asked) = scripted(vec![
        answer(
            "409 Conflict",
            "retry-after: 0\r\n",
            &problem(ProblemCode::IdempotencyKeyInUse),
        ),
        answer("400 Bad Request", "", &problem(ProblemCode::DigestMismatch)),
        answer("200 OK", "", PUSHED),
        answer("200 OK", "", PUSHED),
    ])
    .await;
    let client = client(&server);
    for _ in 0..2 {
        client
            .push_map(&recipient(), &upload())
            .await
            .expect("it is taken in the end");
    }
    let asked = asked.lock().expect("no panic");
    let names: Vec<_> = asked
        .iter()
        .map(|request| header_of(request, "idempotency-key"))
        .collect();
    assert_eq!((names[0], names[1]), (names[1], names[2]));
    assert!(names[0].is_some_and(|name| name.len() == 36), "{names:?}");
    assert_ne!(names[2], names[3], "another push has another name");
    for request in asked.iter() {
        let (_, body) = request.split_once("\r\n\r\n").expect("a body");
        assert_eq!(
            header_of(request, "content-digest"),
            Some(integrity::told(body.as_bytes()).as_str())
        );
    }
}

#[tokio::test]
async fn a_file_that_was_damaged_on_its_way_is_fetched_again() {
    let digest = format!("repr-digest: {}\r\n", integrity::told(b"P5 whole"));
    let (server, asked) = scripted(vec![
        answer("200 OK", &digest, "P5 wh0le"),
        answer("200 OK", &digest, "P5 whole"),
    ])
    .await;
    let session = "s".parse().expect("a name");
    let file = client(&server)
        .fetch(&session, VersionSelector::Latest, "map.pgm")
        .await;
    assert_eq!(file.expect("it is fetched"), "P5 whole");
    assert_eq!(asked.lock().expect("no panic").len(), 2);
}

#[tokio::test]
async fn the_server_is_not_asked_again_before_the_time_that_it_names() {
    let (server, _) = scripted(vec![
        answer(
            "429 Too Many Requests",
            "retry-after: 1\r\n",
            &problem(ProblemCode::QueueFull),
        ),
        answer("200 OK", "", PUSHED),
    ])
    .await;
    #[expect(clippy::disallowed_methods, reason = "the test measures real time")]
    let started = Instant::now();
    client(&server)
        .push_map(&recipient(), &upload())
        .await
        .expect("it is taken");
    assert!(started.elapsed() >= Duration::from_secs(1), "{:?}", started.elapsed());
}

#[tokio::test]
async fn a_map_that_is_refused_is_not_pushed_again() {
    let (server, asked) = scripted(vec![answer(
        "422 Unprocessable Content",
        "",
        &problem(ProblemCode::InvalidMap),
    )])
    .await;
    let error = client(&server)
        .push_map(&recipient(), &upload())
        .await
        .expect_err("it is refused");
    assert!(!error.is_transient());
    let ClientError::Refused { problem, .. } = &error else {
        panic!("{error:?}")
    };
    assert_eq!(problem.code, ProblemCode::InvalidMap);
    assert!(error.to_string().ends_with("as the script says"), "{error}");
    assert_eq!(asked.lock().expect("no panic").len(), 1);
}

#[tokio::test]
async fn patience_ends_when_the_server_wants_more_time_than_there_is() {
    let refusal = answer(
        "503 Service Unavailable",
        "retry-after: 60\r\n",
        &problem(ProblemCode::ShuttingDown),
    );
    let (server, _) = scripted(vec![refusal]).await;
    let error = client(&server)
        .push_map(&recipient(), &upload())
        .await
        .expect_err("60 s are more than 5 s");
    assert!(matches!(error, ClientError::GaveUp { attempts: 1, .. }), "{error:?}");
    assert!(error.is_transient(), "a later push may succeed");
}

#[tokio::test]
async fn a_server_that_is_no_mapweld_is_told_from_one_that_is_down() {
    let (server, _) = scripted(vec![answer("200 OK", "", "<html>hello</html>")]).await;
    let error = client(&server)
        .push_map_once(&recipient(), &upload())
        .await
        .expect_err("no mapweld");
    assert!(matches!(error, ClientError::Foreign { status: 200, .. }), "{error:?}");
    assert!(error.to_string().contains("<html>hello"), "{error}");

    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let server = format!("http://{}", listener.local_addr().expect("an address"));
    drop(listener);
    let error = client(&server)
        .push_map_once(&recipient(), &upload())
        .await
        .expect_err("nobody there");
    assert!(matches!(error, ClientError::Unreachable { .. }), "{error:?}");
    assert!(error.to_string().contains("refused"), "{error}");
}

#[test]
fn what_is_no_address_of_a_server_is_refused() {
    for bad in ["", "localhost:8080", "ftp://robot", "http://"] {
        let refused = Client::new(bad, Patience::default(), 1);
        assert!(matches!(refused, Err(ClientError::BadServer { .. })), "{bad:?}");
    }
    for (good, server) in [
        ("http://[::1]:8080", "http://[::1]:8080/"),
        ("http://h/weld", "http://h/weld/"),
    ] {
        assert_eq!(
            Client::new(good, Patience::default(), 1).expect("an address").server(),
            server
        );
    }
}

//! Every refusal is problem+json with a stable code.

use std::time::Duration;

use mapweld::api::ProblemCode;
use reqwest::StatusCode;
use reqwest::multipart::{Form, Part};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use super::rooms::{Files, scrap};
use super::server::{PATIENCE, TestServer, problem};

const MAPS: &str = "/v1/sessions/hall/robots/r1/maps";

#[tokio::test]
async fn what_is_not_there_is_told_by_its_kind() {
    let server = TestServer::start(&["--workers", "0"]);
    server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    let id = "01939f3e-7a52-7c1e-b5e6-3d8f0f6f2a10";
    let cases = [
        ("/v1/nothing".to_owned(), ProblemCode::NotFound),
        ("/v1/jobs/x/~cancel".to_owned(), ProblemCode::NotFound),
        ("/assets/nothing".to_owned(), ProblemCode::NotFound),
        ("/v1/sessions/none".to_owned(), ProblemCode::SessionNotFound),
        ("/v1/sessions/none/events".to_owned(), ProblemCode::SessionNotFound),
        (format!("/v1/sessions/hall/maps/{id}"), ProblemCode::MapNotFound),
        (format!("/v1/sessions/hall/maps/{id}.png"), ProblemCode::MapNotFound),
        (format!("/v1/jobs/{id}"), ProblemCode::JobNotFound),
        (format!("/v1/jobs/{id}/events"), ProblemCode::JobNotFound),
        (
            "/v1/sessions/hall/versions/latest".to_owned(),
            ProblemCode::VersionNotFound,
        ),
        (
            "/v1/sessions/hall/versions/7/map.png".to_owned(),
            ProblemCode::VersionNotFound,
        ),
    ];
    for (path, code) in cases {
        let problem = problem(server.get(&path)).await;
        assert_eq!(problem.code, code, "{path}");
        assert_eq!(problem.instance.as_deref(), Some(path.as_str()));
    }
}

#[tokio::test]
async fn paths_and_queries_that_are_not_understood_are_told_with_the_field_and_its_limit() {
    let server = TestServer::start(&["--workers", "0"]);
    server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    let cases = [
        ("/v1/sessions/Hall", ProblemCode::InvalidPath, "session"),
        ("/v1/jobs/7", ProblemCode::InvalidPath, "job"),
        ("/v1/sessions/hall/maps/x.png", ProblemCode::InvalidPath, "map"),
        ("/v1/sessions/hall/versions/0", ProblemCode::InvalidPath, "version"),
        ("/v1/sessions?page_size=x", ProblemCode::InvalidQuery, "page_size"),
        ("/v1/sessions?page_size=0", ProblemCode::InvalidRequest, "page_size"),
        ("/v1/sessions?pagesize=1", ProblemCode::InvalidQuery, "pagesize"),
        (
            "/v1/sessions/hall/maps?page_token=x",
            ProblemCode::InvalidRequest,
            "page_token",
        ),
        (
            "/v1/jobs/01939f3e-7a52-7c1e-b5e6-3d8f0f6f2a10?wait=61",
            ProblemCode::InvalidRequest,
            "wait",
        ),
    ];
    for (path, code, field) in cases {
        let problem = problem(server.get(path)).await;
        assert_eq!(problem.code, code, "{path}");
        let told = format!("{:?}", problem.errors);
        assert!(
            told.contains(field) && problem.errors[0].limit.is_some(),
            "{path}: {told}"
        );
    }
}

#[tokio::test]
async fn a_method_that_a_path_does_not_take_is_answered_with_those_that_it_takes() {
    let server = TestServer::start(&["--workers", "0"]);
    let refused = server.request("DELETE", "/v1/methods").send().await.expect("an answer");
    assert_eq!(refused.headers()["allow"], "GET,HEAD");
    let problem = problem(server.request("PUT", "/v1/jobs/7:cancel")).await;
    assert_eq!(problem.code, ProblemCode::MethodNotAllowed);
}

#[tokio::test]
async fn bodies_that_are_not_understood_are_told_by_their_kind() {
    let server = TestServer::start(&["--workers", "0"]);
    let put = |body: &'static str| {
        server
            .put("/v1/sessions/hall")
            .header("content-type", "application/json")
            .body(body)
    };
    let grid = scrap(1);
    let files = Files::of("m", &grid);
    let part = |bytes: &[u8]| Part::bytes(bytes.to_vec()).file_name("m");
    let cases = [
        (put("{\"title\": "), ProblemCode::MalformedJson),
        (put("{\"title\": 3}"), ProblemCode::InvalidRequest),
        (put("{\"colour\": \"red\"}"), ProblemCode::InvalidRequest),
        (put("{\"resolution\": 0}"), ProblemCode::InvalidRequest),
        (
            server.put("/v1/sessions/hall").body("title: hall"),
            ProblemCode::UnsupportedMediaType,
        ),
        (
            server.post(MAPS).header("content-type", "text/plain").body("map"),
            ProblemCode::UnsupportedMediaType,
        ),
        (
            server
                .post(MAPS)
                .header("content-type", "multipart/form-data; boundary=x")
                .body("--y"),
            ProblemCode::MalformedMultipart,
        ),
        (
            server.post(MAPS).multipart(Form::new().part("map", part(&files.yaml))),
            ProblemCode::MalformedMultipart,
        ),
        (
            server.post(MAPS).multipart(files.form().part("colour", part(b"red"))),
            ProblemCode::MalformedMultipart,
        ),
        (
            server.post(MAPS).multipart(
                Form::new()
                    .part("map", part(b"image: m"))
                    .part("image", part(&files.image)),
            ),
            ProblemCode::InvalidMap,
        ),
        (
            server.post(MAPS).header("content-type", "image/png").body("PNG"),
            ProblemCode::InvalidQuery,
        ),
        (
            server
                .post(&format!("{MAPS}?resolution=0.05&origin=0,0,0"))
                .header("content-type", "image/png")
                .body("PNG"),
            ProblemCode::InvalidMap,
        ),
        (
            server.post(&format!("{MAPS}?resolution=0.05")).multipart(files.form()),
            ProblemCode::InvalidQuery,
        ),
        (
            server
                .post(MAPS)
                .header("content-type", "application/json")
                .body("{\"info\": 1}"),
            ProblemCode::InvalidMap,
        ),
        (
            server.post("/v1/merge").multipart(files.form()),
            ProblemCode::MalformedMultipart,
        ),
        (
            server
                .post("/v1/merge")
                .header("accept", "text/html")
                .multipart(files.form()),
            ProblemCode::NotAcceptable,
        ),
    ];
    for (request, code) in cases {
        let problem = problem(request).await;
        assert_eq!(problem.code, code, "{problem:?}");
        assert!(!problem.errors.is_empty(), "{problem:?}");
    }
    let sessions = server.read::<serde_json::Value>("/v1/sessions").await;
    assert_eq!(
        sessions["items"],
        serde_json::json!([]),
        "what is refused makes nothing"
    );
}

#[tokio::test]
async fn what_is_too_large_is_refused_before_it_is_taken_in() {
    let server = TestServer::start(&["--workers", "0", "--max-body-bytes", "2000", "--max-cells", "300"]);
    let too_many_bytes = problem(
        server
            .post(&format!("{MAPS}?resolution=0.05&origin=0,0,0"))
            .header("content-type", "image/png")
            .body(vec![0; 2001]),
    )
    .await;
    assert_eq!(too_many_bytes.code, ProblemCode::BodyTooLarge);
    assert!(format!("{:?}", too_many_bytes.errors).contains("at most 2000 bytes"));
    let too_many_cells = problem(server.post(MAPS).multipart(Files::of("m", &scrap(1)).form())).await;
    assert_eq!(too_many_cells.code, ProblemCode::MapTooLarge);
    assert!(format!("{:?}", too_many_cells.errors).contains("at most 300 cells"));
}

#[tokio::test]
async fn a_body_that_does_not_arrive_is_given_up() {
    let server = TestServer::start(&["--workers", "0", "--body-time", "200ms"]);
    let mut socket = TcpStream::connect(server.address()).await.expect("it listens");
    let head = format!("POST {MAPS} HTTP/1.1\r\nhost: x\r\ncontent-type: image/png\r\ncontent-length: 100\r\n\r\nPNG");
    socket.write_all(head.as_bytes()).await.expect("it reads");
    let mut answer = vec![0; 4096];
    let count = tokio::time::timeout(PATIENCE, socket.read(&mut answer))
        .await
        .expect("it answers in time")
        .expect("it answers");
    let answer = String::from_utf8_lossy(&answer[..count]).into_owned();
    assert!(answer.starts_with("HTTP/1.1 408"), "{answer}");
    assert!(
        answer.contains("body_timeout") || answer.contains("problem+json"),
        "{answer}"
    );
}

#[tokio::test]
async fn a_full_queue_and_too_many_uploads_are_told_when_to_come_again() {
    let server = TestServer::start(&[
        "--workers",
        "0",
        "--max-queued",
        "1",
        "--max-uploads",
        "1",
        "--body-time",
        "30s",
    ]);
    server.push("one", "r1", &Files::of("m", &scrap(1))).await;
    let path = "/v1/sessions/two/robots/r1/maps";
    let refused = server
        .post(path)
        .multipart(Files::of("m", &scrap(1)).form())
        .send()
        .await
        .expect("an answer");
    assert_eq!(refused.status(), StatusCode::TOO_MANY_REQUESTS);
    assert_eq!(refused.headers()["retry-after"], "1");

    let head = format!("POST {MAPS} HTTP/1.1\r\nhost: x\r\ncontent-type: image/png\r\ncontent-length: 100\r\n\r\nPNG");
    let deadline = tokio::time::Instant::now() + PATIENCE;
    loop {
        // the slow upload holds the only place, unless the next one comes first
        let mut slow = TcpStream::connect(server.address()).await.expect("it listens");
        slow.write_all(head.as_bytes()).await.expect("it reads");
        let next = server.post(path).multipart(Files::of("m", &scrap(2)).form()).send();
        let next = next.await.expect("an answer");
        if next.status() == StatusCode::SERVICE_UNAVAILABLE {
            assert!(next.headers().contains_key("retry-after"));
            break;
        }
        assert!(tokio::time::Instant::now() < deadline, "no upload is refused");
    }
}

#[tokio::test]
async fn sessions_are_made_by_hand_when_the_server_is_told_so() {
    let server = TestServer::start(&["--workers", "0", "--no-auto-create"]);
    let refused = problem(server.post(MAPS).multipart(Files::of("m", &scrap(1)).form())).await;
    assert_eq!(refused.code, ProblemCode::SessionNotFound);
    server.put("/v1/sessions/hall").send().await.expect("an answer");
    let (status, _) = server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    assert_eq!(status, StatusCode::CREATED);
    let clash = server
        .put("/v1/sessions/hall")
        .json(&serde_json::json!({ "title": "x" }));
    assert_eq!(problem(clash).await.code, ProblemCode::SessionExists);
}

#[tokio::test]
async fn a_request_keeps_the_id_that_its_caller_gave_it() {
    let server = TestServer::start(&["--workers", "0"]);
    let told = problem(server.get("/v1/nothing").header("x-request-id", "robot-7.push-3")).await;
    assert_eq!(told.request_id, "robot-7.push-3");
    let healthy = server.get("/livez").timeout(Duration::from_secs(5)).send().await;
    assert!(healthy.expect("an answer").headers().contains_key("x-request-id"));
}

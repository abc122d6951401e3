//! `mapweld keys` beside a running server, the rate of a key, and the log of changes.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use mapweld::api::ProblemCode;
use reqwest::{Client, StatusCode};
use serde_json::Value;

use super::command::{Folder, mapweld};
use super::rooms::{Files, scrap};
use super::server::{TestServer, problem};

/// What the command prints, without the line's end.
fn keys(data: &Path, arguments: &[&str]) -> String {
    let data = data.to_str().expect("a readable path");
    let done = mapweld(&[&["keys"], arguments, &["--data", data]].concat());
    let errors = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(done.status.success(), "{errors}");
    String::from_utf8(done.stdout).expect("UTF-8").trim_end().to_owned()
}

fn listed(data: &Path) -> Vec<Value> {
    let text = keys(data, &["list", "--json"]);
    text.lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect()
}

#[tokio::test]
async fn a_key_that_is_made_closes_a_running_server_and_one_that_is_revoked_opens_nothing() {
    let server = TestServer::start(&["--workers", "0"]);
    let status = |key: Option<String>| {
        let request = server.get("/v1/methods");
        let request = key.into_iter().fold(request, reqwest::RequestBuilder::bearer_auth);
        async { request.send().await.expect("an answer").status() }
    };
    assert_eq!(status(None).await, StatusCode::OK, "no key was ever made");
    let key = keys(
        server.folder(),
        &["create", "--scope", "read", "--name", "the dashboard"],
    );
    assert_eq!(status(None).await, StatusCode::UNAUTHORIZED);
    assert_eq!(status(Some(key.clone())).await, StatusCode::OK);

    let kept = listed(server.folder());
    let text = serde_json::to_string(&kept).expect("JSON");
    let (_, secret) = key.rsplit_once('_').expect("a secret");
    assert!(!text.contains(secret), "a list tells no secrets");
    assert_eq!(
        (kept[0]["name"].as_str(), kept[0]["standing"].as_str()),
        (Some("the dashboard"), Some("good"))
    );

    keys(server.folder(), &["revoke", kept[0]["id"].as_str().expect("an id")]);
    assert_eq!(status(Some(key)).await, StatusCode::UNAUTHORIZED);
    assert_eq!(
        status(None).await,
        StatusCode::UNAUTHORIZED,
        "once closed, always closed"
    );
    assert_eq!(listed(server.folder())[0]["standing"], "revoked");
}

#[test]
fn keys_that_make_no_sense_are_refused_by_field_and_limit() {
    let folder = Folder::new();
    let data = folder.path("data").display().to_string();
    let cases: [(&[&str], &str); 6] = [
        (&["create", "--scope", "owner"], "admin, operator, robot or read"),
        (&["create", "--scope", "robot", "--robot", "r1"], "session"),
        (&["create", "--scope", "read", "--session", "hall"], "session"),
        (&["create", "--scope", "read", "--name", "a\"b"], "1 to 64"),
        (&["create", "--scope", "read", "--expires-in", "0s"], "from 1s"),
        (&["revoke", "01939f3e-7a52-7c1e-b5e6-3d8f0f6f2a10"], "does not exist"),
    ];
    for (arguments, told) in cases {
        let refused = mapweld(&[&["keys"], arguments, &["--data", &data]].concat());
        let errors = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{arguments:?}: {errors}");
        assert!(errors.contains(told), "{arguments:?}: {errors}");
    }
}

#[tokio::test]
async fn a_key_that_asks_too_often_is_told_when_to_come_again_and_others_are_not_disturbed() {
    let server = TestServer::start(&["--workers", "0", "--key-rate", "1", "--key-burst", "3"]);
    let [greedy, modest] =
        ["greedy", "modest"].map(|name| keys(server.folder(), &["create", "--scope", "read", "--name", name]));
    let ask = |key: &str| server.get("/v1/methods").bearer_auth(key.to_owned());
    let mut refused = None;
    for _ in 0..20 {
        let answer = ask(&greedy).send().await.expect("an answer");
        if answer.status() == StatusCode::TOO_MANY_REQUESTS {
            refused = Some(answer);
            break;
        }
    }
    let refused = refused.expect("20 requests in a row are more than 1 a second");
    assert_eq!(refused.headers()["retry-after"], "1");
    let modest = ask(&modest).send().await.expect("an answer");
    assert_eq!(modest.status(), StatusCode::OK);
}

#[tokio::test]
async fn a_robot_pushes_with_its_key_and_waits_for_its_place() {
    let server = TestServer::start(&[]);
    let folder = Folder::new();
    let map = folder.map("m.yaml", &scrap(1));
    let robot = ["create", "--scope", "robot", "--session", "hall", "--robot", "r1"];
    let key = keys(server.folder(), &robot);
    let push = |robot: &str, key: &str| {
        let url = server.url("");
        let (robot, map, key) = (robot.to_owned(), map.clone(), key.to_owned());
        let pushed = move || {
            let arguments = [
                "push",
                &map,
                "--server",
                &url,
                "--session",
                "hall",
                "--robot",
                &robot,
                "--key",
                &key,
            ];
            mapweld(&[&arguments[..], &["--wait", "--retry-for", "30"]].concat())
        };
        tokio::task::spawn_blocking(pushed)
    };
    let pushed = push("r1", &key).await.expect("no panic");
    let told = String::from_utf8_lossy(&pushed.stdout).into_owned();
    assert!(
        told.contains("version 1: "),
        "{told} {}",
        String::from_utf8_lossy(&pushed.stderr)
    );
    let other = push("r2", &key).await.expect("no panic");
    assert_eq!(other.status.code(), Some(2), "a refusal is the caller's mistake");
    let told = String::from_utf8_lossy(&other.stderr).into_owned();
    assert!(told.contains("403") && told.contains("good for r1"), "{told}");
    let bad = push("r1", "mapweld_secret").await.expect("no panic");
    let told = String::from_utf8_lossy(&bad.stderr).into_owned();
    assert!(
        bad.status.code() == Some(2) && !told.contains("mapweld_secret"),
        "{told}"
    );
}

/// A server that writes its log, in full, to a file; killed when dropped.
struct Logging(Child);

impl Logging {
    fn start(data: &Path, log: &Path, listen: &str) -> (Self, String) {
        let mut child = Command::new(env!("CARGO_BIN_EXE_mapweld"))
            .args([
                "serve",
                "--listen",
                listen,
                "--log",
                "mapweld=trace",
                "--workers",
                "0",
                "--data",
            ])
            .arg(data)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(std::fs::File::create(log).expect("a file"))
            .spawn()
            .expect("the binary starts");
        let mut line = String::new();
        let stdout = child.stdout.take().expect("it is piped");
        BufReader::new(stdout).read_line(&mut line).expect("it can be read");
        let port = line.trim().rsplit(':').next().expect("a port").to_owned();
        (Self(child), format!("http://127.0.0.1:{port}"))
    }
}

impl Drop for Logging {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[tokio::test]
async fn every_change_leaves_a_line_that_says_who_did_what_and_no_secret() {
    let folder = Folder::new();
    let (data, log) = (folder.path("data"), folder.path("log"));
    let key = keys(&data, &["create", "--scope", "operator", "--name", "Anna"]);
    // beyond this machine, because there is a key
    let (_server, url) = Logging::start(&data, &log, "0.0.0.0:0");
    let http = Client::new();
    let put = |name: &str| http.put(format!("{url}/v1/sessions/{name}"));
    let made = put("hall")
        .bearer_auth(&key)
        .header("x-request-id", "put-1")
        .send()
        .await;
    assert_eq!(made.expect("an answer").status(), StatusCode::CREATED);
    let stranger = problem(put("yard")).await;
    assert_eq!(stranger.code, ProblemCode::Unauthorized);
    let wrong = format!("{}0", &key[..key.len() - 1]);
    let wrong = if wrong == key {
        format!("{}1", &key[..key.len() - 1])
    } else {
        wrong
    };
    let refused = problem(put("yard").bearer_auth(&wrong)).await;
    assert_eq!(refused.code, ProblemCode::Unauthorized);
    let push = http
        .post(format!("{url}/v1/sessions/hall/robots/r1/maps"))
        .bearer_auth(&key);
    let pushed = push.multipart(Files::of("m", &scrap(1)).form()).send().await;
    assert_eq!(pushed.expect("an answer").status(), StatusCode::CREATED);
    let delete = http.delete(format!("{url}/v1/sessions/hall")).bearer_auth(&key);
    assert_eq!(problem(delete).await.code, ProblemCode::Forbidden);

    let text = folder.text("log");
    let text = std::fs::read_to_string(text).expect("a log");
    let lines: Vec<&str> = text.lines().filter(|line| line.contains("mapweld::audit")).collect();
    assert_eq!(lines.len(), 5, "{text}");
    let says = |line: &str, words: &[&str]| {
        for word in words {
            assert!(line.contains(word), "{word} is missing in {line}");
        }
    };
    says(
        lines[0],
        &[
            "done",
            "Anna",
            "operator",
            "put_session",
            "/v1/sessions/hall",
            "201",
            "127.0.0.1",
            "put-1",
        ],
    );
    says(lines[1], &["refused", "nobody", "put_session", "401"]);
    says(lines[2], &["refused", "nobody", "401"]);
    says(
        lines[3],
        &["done", "Anna", "push_map", "201", "/v1/sessions/hall/maps/"],
    );
    says(lines[4], &["refused", "Anna", "delete_session", "403"]);
    for secret in [&key, &wrong] {
        let (_, secret) = secret.rsplit_once('_').expect("a secret");
        assert!(!text.contains(secret), "a secret in the log");
    }
}

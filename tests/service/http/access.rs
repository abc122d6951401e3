//! Who may do what: every operation of the served document, with keys of every kind.

use std::collections::BTreeSet;
use std::time::Duration;

use mapweld::api::{Page, Problem, ProblemCode};
use mapweld::model::{ApiKey, Scope, ShownKey, Timestamp};
use mapweld::store::{KeyStore, SqliteStore, Store};
use reqwest::{RequestBuilder, StatusCode};
use serde_json::Value;

use super::rooms::{Files, scrap};
use super::server::{TestServer, json, problem};
use crate::store_contract::new_key;

/// What a caller shows, and what comes of it.
struct Credential {
    name: &'static str,
    /// `Authorization`, if any.
    shown: Option<String>,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Kind {
    /// Not known, or not good any more.
    Refused,
    /// Good for what the document lists under this word.
    Scope(&'static str),
    /// A robot of this session and name.
    Robot(&'static str, &'static str),
}

/// What an operation is asked with: all in session `hall`, all of robot `r1`.
struct Targets {
    map: String,
    job: String,
    constraint: String,
}

pub(super) fn robots(session: &str, robot: &str) -> Scope {
    let (session, robot) = (session.parse().ok(), robot.parse().ok());
    Scope::parse("robot", session, robot).expect("a robot")
}

pub(super) async fn keep(store: &SqliteStore, scope: Scope, change: impl FnOnce(&mut ApiKey)) -> ShownKey {
    let (shown, mut key) = new_key(scope, Timestamp::UNIX_EPOCH);
    change(&mut key);
    store.add_key(&key).await.expect("is kept");
    shown
}

/// Keys of every kind, made beside the running server.
async fn credentials(server: &TestServer) -> Vec<Credential> {
    let store = SqliteStore::open_file_beside(&server.folder().join("mapweld.sqlite"))
        .await
        .expect("opens");
    let then = Timestamp::UNIX_EPOCH + Duration::from_secs(1);
    let bearer = |key: &ShownKey| Some(format!("Bearer {}", key.reveal()));
    let mut all = vec![Credential {
        name: "nobody",
        shown: None,
        kind: Kind::Refused,
    }];
    let good = [
        ("admin", Scope::Admin, Kind::Scope("admin")),
        ("operator", Scope::Operator, Kind::Scope("operator")),
        ("read", Scope::Read, Kind::Scope("read")),
        ("the robot", robots("hall", "r1"), Kind::Robot("hall", "r1")),
        ("another robot", robots("hall", "r2"), Kind::Robot("hall", "r2")),
        ("a robot elsewhere", robots("yard", "r1"), Kind::Robot("yard", "r1")),
    ];
    for (name, scope, kind) in good {
        let shown = bearer(&keep(&store, scope, |_| {}).await);
        all.push(Credential { name, shown, kind });
    }
    let admin = keep(&store, Scope::Admin, |_| {}).await;
    let bad = [
        (
            "expired",
            keep(&store, Scope::Admin, |key| key.expires_at = Some(then)).await,
        ),
        (
            "revoked",
            keep(&store, Scope::Admin, |key| key.revoked_at = Some(then)).await,
        ),
        ("unknown", new_key(Scope::Admin, then).0),
        ("a wrong secret", ShownKey::new(admin.id(), [7; 32])),
    ];
    all.extend(bad.into_iter().map(|(name, key)| Credential {
        name,
        shown: bearer(&key),
        kind: Kind::Refused,
    }));
    all.push(Credential {
        name: "nonsense",
        shown: Some("Bearer mapweld".to_owned()),
        kind: Kind::Refused,
    });
    store.close().await;
    all
}

/// `(method, path, operation)` of every operation of the served document.
async fn operations(server: &TestServer) -> Vec<(String, String, Value)> {
    let document: Value = server.read("/openapi.json").await;
    let paths = document["paths"].as_object().expect("paths").clone();
    let mut all = Vec::new();
    for (path, item) in paths {
        for (method, operation) in item.as_object().expect("methods").clone() {
            all.push((method.to_uppercase(), path.clone(), operation));
        }
    }
    all
}

fn id(operation: &Value) -> &str {
    operation["operationId"].as_str().expect("an id")
}

/// The words of the scopes that may; none when no key is needed.
fn words(operation: &Value) -> Option<Vec<&str>> {
    let needed = operation["security"].as_array().expect("security is declared");
    let words = needed.first()?["key"].as_array().expect("words of scopes");
    Some(words.iter().filter_map(Value::as_str).collect())
}

/// What the table of answers says, told apart from it by what stands in the path: `Ok` when the request passes.
fn expected(path: &str, operation: &Value, kind: &Kind) -> Result<(), ProblemCode> {
    let Some(words) = words(operation) else { return Ok(()) };
    let (session, robot) = match kind {
        Kind::Refused => return Err(ProblemCode::Unauthorized),
        Kind::Scope(word) if words.contains(word) => return Ok(()),
        Kind::Scope(_) => return Err(ProblemCode::Forbidden),
        Kind::Robot(..) if !words.contains(&"robot") => return Err(ProblemCode::Forbidden),
        Kind::Robot(session, robot) => (*session, *robot),
    };
    let about_the_robot = path.contains("{robot}") || id(operation) == "list_maps";
    if path.contains("{session}") && session != "hall" {
        Err(ProblemCode::Forbidden)
    } else if path.contains("{job}") && session != "hall" {
        Err(ProblemCode::JobNotFound)
    } else if path.contains("{map}") && robot != "r1" {
        Err(ProblemCode::MapNotFound)
    } else if about_the_robot && robot != "r1" {
        Err(ProblemCode::Forbidden)
    } else {
        Ok(())
    }
}

fn request(server: &TestServer, method: &str, path: &str, operation: &Value, targets: &Targets) -> RequestBuilder {
    let id = id(operation);
    // what is deleted is not needed any more
    let session = if method == "DELETE" { "gone" } else { "hall" };
    let path = path
        .replace("{session}", session)
        .replace("{robot}", "r1")
        .replace("{map}", &targets.map)
        .replace("{job}", &targets.job)
        .replace("{constraint}", &targets.constraint)
        .replace("{version}", "1");
    let request = server.request(method, &path);
    match id {
        "list_maps" => request.query(&[("robot", "r1")]),
        "push_map" => request.multipart(Files::of("m", &scrap(1)).form()),
        _ => request,
    }
}

#[tokio::test]
async fn every_route_answers_every_kind_of_key_as_the_table_says() {
    // the last push fails where the queue has no room, so that merging takes as long as it takes
    let server = TestServer::start(&["--key-rate", "0"]);
    let (_, pushed) = server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    server.push("hall", "r2", &Files::of("m", &scrap(2))).await;
    server.push("yard", "r1", &Files::of("m", &scrap(3))).await;
    let job = pushed.job.expect("a job");
    server.ended(job).await;
    let apart = serde_json::json!({ "rule": { "apart": { "robots": ["r1", "r2"] } } });
    let constraint = server.post("/v1/sessions/hall/constraints").json(&apart).send().await;
    let constraint: Value = json(constraint.expect("an answer")).await;
    let targets = Targets {
        map: pushed.map.id.to_string(),
        job: job.to_string(),
        constraint: constraint["id"].as_str().expect("an id").to_owned(),
    };
    let operations = operations(&server).await;
    let credentials = credentials(&server).await;
    assert!(operations.len() >= 30, "found only {}", operations.len());
    let mut answers = 0;
    for (method, path, operation) in &operations {
        for Credential { name, shown, kind } in &credentials {
            let mut request = request(&server, method, path, operation, &targets);
            if let Some(shown) = shown {
                request = request.header("authorization", shown);
            }
            let answer = request.send().await.expect("an answer");
            let status = answer.status();
            let told = format!("{method} {path} by {name}: {status}");
            match expected(path, operation, kind) {
                Ok(()) if method == "GET" => assert!(status.is_success(), "{told}"),
                Ok(()) => {
                    let refused = [StatusCode::UNAUTHORIZED, StatusCode::FORBIDDEN];
                    assert!(!refused.contains(&status) && !status.is_server_error(), "{told}");
                }
                Err(code) => {
                    let headers = answer.headers().clone();
                    let problem: Problem = answer.json().await.expect("a problem");
                    assert_eq!((problem.code, status.as_u16()), (code, code.status()), "{told}");
                    let challenged = headers.contains_key("www-authenticate");
                    assert_eq!(challenged, code == ProblemCode::Unauthorized, "{told}");
                }
            }
            answers += 1;
        }
    }
    assert_eq!(answers, operations.len() * credentials.len());

    let admin = credentials.iter().find(|credential| credential.name == "admin");
    let admin = admin.and_then(|admin| admin.shown.clone()).expect("a key");
    let maps = server
        .get("/v1/sessions/hall/maps")
        .header("authorization", admin)
        .send();
    let maps: Page<Value> = json(maps.await.expect("an answer")).await;
    assert_eq!(maps.items.len(), 2, "nobody has pushed in another's name");
}

#[tokio::test]
async fn the_table_gives_to_each_scope_what_it_is_for_and_no_more() {
    let server = TestServer::start(&["--workers", "0"]);
    let operations = operations(&server).await;
    let of = |word: &str| -> BTreeSet<String> {
        let may = |operation: &&(String, String, Value)| words(&operation.2).is_some_and(|words| words.contains(&word));
        operations
            .iter()
            .filter(may)
            .map(|(.., operation)| id(operation).to_owned())
            .collect()
    };
    let open: BTreeSet<&str> = operations
        .iter()
        .filter(|(.., operation)| words(operation).is_none())
        .map(|(.., operation)| id(operation))
        .collect();
    assert_eq!(open, BTreeSet::from(["livez", "readyz"]));
    for (method, path, operation) in &operations {
        if method != "GET" {
            assert!(!of("read").contains(id(operation)), "{method} {path} changes something");
        }
        assert!(
            open.contains(id(operation)) || of("admin").contains(id(operation)),
            "{path}"
        );
    }
    let robots_may_change: BTreeSet<String> = of("robot").difference(&of("read")).cloned().collect();
    assert_eq!(robots_may_change, BTreeSet::from(["push_map".to_owned()]));
    for other in ["list_sessions", "list_robots", "list_merges"] {
        assert!(!of("robot").contains(other), "{other} tells of others");
    }
    let only_admin: BTreeSet<String> = of("admin").difference(&of("operator")).cloned().collect();
    assert_eq!(only_admin, BTreeSet::from(["delete_session".to_owned()]));
}

#[tokio::test]
async fn a_list_of_maps_is_a_robots_own_only_when_it_asks_for_its_own() {
    let server = TestServer::start(&["--workers", "0"]);
    let store = SqliteStore::open_file_beside(&server.folder().join("mapweld.sqlite"))
        .await
        .expect("opens");
    let key = keep(&store, robots("hall", "r1"), |_| {}).await;
    let maps = |query: &str| {
        let path = format!("/v1/sessions/hall/maps{query}");
        server.get(&path).bearer_auth(key.reveal())
    };
    for query in ["", "?robot=r2", "?robot=r1&robot=r2", "?robots=r1"] {
        let refused = problem(maps(query)).await;
        assert_eq!(refused.code, ProblemCode::Forbidden, "{query}");
        assert_eq!(refused.errors[0].field, "robot");
    }
    // the session is there from its first push on
    let path = "/v1/sessions/hall/robots/r1/maps";
    let pushed = server.post(path).bearer_auth(key.reveal());
    let pushed = pushed.multipart(Files::of("m", &scrap(1)).form()).send().await;
    assert_eq!(pushed.expect("an answer").status(), StatusCode::CREATED);
    let own: Page<Value> = json(maps("?robot=r1").send().await.expect("an answer")).await;
    assert_eq!(own.items.len(), 1);
}

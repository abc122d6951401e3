//! Bytes on their way: digests in both directions, parts of files, HEAD, and lists that are cut and filtered.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use mapweld::api::{Page, ProblemCode, Robot, Session};
use mapweld::model::{Digest, JobState};
use reqwest::StatusCode;
use serde_json::json;

use super::rooms::{Files, scrap};
use super::server::{TestServer, problem};

fn told(bytes: &[u8]) -> String {
    format!("sha-256=:{}:", STANDARD.encode(Digest::of_bytes(bytes).as_bytes()))
}

#[tokio::test]
async fn files_come_with_their_digests_whole_and_in_parts_and_head_tells_the_same() {
    let server = TestServer::start(&[]);
    let (_, pushed) = server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    let job = server.ended(pushed.job.expect("a job")).await;
    assert_eq!(job.state, JobState::Succeeded);
    let base = "/v1/sessions/hall/versions/latest";
    let mut paths: Vec<String> = [
        "",
        "/map.png",
        "/map.pgm",
        "/map.yaml",
        "/map.zip",
        "/overlay.png",
        "/transforms",
    ]
    .iter()
    .map(|file| format!("{base}{file}"))
    .collect();
    paths.push(format!("{base}/occupancy_grid.json"));
    paths.push(format!("/v1/sessions/hall/maps/{}.png", pushed.map.id));
    for path in &paths {
        let whole = server.get(path).send().await.expect("an answer");
        let headers = whole.headers().clone();
        let bytes = whole.bytes().await.expect("a body");
        assert_eq!(headers["repr-digest"], told(&bytes).as_str(), "{path}");
        assert_eq!(headers["content-digest"], told(&bytes).as_str(), "{path}");

        let part = server
            .get(path)
            .header("range", "bytes=2-5")
            .send()
            .await
            .expect("an answer");
        assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT, "{path}");
        assert_eq!(
            part.headers()["content-range"],
            format!("bytes 2-5/{}", bytes.len()).as_str()
        );
        assert_eq!(part.headers()["repr-digest"], told(&bytes).as_str(), "{path}");
        assert_eq!(part.headers()["content-digest"], told(&bytes[2..=5]).as_str(), "{path}");
        assert_eq!(part.bytes().await.expect("a part"), bytes.slice(2..=5));

        let beyond = format!("bytes={}-", bytes.len());
        let outside = problem(server.get(path).header("range", &beyond)).await;
        assert_eq!(outside.code, ProblemCode::RangeNotSatisfiable, "{path}");
        assert_eq!(outside.errors[0].field, "range");

        let head = server.request("HEAD", path).send().await.expect("an answer");
        assert_eq!(head.status(), StatusCode::OK, "{path}");
        for name in ["etag", "content-type", "content-length", "repr-digest", "accept-ranges"] {
            assert_eq!(head.headers().get(name), headers.get(name), "{path}: {name}");
        }
        assert!(head.bytes().await.expect("no body").is_empty());
        let known = server
            .request("HEAD", path)
            .header("if-none-match", &headers["etag"])
            .send()
            .await;
        assert_eq!(known.expect("an answer").status(), StatusCode::NOT_MODIFIED, "{path}");
    }
}

#[tokio::test]
async fn a_body_that_was_damaged_on_its_way_is_refused_and_nothing_is_kept() {
    let server = TestServer::start(&["--workers", "0"]);
    let files = Files::of("m", &scrap(1));
    let upload = |name: &'static str, digest: String| {
        server
            .post("/v1/sessions/hall/robots/r1/maps?resolution=0.05&origin=0,0,0")
            .header("content-type", "image/x-portable-graymap")
            .header(name, digest)
            .body(files.image.clone())
    };
    let wrong = told(b"something else");
    for name in ["content-digest", "repr-digest"] {
        let refused = problem(upload(name, wrong.clone())).await;
        assert_eq!((refused.code, refused.status), (ProblemCode::DigestMismatch, 400));
        let error = &refused.errors[0];
        assert_eq!(
            (error.field.as_str(), error.value.as_deref()),
            (name, Some(wrong.as_str()))
        );
        assert_eq!(error.limit.as_deref(), Some(told(&files.image).as_str()));
    }
    let refused = problem(upload("content-digest", "sha-256=nonsense".to_owned())).await;
    assert_eq!(
        (refused.code, refused.errors[0].field.as_str()),
        (ProblemCode::BadRequest, "content-digest")
    );
    assert_eq!(
        problem(server.get("/v1/sessions/hall")).await.code,
        ProblemCode::SessionNotFound
    );
    let kept = upload("content-digest", told(&files.image))
        .send()
        .await
        .expect("an answer");
    assert_eq!(kept.status(), StatusCode::CREATED);

    let settings = serde_json::to_vec(&json!({ "title": "Ward" })).expect("JSON");
    let put = |digest: String| {
        let request = server
            .put("/v1/sessions/ward")
            .header("content-type", "application/json");
        request.header("content-digest", digest).body(settings.clone())
    };
    assert_eq!(problem(put(wrong)).await.code, ProblemCode::DigestMismatch);
    assert_eq!(
        put(told(&settings)).send().await.expect("an answer").status(),
        StatusCode::CREATED
    );
}

#[tokio::test]
async fn sessions_are_listed_by_label_and_robots_in_pages() {
    let server = TestServer::start(&["--workers", "0"]);
    for (name, labels) in [
        ("a", json!({ "floor": "2", "site": "north" })),
        ("b", json!({ "floor": "3", "site": "north" })),
        ("c", json!({})),
    ] {
        let path = format!("/v1/sessions/{name}");
        let made = server.put(&path).json(&json!({ "labels": labels })).send().await;
        assert_eq!(made.expect("an answer").status(), StatusCode::CREATED);
    }
    let names = async |query: &str| {
        let page: Page<Session> = server.read(&format!("/v1/sessions?{query}")).await;
        let names: Vec<String> = page.items.iter().map(|session| session.id.to_string()).collect();
        (names, page.next_page_token)
    };
    assert_eq!(names("label=floor%3D2").await.0, ["a"]);
    assert_eq!(names("label=site=north&label=floor=3").await.0, ["b"]);
    let (first, token) = names("label=floor&page_size=1").await;
    assert_eq!((first, token.as_deref()), (vec!["a".to_owned()], Some("a")));
    assert_eq!(
        names("label=floor&page_size=1&page_token=a").await,
        (vec!["b".to_owned()], None)
    );
    assert_eq!(names("label=floor=9").await.0, [""; 0]);
    for bad in ["label=", "label==2", "label=a=1&label=a=2"] {
        let refused = problem(server.get(&format!("/v1/sessions?{bad}"))).await;
        assert_eq!(
            (refused.code, refused.errors[0].field.as_str()),
            (ProblemCode::InvalidRequest, "label"),
            "{bad}"
        );
    }
    assert_eq!(
        problem(server.get("/v1/sessions?colour=red")).await.code,
        ProblemCode::InvalidQuery
    );

    for (seed, robot) in ["r1", "r2", "r3"].iter().enumerate() {
        let seed = u32::try_from(seed).expect("few") + 1;
        server.push("a", robot, &Files::of("m", &scrap(seed))).await;
    }
    let page: Page<Robot> = server.read("/v1/sessions/a/robots?page_size=2").await;
    let token = page.next_page_token.expect("one more page");
    assert_eq!(page.items.len(), 2);
    let rest: Page<Robot> = server
        .read(&format!("/v1/sessions/a/robots?page_size=2&page_token={token}"))
        .await;
    assert_eq!(
        rest.items.iter().map(|robot| robot.robot.as_str()).collect::<Vec<_>>(),
        ["r3"]
    );
    assert_eq!(rest.next_page_token, None);
}

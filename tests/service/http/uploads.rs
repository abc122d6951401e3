//! Maps in, in each of the three ways, and back.

use mapweld::api::{Map, Page, Robot, Session};
use mapweld::codec::{encode_occupancy_grid, encode_png};
use reqwest::StatusCode;

use super::rooms::{Files, scrap};
use super::server::{TestServer, json};

#[tokio::test]
async fn one_map_sent_in_three_forms_is_one_map() {
    let server = TestServer::start(&["--workers", "0"]);
    let grid = scrap(0b1011);
    let (status, first) = server.push("hall", "r1", &Files::of("r1", &grid)).await;
    assert_eq!((status, first.created), (StatusCode::CREATED, true));
    assert_eq!(
        (first.map.width, first.map.height, first.map.counts.occupied),
        (24, 16, 3)
    );

    let path = "/v1/sessions/hall/robots/r1/maps";
    let raw = server
        .post(&format!("{path}?resolution=0.05&origin=0,0,0"))
        .header("content-type", "image/png")
        .body(encode_png(&grid));
    let message = server
        .post(path)
        .header("content-type", "application/json")
        .body(encode_occupancy_grid(&grid, "r1/map"));
    let png_form = server.post(path).multipart(Files::with_png("r1", &grid).form());
    for again in [raw, message, png_form] {
        let answer = again.send().await.expect("an answer");
        assert_eq!(answer.status(), StatusCode::OK);
        assert_eq!(
            answer.headers()["location"],
            format!("/v1/sessions/hall/maps/{}", first.map.id)
        );
        let again: mapweld::api::Pushed = json(answer).await;
        assert_eq!(
            (again.created, again.map.id, again.job),
            (false, first.map.id, first.job)
        );
    }
    let jobs: Page<serde_json::Value> = server.read("/v1/sessions/hall/merges").await;
    assert_eq!(jobs.items.len(), 1, "what is known already causes no job");
}

#[tokio::test]
async fn a_map_is_read_back_with_what_is_known_of_it_and_as_a_picture() {
    let server = TestServer::start(&["--workers", "0"]);
    let grid = scrap(5);
    let (_, pushed) = server.push("hall", "r1", &Files::of("r1", &grid)).await;
    let path = format!("/v1/sessions/hall/maps/{}", pushed.map.id);
    assert_eq!(server.read::<Map>(&path).await, pushed.map);

    let picture = server.get(&format!("{path}.png")).send().await.expect("an answer");
    assert_eq!(picture.headers()["content-type"], "image/png");
    let tag = picture.headers()["etag"].clone();
    assert_eq!(picture.bytes().await.expect("a picture"), encode_png(&grid));
    let known = server
        .get(&format!("{path}.png"))
        .header("if-none-match", &tag)
        .send()
        .await
        .expect("an answer");
    assert_eq!(known.status(), StatusCode::NOT_MODIFIED);
    assert_eq!(known.headers()["etag"], tag);
}

#[tokio::test]
async fn a_first_map_makes_its_session_and_its_robot_the_anchor() {
    let server = TestServer::start(&["--workers", "0"]);
    for seed in 1..=3 {
        server.push("hall", "r2", &Files::of("m", &scrap(seed))).await;
    }
    server.push("hall", "r1", &Files::of("m", &scrap(9))).await;
    let session: Session = server.read("/v1/sessions/hall").await;
    assert_eq!(session.anchor.map(|robot| robot.to_string()), Some("r2".to_owned()));
    let robots: Page<Robot> = server.read("/v1/sessions/hall/robots").await;
    let counts: Vec<_> = robots
        .items
        .iter()
        .map(|robot| (robot.robot.as_str(), robot.maps))
        .collect();
    assert_eq!(counts, [("r1", 1), ("r2", 3)]);
}

#[tokio::test]
async fn lists_come_in_pages_the_newest_map_first() {
    let server = TestServer::start(&["--workers", "0"]);
    for seed in 1..=5 {
        server.push("hall", "r1", &Files::of("m", &scrap(seed))).await;
    }
    let mut sequences = Vec::new();
    let mut path = "/v1/sessions/hall/maps?robot=r1&page_size=2".to_owned();
    loop {
        let page: Page<Map> = server.read(&path).await;
        sequences.extend(page.items.iter().map(|map| map.sequence));
        let Some(token) = page.next_page_token else { break };
        path = format!("/v1/sessions/hall/maps?robot=r1&page_size=2&page_token={token}");
    }
    assert_eq!(sequences, [5, 4, 3, 2, 1]);
}

#[tokio::test]
async fn a_session_can_be_made_changed_listed_and_deleted() {
    let server = TestServer::start(&["--workers", "0"]);
    let settings = serde_json::json!({ "title": "Hall", "auto_merge": false });
    for status in [StatusCode::CREATED, StatusCode::OK] {
        let made = server.put("/v1/sessions/hall").json(&settings).send().await;
        assert_eq!(made.expect("an answer").status(), status);
    }
    let (_, pushed) = server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    assert_eq!(pushed.job, None, "this session does not merge by itself");
    let patch = serde_json::json!({ "title": null, "resolution": 0.1 });
    let patched = server.request("PATCH", "/v1/sessions/hall").json(&patch).send().await;
    let session: Session = json(patched.expect("an answer")).await;
    assert_eq!((session.title, session.auto_merge), (None, false));
    let made: Session = json(server.post("/v1/sessions").send().await.expect("an answer")).await;
    let all: Page<Session> = server.read("/v1/sessions").await;
    assert_eq!(all.items.len(), 2);
    for session in ["hall", made.id.as_str()] {
        let address = format!("/v1/sessions/{session}");
        let deleted = server.request("DELETE", &address).send().await.expect("an answer");
        assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
        assert_eq!(
            server.get(&address).send().await.expect("an answer").status(),
            StatusCode::NOT_FOUND
        );
    }
}

//! From maps to a version, and all that it is served as.

use mapweld::api::{MergeResult, Page, PlacementStatus, Transforms, Version, VersionSummary};
use mapweld::codec::{Limits, MapYaml, decode_map, decode_occupancy_grid};
use mapweld::model::{Digest, JobState};
use reqwest::StatusCode;

use super::rooms::{Files, three_robots};
use super::server::{TestServer, json};

async fn bytes(server: &TestServer, path: &str) -> Vec<u8> {
    let answer = server.get(path).send().await.expect("an answer");
    assert_eq!(answer.status(), StatusCode::OK, "{path}");
    answer.bytes().await.expect("a body").to_vec()
}

#[tokio::test]
async fn three_robots_maps_become_a_version_that_tells_where_each_one_lies() {
    let server = TestServer::start(&[]);
    let (maps, truth) = three_robots();
    for (name, map) in ["a", "b", "c"].iter().zip(&maps) {
        let (_, pushed) = server.push("hall", name, &Files::of(name, map)).await;
        let job = server.ended(pushed.job.expect("a job")).await;
        assert_eq!(job.state, JobState::Succeeded, "{job:?}");
    }
    let versions: Page<VersionSummary> = server.read("/v1/sessions/hall/versions").await;
    let numbers: Vec<u32> = versions.items.iter().map(|version| version.number.get()).collect();
    assert!(
        numbers.is_sorted_by(|a, b| a == &(b + 1)),
        "newest first, no gaps: {numbers:?}"
    );

    let base = "/v1/sessions/hall/versions/latest";
    let version: Version = server.read(base).await;
    assert_eq!(version.inputs.len(), 3);
    let result: MergeResult = version.result.read().expect("a result");
    assert_eq!((result.anchor.as_str(), result.placed()), ("a", 3), "{result:?}");
    for (placement, truth) in result.maps.iter().zip(&truth) {
        assert_eq!(placement.status, PlacementStatus::Placed);
        let pose = placement.pose.and_then(mapweld::api::Pose::to_pose2).expect("a pose");
        let error = truth.inverse() * pose;
        assert!(
            error.translation()[0].hypot(error.translation()[1]) < 0.15 && error.yaw().magnitude() < 0.02,
            "{}: {pose:?} instead of {truth:?}",
            placement.name
        );
    }

    let transforms: Transforms = server.read(&format!("{base}/transforms")).await;
    let frames: Vec<_> = transforms
        .transforms
        .iter()
        .map(|transform| (transform.header.frame_id.as_str(), transform.child_frame_id.as_str()))
        .collect();
    assert_eq!(frames, [("a/map", "b/map"), ("a/map", "c/map")]);
    files_agree(&server, base, &result, version.digest).await;
    tags_hold(&server, base).await;
}

/// Whatever form the fused map is fetched in, it is the same map.
async fn files_agree(server: &TestServer, base: &str, result: &MergeResult, digest: Digest) {
    assert_eq!(result.fused.digest, digest);
    let limits = Limits::default();
    let yaml = bytes(server, &format!("{base}/map.yaml")).await;
    assert_eq!(MapYaml::parse(&yaml, &limits).expect("a map file").image, "map.png");
    let png = bytes(server, &format!("{base}/map.png")).await;
    let from_png = decode_map(&yaml, &png, &limits).expect("a map").grid;
    let yaml = bytes(server, &format!("{base}/map.yaml?image=map.pgm")).await;
    assert_eq!(MapYaml::parse(&yaml, &limits).expect("a map file").image, "map.pgm");
    let pgm = bytes(server, &format!("{base}/map.pgm")).await;
    let from_pgm = decode_map(&yaml, &pgm, &limits).expect("a map").grid;
    assert_eq!(from_png, from_pgm);
    let message = bytes(server, &format!("{base}/occupancy_grid.json")).await;
    let from_message = decode_occupancy_grid(&message, &limits).expect("a map");
    for grid in [&from_png, &from_message] {
        let counts = grid.state_counts();
        assert_eq!(counts.occupied, result.fused.counts.occupied);
        assert_eq!(counts.free, result.fused.counts.free);
        assert_eq!(grid.lattice().origin().x().to_bits(), result.fused.origin.x.to_bits());
    }
    let zip = bytes(server, &format!("{base}/map.zip")).await;
    assert!(zip.starts_with(b"PK\x03\x04") && zip.windows(png.len()).any(|window| window == png));
    let overlay = bytes(server, &format!("{base}/overlay.png")).await;
    assert!(overlay.starts_with(b"\x89PNG"));
}

async fn tags_hold(server: &TestServer, base: &str) {
    let files = [
        "",
        "/map.png",
        "/map.pgm",
        "/map.yaml",
        "/map.zip",
        "/occupancy_grid.json",
        "/overlay.png",
        "/transforms",
    ];
    for file in files {
        let path = format!("{base}{file}");
        let answer = server.get(&path).send().await.expect("an answer");
        let tag = answer.headers()["etag"].clone();
        let known = server.get(&path).header("if-none-match", &tag).send().await;
        assert_eq!(known.expect("an answer").status(), StatusCode::NOT_MODIFIED, "{path}");
        let part = server
            .get(&path)
            .header("range", "bytes=1-4")
            .send()
            .await
            .expect("an answer");
        assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT, "{path}");
        assert_eq!(part.bytes().await.expect("a part").len(), 4);
    }
}

#[tokio::test]
async fn a_session_with_a_robot_that_fits_nowhere_says_so() {
    let server = TestServer::start(&[]);
    let ([a, ..], _) = three_robots();
    let (_, first) = server.push("hall", "a", &Files::of("a", &a)).await;
    server.ended(first.job.expect("a job")).await;
    let (_, second) = server
        .push("hall", "lost", &Files::of("lost", &super::rooms::scrap(3)))
        .await;
    server.ended(second.job.expect("a job")).await;
    let version: Version = json(
        server
            .get("/v1/sessions/hall/versions/latest")
            .send()
            .await
            .expect("an answer"),
    )
    .await;
    let result: MergeResult = version.result.read().expect("a result");
    let lost = &result.maps[1];
    assert_eq!((lost.name.as_str(), lost.status), ("lost", PlacementStatus::NotPlaced));
    let reason = lost.reason.as_ref().expect("a reason");
    assert!(!reason.message.is_empty(), "{reason:?}");
}

//! Fleets that grow: all robots of one session are merged to one version; the time and the memory that it takes.
//!
//! Short among the other tests; `MAPWELD_ROBOTS=32` in full: 2, 4, 8 ... robots, up to so many.

#![expect(clippy::cast_precision_loss, reason = "figures that are told")]

use std::time::Instant;

use mapweld::api::{Job, MergeResult, PlacementStatus, Version};
use mapweld::geometry::Pose2;
use mapweld::model::JobState;
use mapweld::simulation::{Fleet, FleetRequest, WorldKind, generate_fleet};
use serde_json::{Value, json};

use super::rooms::Files;
use super::server::{TestServer, json as read_json};
use crate::survival::{full_form, tell};

/// Longest time for the merge of the largest fleet.
const MERGE_SECONDS_MAX: u64 = 3600;

/// A placement farther from the truth than this is wrong, in metres.
const WRONG_FROM: f64 = 0.5;

fn fleet(robots: usize) -> Fleet {
    let request = FleetRequest {
        seed: 5,
        kind: WorldKind::Office,
        number: 1,
        robots,
        strangers: 0,
        snapshots: 1,
    };
    generate_fleet(&request).expect("a building with room for them")
}

/// What one fleet came to.
struct Figures {
    placed: usize,
    worst_metres: f64,
    seconds: f64,
    peak: u64,
    cells: u64,
}

async fn merged(fleet: &Fleet) -> Figures {
    let server = TestServer::start(&["--workers", "1", "--job-deadline", "1h"]);
    let session = server.put("/v1/sessions/fleet").json(&json!({ "auto_merge": false }));
    assert!(session.send().await.expect("an answer").status().is_success());
    let mut cells = 0;
    for (number, robot) in fleet.robots.iter().enumerate() {
        let map = robot.maps.last().expect("a map of each robot");
        cells += map.lattice().cell_count() as u64;
        let name = format!("r{number:02}");
        let (status, _) = server.push("fleet", &name, &Files::with_png(&name, map)).await;
        assert_eq!(status.as_u16(), 201);
    }
    let began = Instant::now();
    let job: Job = read_json(
        server
            .post("/v1/sessions/fleet/merges")
            .send()
            .await
            .expect("an answer"),
    )
    .await;
    let job = loop {
        let job: Job = server.read(&format!("/v1/jobs/{}?wait=30", job.id)).await;
        assert!(
            began.elapsed().as_secs() < MERGE_SECONDS_MAX,
            "the merge does not end: {job:?}"
        );
        if job.state.is_terminal() {
            break job;
        }
    };
    let seconds = began.elapsed().as_secs_f64();
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
    let versions: Value = server.read("/v1/sessions/fleet/versions").await;
    assert_eq!(versions["items"].as_array().map(Vec::len), Some(1), "one version");
    let version: Version = server.read("/v1/sessions/fleet/versions/1").await;
    let (placed, worst_metres) = placed(fleet, &version);
    Figures {
        placed,
        worst_metres,
        seconds,
        peak: server.peak_memory(),
        cells,
    }
}

/// How many robots are placed, and how far the worst of them is from where it was, in metres.
fn placed(fleet: &Fleet, version: &Version) -> (usize, f64) {
    let result: MergeResult = version.result.read().expect("our own document");
    let maps = &result.maps;
    assert_eq!(maps.len(), fleet.robots.len(), "each robot is told of");
    let truth = |name: &str| -> Pose2 {
        let number: usize = name.trim_start_matches('r').parse().expect("rNN");
        fleet.robots[number].pose_world_map.expect("a robot of this building")
    };
    let pose_anchor_world = truth(version.anchor.as_str()).inverse();
    let mut worst = 0.0_f64;
    let mut count = 0;
    for map in maps {
        if map.status == PlacementStatus::NotPlaced {
            assert!(map.reason.is_some(), "{} is not placed without a reason", map.name);
            continue;
        }
        count += 1;
        let pose = map.pose.expect("a placed map has a pose");
        let expected = pose_anchor_world * truth(&map.name);
        worst = worst.max((pose.x - expected.x()).hypot(pose.y - expected.y()));
    }
    (count, worst)
}

#[tokio::test]
async fn fleets_of_growing_size_merge_to_one_version() {
    let most = full_form("MAPWELD_ROBOTS", 4);
    let sizes = std::iter::successors(Some(2), |robots| Some(robots * 2)).take_while(|robots| *robots <= most);
    for robots in sizes {
        let fleet = fleet(robots);
        let figures = merged(&fleet).await;
        tell(&format!(
            "{robots} robots, {:.1} million cells: {} placed, the worst {:.3} m off, {:.1} s, peak memory {} MB",
            figures.cells as f64 / 1e6,
            figures.placed,
            figures.worst_metres,
            figures.seconds,
            figures.peak / 1_000_000,
        ));
        assert!(figures.placed * 2 > robots, "most robots are placed");
        assert!(figures.worst_metres < WRONG_FROM, "a robot is placed wrongly");
    }
}

//! A map as large as the largest that users of `map_server` have told of: taken in when the limits allow it, and
//! merged with itself moved; with the memory that it takes.
//!
//! A smaller one among the other tests; `MAPWELD_LARGE=1` for the full 20768 x 13612 cells.

#![expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "cells of one map, and figures that are told"
)]

use std::io::Write as _;
use std::time::Instant;

use mapweld::api::{Job, MergeResult, PlacementStatus, Version};
use mapweld::geometry::{Angle, Pose2};
use mapweld::model::JobState;
use serde_json::json;

use super::server::{TestServer, json as read_json};
use crate::survival::{Dice, full_form, tell};

/// Longest time for the merge.
const MERGE_SECONDS_MAX: u64 = 3600;

const RESOLUTION: f64 = 0.05;

const UNKNOWN: u8 = 205;
const FREE: u8 = 254;
const WALL: u8 = 0;

/// The walls of a room: its middle and half sides in metres, which way it is turned, and the middle of the gap in its lower wall as a
/// share of the wall.
struct Walls {
    pose_world_room: Pose2,
    half: [f64; 2],
    gap: f64,
}

/// Rooms of all sizes and directions along the streets of a site of this size, no two alike.
fn site(metres: [f64; 2]) -> Vec<Walls> {
    const STREETS: f64 = 24.0;
    let mut dice = Dice::new(20_768);
    let mut uniform = |low: f64, high: f64| low + (high - low) * (dice.below(1 << 20) as f64 / f64::from(1 << 20));
    let mut rooms = Vec::new();
    let mut y = STREETS / 2.0;
    while y < metres[1] {
        let mut x = STREETS / 2.0;
        while x < metres[0] {
            let turned = Angle::from_degrees(uniform(-30.0, 30.0));
            rooms.push(Walls {
                pose_world_room: Pose2::new(x + uniform(-3.0, 3.0), y + uniform(-3.0, 3.0), turned),
                half: [uniform(3.0, 9.0), uniform(2.0, 7.0)],
                gap: uniform(-0.7, 0.7),
            });
            x += STREETS;
        }
        y += STREETS;
    }
    rooms
}

/// What a robot has drawn, row 0 the lowest: all that nobody has seen unknown.
struct Sheet {
    width: u32,
    height: u32,
    cells: Vec<u8>,
}

impl Sheet {
    /// The site in a map whose frame lies so in the world; the lower-left corner of the map is the frame's origin.
    fn draw(width: u32, height: u32, rooms: &[Walls], pose_world_map: Pose2) -> Self {
        let cells = vec![UNKNOWN; width as usize * height as usize];
        let mut sheet = Self { width, height, cells };
        for room in rooms {
            sheet.room(room, pose_world_map.inverse() * room.pose_world_room);
        }
        sheet
    }

    fn room(&mut self, room: &Walls, pose_map_room: Pose2) {
        /// What is seen of the street around a room, in metres.
        const AROUND: f64 = 2.0;
        /// Half of the thickness of a wall, in metres.
        const THICK: f64 = 0.1;
        let reach = room.half[0].hypot(room.half[1]) + AROUND;
        let cell_of = |metres: f64, most: u32| (metres / RESOLUTION).clamp(0.0, f64::from(most)) as u32;
        let (x, y) = (pose_map_room.x(), pose_map_room.y());
        let pose_room_map = pose_map_room.inverse();
        for row in cell_of(y - reach, self.height)..cell_of(y + reach, self.height) {
            for column in cell_of(x - reach, self.width)..cell_of(x + reach, self.width) {
                let middle = [column, row].map(|index| (f64::from(index) + 0.5) * RESOLUTION);
                let [u, v] = pose_room_map.apply(middle);
                let outside = [u.abs() - room.half[0], v.abs() - room.half[1]];
                let depth = outside[0].max(outside[1]);
                if depth > AROUND {
                    continue;
                }
                let in_gap = v < 0.0 && (u / room.half[0] - room.gap).abs() < 0.15 && outside[0] < -THICK;
                let cell = &mut self.cells[row as usize * self.width as usize + column as usize];
                if depth.abs() < THICK && !in_gap {
                    *cell = WALL;
                } else if *cell == UNKNOWN {
                    *cell = FREE;
                }
            }
        }
    }

    /// As an 8-bit grey PNG.
    fn png(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_compression(png::Compression::Balanced);
        let mut writer = encoder.write_header().expect("a header");
        let mut stream = writer.stream_writer().expect("a stream");
        for row in self.cells.chunks_exact(self.width as usize).rev() {
            stream.write_all(row).expect("a vector takes it");
        }
        stream.finish().expect("a picture");
        writer.finish().expect("a picture");
        bytes
    }
}

#[tokio::test]
async fn a_vast_map_is_taken_and_merged_with_itself_moved() {
    let full = full_form("MAPWELD_LARGE", 0) > 0;
    let (width, height) = if full { (20_768, 13_612) } else { (2_600, 1_700) };
    let cells = u64::from(width) * u64::from(height);
    let rooms = site([f64::from(width) * RESOLUTION, f64::from(height) * RESOLUTION]);
    let moved = Pose2::new(3.2, -1.7, Angle::from_degrees(4.0));
    let limit = (4 * cells).to_string();
    let server = TestServer::start(&[
        "--workers",
        "1",
        "--max-cells",
        &limit,
        "--job-deadline",
        "1h",
        "--body-time",
        "10m",
    ]);
    let session = server.put("/v1/sessions/site").json(&json!({ "auto_merge": false }));
    assert!(session.send().await.expect("an answer").status().is_success());
    let began = Instant::now();
    for (robot, pose) in [("a", Pose2::IDENTITY), ("b", moved)] {
        let picture = Sheet::draw(width, height, &rooms, pose).png();
        let size = picture.len();
        let sent = Instant::now();
        let path = format!("/v1/sessions/site/robots/{robot}/maps?resolution={RESOLUTION}&origin=0,0,0");
        let request = server.post(&path).header("content-type", "image/png").body(picture);
        let request = request.timeout(std::time::Duration::from_mins(10));
        let answer = request.send().await.expect("an answer");
        assert_eq!(
            answer.status().as_u16(),
            201,
            "{}",
            answer.text().await.unwrap_or_default()
        );
        tell(&format!(
            "{width} x {height} cells, a PNG of {:.1} MB: taken in {:.1} s, peak memory {} MB",
            size as f64 / 1e6,
            sent.elapsed().as_secs_f64(),
            server.peak_memory() / 1_000_000,
        ));
    }
    let merge = server.post("/v1/sessions/site/merges").send().await.expect("an answer");
    let merging = Instant::now();
    let mut job: Job = read_json(merge).await;
    while !job.state.is_terminal() {
        assert!(
            began.elapsed().as_secs() < MERGE_SECONDS_MAX,
            "the merge does not end: {job:?}"
        );
        job = server.read(&format!("/v1/jobs/{}?wait=30", job.id)).await;
    }
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
    let version: Version = server.read("/v1/sessions/site/versions/1").await;
    let result: MergeResult = version.result.read().expect("our own document");
    tell(&format!(
        "merged with itself moved in {:.1} s: {} x {} cells, peak memory {} MB ({:.1} bytes a cell of one map)",
        merging.elapsed().as_secs_f64(),
        result.fused.width,
        result.fused.height,
        server.peak_memory() / 1_000_000,
        server.peak_memory() as f64 / cells as f64,
    ));
    let b = result.maps.iter().find(|map| map.name == "b").expect("it is told of");
    assert_eq!(b.status, PlacementStatus::Placed, "{b:?}");
    let pose = b.pose.expect("it is placed");
    let off = (pose.x - moved.x()).hypot(pose.y - moved.y());
    assert!(off < 2.0 * RESOLUTION, "placed {off:.3} m off");
}

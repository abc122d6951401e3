//! What an earlier release wrote is served by this one.

use std::path::{Path, PathBuf};

use mapweld::api::{Constraint, Job, Map, MergeResult, Page, Session, Version};
use mapweld::model::JobState;
use reqwest::StatusCode;
use serde_json::{Value, json};

use super::command::mapweld;
use super::rooms::{Files, scrap};
use super::server::TestServer;
use crate::postgres::Database;

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

/// What every fixture holds, written through the API.
async fn fill(server: &TestServer) {
    let settings = json!({ "title": "Ward 3", "labels": { "floor": "2" }, "keep_versions": 5 });
    let made = server
        .put("/v1/sessions/ward")
        .json(&settings)
        .send()
        .await
        .expect("an answer");
    assert_eq!(made.status(), StatusCode::CREATED);
    for (seed, robot) in [(1, "r1"), (2, "r2"), (3, "r1")] {
        let (_, pushed) = server.push("ward", robot, &Files::of("m", &scrap(seed))).await;
        let job = server.ended(pushed.job.expect("a job")).await;
        assert_eq!(job.state, JobState::Succeeded);
    }
    let rule = json!({ "fixed": { "robot": "r2", "pose": { "x": 1.0, "y": 0.5, "yaw": 0.1 } } });
    let constraint = json!({ "rule": rule, "author": "Ada", "note": "measured" });
    let made = server
        .post("/v1/sessions/ward/constraints")
        .json(&constraint)
        .send()
        .await
        .expect("an answer");
    assert_eq!(made.status(), StatusCode::CREATED);
    for request in [json!({}), json!({ "restore": 1, "author": "Ada" })] {
        let queued = server
            .post("/v1/sessions/ward/merges")
            .json(&request)
            .send()
            .await
            .expect("an answer");
        let queued: Job = super::server::json(queued).await;
        assert_eq!(server.ended(queued.id).await.state, JobState::Succeeded);
    }
}

/// What is read of it.
async fn check(server: &TestServer) {
    let session: Session = server.read("/v1/sessions/ward").await;
    assert_eq!(
        session.title.as_ref().map(mapweld::model::Title::as_str),
        Some("Ward 3")
    );
    assert_eq!(session.keep_versions.map(std::num::NonZeroU32::get), Some(5));
    let maps: Page<Map> = server.read("/v1/sessions/ward/maps").await;
    assert_eq!(maps.items.len(), 3);
    let constraints: Page<Constraint> = server.read("/v1/sessions/ward/constraints").await;
    assert_eq!(constraints.items.len(), 1);
    let last: Version = server.read("/v1/sessions/ward/versions/5").await;
    assert_eq!(last.restored_from.map(mapweld::model::VersionNumber::get), Some(1));
    let steered: Version = server.read("/v1/sessions/ward/versions/4").await;
    let result: MergeResult = steered.result.read().expect("a result of an earlier release");
    assert_eq!((result.placed(), result.constraints.len()), (2, 1));
    for version in 1..=5 {
        let path = format!("/v1/sessions/ward/versions/{version}/map.png");
        let picture = server.get(&path).send().await.expect("an answer");
        assert_eq!(picture.status(), StatusCode::OK, "{path}");
    }
    // and work goes on
    let (_, pushed) = server.push("ward", "r3", &Files::of("m", &scrap(4))).await;
    assert_eq!(
        server.ended(pushed.job.expect("a job")).await.state,
        JobState::Succeeded
    );
    let merges: Page<Value> = server.read("/v1/sessions/ward/merges").await;
    assert_eq!(merges.items.len(), 6);
}

pub(super) fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("a folder");
    for entry in std::fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        let target = to.join(entry.file_name());
        if entry.file_type().expect("a type").is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).expect("is copied");
        }
    }
}

/// The folders of what releases wrote.
fn releases() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(fixtures()).expect("fixtures");
    let releases: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    assert!(!releases.is_empty(), "no fixture found");
    releases
}

async fn folder_is_served_and_sound(release: &Path) {
    let data = tempfile::tempdir().expect("a folder");
    copy(&release.join("sqlite"), data.path());
    let server = TestServer::start_in(data, &[]);
    check(&server).await;
    let folder = server.folder().to_str().expect("a readable path").to_owned();
    let checked = mapweld(&["fsck", "--data", &folder]);
    assert_eq!(checked.status.code(), Some(0), "{}: {checked:?}", release.display());
}

async fn dump_is_served_and_sound(release: &Path, database: &Database) {
    database.load(&release.join("postgres.sql"));
    let data = tempfile::tempdir().expect("a folder");
    // the same maps make the same bytes, whatever database their records are in
    copy(&release.join("sqlite/blobs"), &data.path().join("blobs"));
    let url = database.url();
    let server = TestServer::start_in(data, &["--database-url", &url]);
    check(&server).await;
    let folder = server.folder().to_str().expect("a readable path").to_owned();
    let checked = mapweld(&["fsck", "--data", &folder, "--database-url", &url]);
    assert_eq!(checked.status.code(), Some(0), "{}: {checked:?}", release.display());
}

#[tokio::test]
async fn what_each_release_has_written_to_a_folder_is_served_and_sound() {
    for release in releases() {
        folder_is_served_and_sound(&release).await;
    }
}

#[tokio::test]
async fn what_each_release_has_written_to_postgres_is_served_and_sound() {
    for release in releases() {
        let Some(database) = Database::fresh() else { return };
        dump_is_served_and_sound(&release, &database).await;
    }
}

/// `MAPWELD_WRITE_FIXTURE=1`, before a release, keeps it among the fixtures; otherwise it is thrown away.
#[tokio::test]
async fn the_fixture_of_this_release_can_be_made_and_is_served() {
    let thrown_away = tempfile::tempdir().expect("a folder");
    let kept = std::env::var_os("MAPWELD_WRITE_FIXTURE").is_some();
    let among = if kept {
        fixtures()
    } else {
        thrown_away.path().to_owned()
    };
    let release = among.join(env!("CARGO_PKG_VERSION"));
    std::fs::create_dir_all(&release).expect("a folder");
    write_folder(&release.join("sqlite")).await;
    folder_is_served_and_sound(&release).await;

    let Some(database) = Database::fresh() else {
        assert!(!kept, "a fixture of both databases needs both");
        return;
    };
    let server = TestServer::start(&["--database-url", &database.url()]);
    fill(&server).await;
    std::fs::write(release.join("postgres.sql"), database.dump()).expect("is written");
    let other = Database::fresh().expect("there was one before");
    dump_is_served_and_sound(&release, &other).await;
}

/// A backup of what [`fill`] makes, in a folder that nobody holds.
async fn write_folder(to: &Path) {
    let server = TestServer::start(&[]);
    fill(&server).await;
    let _ = std::fs::remove_dir_all(to); // of an earlier attempt at this release
    let [data, folder] = [server.folder(), to].map(|path| path.to_str().expect("a readable path").to_owned());
    let copied = mapweld(&["backup", "--data", &data, "--to", &folder]);
    assert_eq!(copied.status.code(), Some(0), "{copied:?}");
    std::fs::remove_file(to.join("mapweld.lock")).expect("it was left by the backup");
}

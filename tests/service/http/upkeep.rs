//! Keeping house, checking it, and carrying it elsewhere: retention, `mapweld fsck`, `mapweld backup`.

use std::path::{Path, PathBuf};
use std::process::Output;

use mapweld::api::{Map, Page, Version, VersionSummary};
use mapweld::model::JobState;
use reqwest::StatusCode;
use serde_json::Value;

use super::command::mapweld;
use super::rooms::{Files, scrap, three_robots};
use super::server::{PATIENCE, TestServer};
use super::upgrade::copy;
use crate::postgres::Database;

fn text(path: &Path) -> &str {
    path.to_str().expect("a readable path")
}

/// Exit code, findings, sums.
fn fsck(data: &Path, options: &[&str]) -> (Option<i32>, Vec<Value>, Value) {
    let arguments: Vec<&str> = ["fsck", "--data", text(data)].iter().chain(options).copied().collect();
    let output = mapweld(&arguments);
    let mut lines = lines(&output);
    let last = lines.pop().unwrap_or_else(|| panic!("no sums: {output:?}"));
    assert_eq!(last["kind"], "sums", "{output:?}");
    (output.status.code(), lines, last["sums"].clone())
}

fn lines(output: &Output) -> Vec<Value> {
    let told = String::from_utf8(output.stdout.clone()).expect("text");
    told.lines()
        .map(|line| serde_json::from_str(line).expect("a line of JSON"))
        .collect()
}

fn kinds(findings: &[Value]) -> Vec<&str> {
    findings
        .iter()
        .map(|finding| finding["kind"].as_str().expect("a kind"))
        .collect()
}

/// Every blob's file.
fn blobs(data: &Path) -> Vec<PathBuf> {
    let folders = std::fs::read_dir(data.join("blobs/sha256")).expect("blobs");
    let mut files: Vec<PathBuf> = folders
        .flat_map(|folder| std::fs::read_dir(folder.expect("an entry").path()).expect("a folder"))
        .map(|file| file.expect("an entry").path())
        .collect();
    files.sort();
    files
}

async fn push_and_merge(server: &TestServer, seed: u32) {
    let (_, pushed) = server.push("hall", "r1", &Files::of("m", &scrap(seed))).await;
    let job = server.ended(pushed.job.expect("a job")).await;
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
}

#[tokio::test]
async fn old_versions_and_their_bytes_go_and_what_stays_can_be_read() {
    let options = ["--keep-versions", "2", "--blob-grace", "3s", "--sweep-every", "100ms"];
    let server = TestServer::start(&options);
    for seed in 1..=4 {
        push_and_merge(&server, seed).await;
    }
    let began = std::time::Instant::now();
    loop {
        let versions: Page<VersionSummary> = server.read("/v1/sessions/hall/versions").await;
        let numbers: Vec<u32> = versions.items.iter().map(|version| version.number.get()).collect();
        let kept = blobs(server.folder()).len();
        if numbers == [4, 3] && fsck(server.folder(), &[]).2["blobs"] == kept {
            break;
        }
        assert!(
            began.elapsed() < PATIENCE,
            "not swept: {numbers:?}, {} blobs",
            blobs(server.folder()).len()
        );
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    }
    let maps: Page<Map> = server.read("/v1/sessions/hall/maps").await;
    assert_eq!(maps.items.iter().map(|map| map.sequence).collect::<Vec<_>>(), [4, 3]);
    for path in ["/versions/3/map.png", "/versions/latest/overlay.png"] {
        let answer = server
            .get(&format!("/v1/sessions/hall{path}"))
            .send()
            .await
            .expect("an answer");
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
    }
    let deleted = server
        .request("DELETE", "/v1/sessions/hall")
        .send()
        .await
        .expect("an answer");
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
    while !blobs(server.folder()).is_empty() {
        assert!(began.elapsed() < PATIENCE, "the bytes of the deleted session stay");
        tokio::time::sleep(std::time::Duration::from_millis(20)).await;
    }
    // the same content again, whose bytes were removed a moment ago
    push_and_merge(&server, 4).await;
    let (code, findings, _) = fsck(server.folder(), &[]);
    assert_eq!((code, kinds(&findings)), (Some(0), vec![]));
}

#[tokio::test]
async fn fsck_finds_what_is_damaged_or_missing_beside_a_running_server_and_without_it() {
    let server = TestServer::start(&[]);
    push_and_merge(&server, 1).await;
    push_and_merge(&server, 2).await;
    let (code, findings, sums) = fsck(server.folder(), &[]);
    assert_eq!((code, kinds(&findings)), (Some(0), vec![]), "{findings:?}");
    let kept = blobs(server.folder()).len();
    assert_eq!(
        (&sums["maps"], &sums["versions"], &sums["blobs"]),
        (&2.into(), &2.into(), &kept.into())
    );

    let (_, folder) = server.terminate().await;
    let data = folder.path();
    // change one, remove another
    let mut by_size = blobs(data);
    by_size.sort_by_key(|file| std::fs::metadata(file).expect("is there").len());
    std::fs::write(&by_size[0], b"other bytes").expect("is changed");
    std::fs::remove_file(by_size.last().expect("many")).expect("is removed");
    let orphan = data.join("blobs/sha256/00").join("0".repeat(62));
    std::fs::create_dir_all(orphan.parent().expect("a folder")).expect("is made");
    std::fs::write(&orphan, b"nobody's").expect("is written");
    std::fs::write(data.join("blobs/sha256/note"), b"x").expect("is written");

    let (code, findings, sums) = fsck(data, &["--grace", "1ms"]);
    assert_eq!(code, Some(4), "{findings:?}");
    let found = kinds(&findings);
    for kind in ["blob_damaged", "blob_missing", "orphan", "stray"] {
        assert!(found.contains(&kind), "{kind}: {findings:?}");
    }
    assert!(
        findings[0]["record"]
            .as_str()
            .is_some_and(|record| record.contains("hall")),
        "{findings:?}"
    );
    assert_eq!((&sums["orphans"], &sums["removed"]), (&1.into(), &0.into()));
    assert!(orphan.exists(), "nothing goes unless it is asked for");
    let (code, _, sums) = fsck(data, &["--grace", "1ms", "--repair"]);
    assert_eq!(
        (code, &sums["removed"]),
        (Some(4), &1.into()),
        "what is lost stays lost"
    );
    assert!(!orphan.exists());
}

#[test]
fn fsck_and_backup_of_what_is_not_there_is_the_callers_mistake() {
    let folder = tempfile::tempdir().expect("a folder");
    let nowhere = folder.path().join("nowhere");
    let to = folder.path().join("copy");
    assert_eq!(mapweld(&["fsck", "--data", text(&nowhere)]).status.code(), Some(2));
    let refused = mapweld(&["backup", "--data", text(&nowhere), "--to", text(&to)]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(!nowhere.exists(), "nothing is made by looking");
}

#[tokio::test]
async fn a_backup_of_a_running_server_is_served_as_it_was() {
    let server = TestServer::start(&[]);
    let ([a, b, _], _) = three_robots();
    let mut last = None;
    for (name, map) in [("a", &a), ("b", &b)] {
        last = server.push("hall", name, &Files::of(name, map)).await.1.job;
    }
    let job = server.ended(last.expect("a job")).await;
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
    let version: Version = server.read("/v1/sessions/hall/versions/latest").await;
    let path = format!("/v1/sessions/hall/versions/{}/map.png", version.number);
    let picture = server
        .get(&path)
        .send()
        .await
        .expect("an answer")
        .bytes()
        .await
        .expect("a picture");

    let copy = tempfile::tempdir().expect("a folder");
    let to = copy.path().join("backup");
    let told = mapweld(&["backup", "--data", text(server.folder()), "--to", text(&to)]);
    assert_eq!(told.status.code(), Some(0), "{told:?}");
    let twice = mapweld(&["backup", "--data", text(server.folder()), "--to", text(&to)]);
    assert_eq!(twice.status.code(), Some(2), "a backup is not written over");
    // what happens after the backup is not in it
    server.push("hall", "late", &Files::of("m", &scrap(9))).await;
    server.kill().await;

    let (code, findings, _) = fsck(&to, &[]);
    assert_eq!((code, kinds(&findings)), (Some(0), vec![]), "{findings:?}");
    std::fs::rename(&to, copy.path().join("data")).expect("is moved");
    let restored = tempfile::tempdir().expect("a folder");
    for name in ["mapweld.sqlite", "blobs"] {
        std::fs::rename(copy.path().join("data").join(name), restored.path().join(name)).expect("is moved");
    }
    let server = TestServer::start_in(restored, &[]);
    let again: Version = server.read("/v1/sessions/hall/versions/latest").await;
    assert_eq!(
        (again.number, again.digest, again.inputs),
        (version.number, version.digest, version.inputs)
    );
    let answer = server.get(&path).send().await.expect("an answer");
    assert_eq!(answer.bytes().await.expect("a picture"), picture);
    let maps: Page<Map> = server.read("/v1/sessions/hall/maps").await;
    assert_eq!(maps.items.len(), 2);
    // and work goes on
    let (_, pushed) = server.push("hall", "c", &Files::of("m", &scrap(3))).await;
    assert_eq!(
        server.ended(pushed.job.expect("a job")).await.state,
        JobState::Succeeded
    );
}

/// As the operators' page says: first the records, then the blobs, while the server runs.
#[tokio::test]
async fn a_backup_of_postgresql_and_blobs_is_served_as_it_was() {
    let (Some(first), Some(second)) = (Database::fresh(), Database::fresh()) else {
        return;
    };
    let url = first.url();
    let server = TestServer::start(&["--database-url", &url]);
    push_and_merge(&server, 1).await;
    push_and_merge(&server, 2).await;
    let path = "/v1/sessions/hall/versions/2";
    let version: Version = server.read(path).await;
    let picture = bytes(&server, &format!("{path}/map.png")).await;
    let maps: Page<Map> = server.read("/v1/sessions/hall/maps").await;

    let backup = tempfile::tempdir().expect("a folder");
    let dump = backup.path().join("mapweld.dump");
    first.back_up(&dump);
    // what comes between the two is in the blobs and not in the records
    push_and_merge(&server, 3).await;
    let copied = tempfile::tempdir().expect("a folder");
    copy(&server.folder().join("blobs"), &copied.path().join("blobs"));
    drop(server.kill().await);

    // over what was there before, twice: a restore that was broken off is begun again
    for _ in 0..2 {
        second.restore(&dump);
    }
    let url = second.url();
    let (code, findings, sums) = fsck(copied.path(), &["--database-url", &url, "--grace", "1s"]);
    assert_eq!(code, Some(0), "{findings:?} {sums}");
    let server = TestServer::start_in(copied, &["--database-url", &url]);
    let again: Version = server.read(path).await;
    assert_eq!(again.result.as_str(), version.result.as_str());
    assert_eq!(bytes(&server, &format!("{path}/map.png")).await, picture);
    let maps_again: Page<Map> = server.read("/v1/sessions/hall/maps").await;
    assert_eq!(maps_again.items, maps.items);
    // the map that was pushed after the records were copied comes again, and the next version has the next number
    push_and_merge(&server, 3).await;
    let last: Version = server.read("/v1/sessions/hall/versions/latest").await;
    assert_eq!(last.number.get(), 3);
}

async fn bytes(server: &TestServer, path: &str) -> Vec<u8> {
    let answer = server.get(path).send().await.expect("an answer");
    assert_eq!(answer.status(), StatusCode::OK, "{path}");
    answer.bytes().await.expect("a body").to_vec()
}

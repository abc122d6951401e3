//! `mapweld demo`: the whole service, shown and checked against the known truth.

use std::process::Command;

use super::command::{Folder, mapweld};
use super::server::TestServer;

#[test]
fn the_demo_places_all_robots_where_they_are_and_leaves_nothing_behind() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("temporary")).expect("it is made");
    let output = Command::new(env!("CARGO_BIN_EXE_mapweld"))
        .args(["demo", "--once", "--save", &folder.text("seen")])
        .env("TMPDIR", folder.path("temporary"))
        .output()
        .expect("the command runs");
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert!(told.contains("version 4: ada, bob, cyd in one map"), "{told}");
    assert!(told.contains("/v1/sessions/demo/versions/latest/overlay.png"), "{told}");
    for name in ["overlay.png", "map.png", "map.yaml", "result.json"] {
        assert!(folder.path("seen").join(name).is_file(), "{name} is missing");
    }
    let left = std::fs::read_dir(folder.path("temporary")).expect("the folder").count();
    assert_eq!(left, 0, "the server's folder is removed");
}

#[tokio::test]
async fn the_demo_pushes_to_a_server_that_is_there_into_a_session_of_its_own() {
    let server = TestServer::start(&[]);
    let url = server.url("");
    let output = tokio::task::spawn_blocking(move || mapweld(&["demo", "--once", "--server", &url])).await;
    let output = output.expect("no panic");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let sessions: serde_json::Value = server.read("/v1/sessions").await;
    let name = sessions["items"][0]["id"].as_str().expect("a session").to_owned();
    assert!(name.starts_with("demo-"), "{name}");
}

//! One-shot merges: the same answer as the command's, and nothing kept.

use std::path::{Path, PathBuf};
use std::process::Command;

use mapweld::api::{MergeResult, ProblemCode};
use reqwest::StatusCode;
use reqwest::multipart::Form;
use serde_json::Value;

use super::rooms::{Files, scrap, three_robots};
use super::server::{TestServer, problem};

impl Files {
    /// The files of a map on disk; the picture lies beside its YAML.
    fn read(yaml: &Path) -> Self {
        let content = std::fs::read(yaml).expect("a YAML file");
        let meta = mapweld::codec::MapYaml::parse(&content, &mapweld::codec::Limits::default()).expect("a map");
        let image = yaml.with_file_name(&meta.image);
        let name = |path: &Path| path.file_name().expect("a name").to_string_lossy().into_owned();
        Self {
            yaml_name: name(yaml),
            yaml: content,
            image_name: name(&image),
            image: std::fs::read(&image).expect("a picture"),
        }
    }

    fn write(&self, folder: &Path) -> PathBuf {
        let yaml = folder.join(&self.yaml_name);
        std::fs::write(&yaml, &self.yaml).expect("is written");
        std::fs::write(folder.join(&self.image_name), &self.image).expect("is written");
        yaml
    }
}

fn form(maps: &[Files]) -> Form {
    maps.iter().fold(Form::new(), |form, map| map.add_to(form))
}

/// What the command writes for these files, without its timings.
fn by_command(maps: &[PathBuf]) -> Value {
    let folder = tempfile::tempdir().expect("a folder");
    let output = Command::new(env!("CARGO_BIN_EXE_mapweld"))
        .arg("merge")
        .args(maps)
        .arg("-o")
        .arg(folder.path())
        .output()
        .expect("the binary runs");
    let code = output.status.code();
    assert!(
        matches!(code, Some(0 | 3)),
        "{code:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    let text = std::fs::read_to_string(folder.path().join("result.json")).expect("it is written");
    without_timings(&text)
}

async fn by_server(server: &TestServer, maps: &[Files]) -> Value {
    let answer = server.post("/v1/merge").multipart(form(maps)).send().await;
    let answer = answer.expect("an answer");
    let status = answer.status();
    let text = answer.text().await.expect("a body");
    assert_eq!(status, StatusCode::OK, "{text}");
    without_timings(&text)
}

fn without_timings(text: &str) -> Value {
    let mut result: Value = serde_json::from_str(text).expect("JSON");
    let timings = result.as_object_mut().expect("an object").remove("timings");
    assert!(timings.is_some(), "a result tells its timings");
    result
}

/// The maps of others, when they are there.
fn shared_maps() -> Option<PathBuf> {
    let shared = std::env::var_os("MAPWELD_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"),
        PathBuf::from,
    );
    let maps = shared.join("maps");
    maps.join("pairs.json").is_file().then_some(maps)
}

/// Ten pairs, spread over all that there are.
fn real_pairs(maps: &Path) -> Vec<[PathBuf; 2]> {
    let text = std::fs::read_to_string(maps.join("pairs.json")).expect("a list of pairs");
    let pairs: Vec<Value> = serde_json::from_str(&text).expect("JSON");
    let path = |pair: &Value, which: &str| maps.join(pair[which].as_str().expect("a path"));
    pairs
        .iter()
        .step_by((pairs.len() / 10).max(1))
        .take(10)
        .map(|pair| [path(pair, "fixed"), path(pair, "moving")])
        .collect()
}

#[tokio::test]
async fn the_servers_answer_is_the_commands_result() {
    let server = TestServer::start(&["--workers", "0"]);
    let folder = tempfile::tempdir().expect("a folder");
    let ([a, b, c], _) = three_robots();
    let files = [("a", &a), ("b", &b), ("c", &c), ("lost", &scrap(6))].map(|(name, map)| Files::of(name, map));
    let paths = files.each_ref().map(|files| files.write(folder.path()));
    assert_eq!(
        by_server(&server, &files).await.to_string(),
        by_command(&paths).to_string()
    );
}

#[tokio::test]
#[expect(clippy::print_stderr, reason = "a test that is left out shall say so")]
async fn the_servers_answer_is_the_commands_result_on_real_maps() {
    let Some(maps) = shared_maps() else {
        eprintln!("LEFT OUT: there are no real maps; simulated ones are looked at by the test beside this one");
        return;
    };
    let server = TestServer::start(&["--workers", "0"]);
    let pairs = real_pairs(&maps);
    assert_eq!(pairs.len(), 10);
    for paths in pairs {
        let files = paths.each_ref().map(|path| Files::read(path));
        let (server, command) = (by_server(&server, &files).await, by_command(&paths));
        assert_eq!(server.to_string(), command.to_string(), "{paths:?}");
    }
}

#[tokio::test]
async fn the_fused_picture_is_answered_to_who_likes_pictures() {
    let server = TestServer::start(&["--workers", "0"]);
    let ([a, b, _], _) = three_robots();
    let maps = [Files::of("a", &a), Files::with_png("b", &b)];
    let answer = server
        .post("/v1/merge")
        .header("accept", "image/png")
        .multipart(form(&maps))
        .send()
        .await
        .expect("an answer");
    assert_eq!(answer.headers()["content-type"], "image/png");
    let picture = answer.bytes().await.expect("a picture");
    assert!(picture.starts_with(b"\x89PNG"));
    let sessions: Value = server.read("/v1/sessions").await;
    assert_eq!(sessions["items"], serde_json::json!([]), "nothing is kept");
}

#[tokio::test]
async fn methods_parameters_and_the_anchor_are_taken_from_the_query_and_checked() {
    let server = TestServer::start(&["--workers", "0"]);
    let maps = [Files::of("a", &scrap(1)), Files::of("b", &scrap(2))];
    let post = |query: &str| server.post(&format!("/v1/merge?{query}")).multipart(form(&maps));
    let answer = post("anchor=b&resolution=0.1").send().await.expect("an answer");
    let result: MergeResult = super::server::json(answer).await;
    assert_eq!(result.anchor, "b");
    assert!((result.fused.resolution - 0.1).abs() < 1e-12);
    for query in [
        "method=magic",
        "parameters=[",
        "parameters={\"colour\":1}",
        "anchor=c",
        "resolution=1000",
    ] {
        let refused = problem(post(query)).await;
        let known = [ProblemCode::InvalidRequest, ProblemCode::InvalidQuery];
        assert!(
            known.contains(&refused.code) && !refused.errors.is_empty(),
            "{query}: {refused:?}"
        );
    }
}

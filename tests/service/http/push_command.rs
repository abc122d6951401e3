//! `mapweld push`: a robot's map on its way, also when the server is away.

use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Child, ChildStdout, Command, Stdio};

use serde_json::Value;
use tokio::net::{TcpListener, TcpStream};

use super::command::{Folder, mapweld};
use super::rooms;
use super::server::TestServer;

/// Runs a push to its end: its exit code, and what it printed.
async fn push(arguments: &[&str]) -> (Option<i32>, String, String) {
    let arguments: Vec<String> = std::iter::once("push")
        .chain(arguments.iter().copied())
        .map(str::to_owned)
        .collect();
    let run = move || mapweld(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    let output = tokio::task::spawn_blocking(run).await.expect("no panic");
    let text = |bytes| String::from_utf8(bytes).expect("text");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

/// What `--json` prints.
fn printed(line: &str) -> Value {
    serde_json::from_str(line).unwrap_or_else(|error| panic!("{error} in {line:?}"))
}

/// An address where nobody listens yet.
async fn nobody() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    listener.local_addr().expect("an address")
}

/// From now on whoever asks at `address` is answered by the server.
async fn answer_at(address: SocketAddr, server: &TestServer) {
    let server = server.address().to_owned();
    let listener = TcpListener::bind(address).await.expect("the port is still free");
    tokio::spawn(async move {
        loop {
            let (mut robot, _) = listener.accept().await.expect("a connection");
            let mut server = TcpStream::connect(&server).await.expect("the server is there");
            tokio::spawn(async move { tokio::io::copy_bidirectional(&mut robot, &mut server).await });
        }
    });
}

#[tokio::test]
async fn a_push_that_waits_tells_where_the_robot_is_placed() {
    let server = TestServer::start(&[]);
    let folder = Folder::new();
    let ([a, b, _], [_, truth, _]) = rooms::three_robots();
    let url = server.url("");
    let to = ["--server", url.as_str(), "--session", "s", "--wait"];
    let (code, told, _) = push(&[&[folder.map("a.yaml", &a).as_str(), "--robot", "r1"], &to[..]].concat()).await;
    assert_eq!(code, Some(0), "{told}");
    assert!(
        told.contains("s/r1: map ") && told.contains("version 1: r1 is placed at x 0.000 m"),
        "{told}"
    );
    let (code, told, _) = push(&[&[folder.map("b.yaml", &b).as_str(), "--robot", "r2"], &to[..]].concat()).await;
    assert_eq!(code, Some(0), "{told}");
    let x = format!("r2 is placed at x {:.1}", truth.x());
    assert!(
        told.contains(&x) && told.contains("supported by 1 pair"),
        "{told} lacks {x}"
    );
}

#[tokio::test]
async fn a_robot_that_is_not_placed_is_told_why_and_exits_3() {
    let server = TestServer::start(&[]);
    let folder = Folder::new();
    let url = server.url("");
    let to = ["--server", url.as_str(), "--session", "s", "--wait"];
    let first = folder.map("a.yaml", &rooms::three_robots().0[0]);
    assert_eq!(
        push(&[&[first.as_str(), "--robot", "r1"], &to[..]].concat()).await.0,
        Some(0)
    );
    let scrap = folder.map("scrap.yaml", &rooms::scrap(5));
    let (code, told, _) = push(&[&[scrap.as_str(), "--robot", "r2"], &to[..]].concat()).await;
    assert_eq!(code, Some(3), "{told}");
    assert!(told.contains("r2 is not placed: "), "{told}");
}

#[tokio::test]
async fn the_same_push_twice_is_one_map() {
    let server = TestServer::start(&[]);
    let folder = Folder::new();
    let map = folder.map("m.yaml", &rooms::scrap(5));
    let url = server.url("");
    let arguments = [
        map.as_str(),
        "--server",
        &url,
        "--session",
        "s",
        "--robot",
        "r1",
        "--json",
    ];
    let (first, second) = (push(&arguments).await, push(&arguments).await);
    assert_eq!((first.0, second.0), (Some(0), Some(0)));
    let (first, second) = (printed(&first.1), printed(&second.1));
    assert_eq!(
        (&first["pushed"]["created"], &second["pushed"]["created"]),
        (&true.into(), &false.into())
    );
    assert_eq!(first["pushed"]["map"], second["pushed"]["map"]);
}

#[tokio::test]
async fn a_map_that_the_server_refuses_exits_2_with_the_servers_reason_and_does_not_wait_in_the_spool() {
    let server = TestServer::start(&["--max-cells", "100"]);
    let folder = Folder::new();
    let map = folder.map("m.yaml", &rooms::scrap(5));
    let (url, spool) = (server.url(""), folder.text("spool"));
    let (code, _, told) = push(&[
        &map,
        "--server",
        &url,
        "--session",
        "s",
        "--robot",
        "r1",
        "--spool",
        &spool,
    ])
    .await;
    assert_eq!(code, Some(2), "{told}");
    assert!(
        told.starts_with("error: the server refused (413 ") && told.contains("100"),
        "{told}"
    );
    assert_eq!(std::fs::read_dir(&spool).expect("the spool").count(), 0);
}

#[tokio::test]
async fn a_push_outlasts_a_server_that_is_away() {
    let server = TestServer::start(&[]);
    let folder = Folder::new();
    let map = folder.map("m.yaml", &rooms::scrap(5));
    let address = nobody().await;
    let mut robot = Command::new(env!("CARGO_BIN_EXE_mapweld"))
        .args([
            "push",
            &map,
            "--server",
            &format!("http://{address}"),
            "--session",
            "s",
            "--robot",
            "r1",
            "--json",
        ])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command runs");
    let (robot, told) = tokio::task::spawn_blocking(move || {
        let mut told = String::new();
        let stderr = robot.stderr.as_mut().expect("it is piped");
        BufReader::new(stderr).read_line(&mut told).expect("it warns");
        (robot, told)
    })
    .await
    .expect("no panic");
    assert!(
        told.contains("cannot reach") && told.contains("trying again in"),
        "{told}"
    );
    answer_at(address, &server).await;
    let output = tokio::task::spawn_blocking(|| robot.wait_with_output())
        .await
        .expect("no panic")
        .expect("it ends");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let pushed = printed(&String::from_utf8(output.stdout).expect("text"));
    assert_eq!(pushed["pushed"]["created"], true);
}

#[tokio::test]
async fn what_could_not_be_sent_waits_in_the_spool_and_goes_with_the_next_push() {
    let server = TestServer::start(&[]);
    let folder = Folder::new();
    let [one, two] = [5, 6].map(|seed| folder.map(&format!("{seed}.yaml"), &rooms::scrap(seed)));
    let (away, spool) = (format!("http://{}", nobody().await), folder.text("spool"));
    let common = ["--session", "s", "--spool", &spool];
    let (code, _, told) = push(
        &[
            &[&one, "--robot", "r1", "--server", &away, "--retry-for", "0"],
            &common[..],
        ]
        .concat(),
    )
    .await;
    assert_eq!(code, Some(1), "{told}");
    assert!(
        told.contains("kept in the spool folder") && told.contains("error: gave up"),
        "{told}"
    );

    let url = server.url("");
    let (code, _, told) = push(&[&[&two, "--robot", "r2", "--server", &url], &common[..]].concat()).await;
    assert_eq!(code, Some(0), "{told}");
    assert!(told.contains("sent what waited") && told.contains("s/r1"), "{told}");
    let maps: Value = server.read("/v1/sessions/s/maps").await;
    assert_eq!(maps["items"].as_array().expect("a list").len(), 2, "{maps}");
    assert_eq!(std::fs::read_dir(&spool).expect("the spool").count(), 0);
}

/// A `mapweld push --watch` that runs.
struct Watching {
    child: Child,
    lines: Option<BufReader<ChildStdout>>,
}

impl Watching {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_mapweld"))
            .args(["push", "--watch", "--json"])
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the command runs");
        let lines = child.stdout.take().map(BufReader::new);
        Self { child, lines }
    }

    /// The next push.
    async fn next(&mut self) -> Value {
        let mut lines = self.lines.take().expect("one question at a time");
        let (lines, line) = tokio::task::spawn_blocking(move || {
            let mut line = String::new();
            lines.read_line(&mut line).expect("it prints");
            (lines, line)
        })
        .await
        .expect("no panic");
        self.lines = Some(lines);
        printed(&line)
    }

    fn terminate(&mut self) -> Option<i32> {
        let told = Command::new("kill")
            .args(["-TERM", &self.child.id().to_string()])
            .status()
            .expect("kill runs");
        assert!(told.success());
        self.child.wait().expect("it ends").code()
    }
}

impl Drop for Watching {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[tokio::test]
async fn a_watched_map_is_pushed_whenever_it_changes_until_the_watch_is_told_to_end() {
    let server = TestServer::start(&[]);
    let folder = Folder::new();
    let (map, url) = (folder.text("m.yaml"), server.url(""));
    let mut watching = Watching::start(&[&map, "--server", &url, "--session", "s", "--robot", "r1"]);
    let mut digests = Vec::new();
    for seed in [5, 6, 7] {
        folder.map("m.yaml", &rooms::scrap(seed));
        let pushed = watching.next().await;
        assert_eq!(pushed["pushed"]["created"], true, "{pushed}");
        digests.push(pushed["pushed"]["map"]["digest"].clone());
    }
    digests.dedup();
    assert_eq!(digests.len(), 3);
    assert_eq!(watching.terminate(), Some(0));
}

#[tokio::test]
async fn a_watched_map_waits_in_the_spool_and_survives_the_robots_restart() {
    let server = TestServer::start(&[]);
    let folder = Folder::new();
    let address = nobody().await;
    let (map, url, spool) = (
        folder.map("m.yaml", &rooms::scrap(5)),
        format!("http://{address}"),
        folder.text("spool"),
    );
    let arguments = [
        map.as_str(),
        "--server",
        &url,
        "--session",
        "s",
        "--robot",
        "r1",
        "--spool",
        &spool,
    ];
    let (code, _, _) = push(&[&arguments[..], &["--retry-for", "0"]].concat()).await;
    assert_eq!(code, Some(1));
    std::fs::remove_file(folder.path("m.yaml")).expect("the robot has lost its map file");
    answer_at(address, &server).await;
    let pushed = Watching::start(&arguments).next().await;
    assert_eq!(pushed["pushed"]["created"], true, "{pushed}");
}

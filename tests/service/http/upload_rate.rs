//! Uploads a second and how long one takes, as a ratio to a bare handler that reads the same bodies, hashes them and
//! has them on disk before it answers; both on loopback, by the same clients, in turns in one run.
//!
//! Short among the other tests; `MAPWELD_UPLOADS=2000` in full. Honest in release only: `tests/load.sh`.

#![expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "some thousands of measurements"
)]

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, State};
use axum::http::StatusCode;
use axum::routing::post;
use mapweld::api::Map;
use mapweld::codec::encode_pgm;
use mapweld::grid::{LogOdds, OccupancyGrid};
use reqwest::Client;
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use tokio::task::JoinSet;

use super::rooms::{Files, three_robots};
use super::server::TestServer;
use crate::survival::{full_form, tell};

/// Clients that push at one time.
const CLIENTS: usize = 8;

/// The bare handler: what an upload cannot do without.
async fn keep(State(folder): State<Arc<PathBuf>>, body: Bytes) -> StatusCode {
    let kept = tokio::task::spawn_blocking(move || -> std::io::Result<()> {
        let digest = Sha256::digest(&body);
        let name = digest
            .iter()
            .fold(String::new(), |name, byte| format!("{name}{byte:02x}"));
        let mut file = std::fs::File::create(folder.join(name))?;
        file.write_all(&body)?;
        file.sync_all()
    });
    match kept.await {
        Ok(Ok(())) => StatusCode::CREATED,
        _ => StatusCode::INTERNAL_SERVER_ERROR,
    }
}

/// Serves the bare handler on threads of its own; the URL.
fn bare(folder: &Path) -> String {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    listener.set_nonblocking(true).expect("a socket");
    let url = format!("http://{}/", listener.local_addr().expect("an address"));
    let app = Router::new()
        .route("/", post(keep))
        .layer(DefaultBodyLimit::disable())
        .with_state(Arc::new(folder.to_owned()));
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Runtime::new().expect("a runtime");
        runtime.block_on(async {
            let listener = tokio::net::TcpListener::from_std(listener).expect("a listener");
            axum::serve(listener, app).await.expect("it serves");
        });
    });
    url
}

/// One upload: what is sent, and where to.
#[derive(Clone)]
struct Upload {
    url: String,
    files: Files,
}

/// What a number of uploads came to.
#[derive(Default)]
struct Measured {
    times: Vec<Duration>,
    took: Duration,
}

impl Measured {
    fn a_second(&self) -> f64 {
        self.times.len() as f64 / self.took.as_secs_f64()
    }

    fn percentile(&self, share: f64) -> f64 {
        let mut times: Vec<f64> = self.times.iter().map(Duration::as_secs_f64).collect();
        times.sort_by(f64::total_cmp);
        times[((times.len() - 1) as f64 * share).ceil() as usize] * 1000.0
    }
}

/// Sends all, so many at one time; the bodies of the answers are given back.
async fn send_all(client: &Client, uploads: Vec<Upload>, measured: &mut Measured) -> Vec<String> {
    let began = Instant::now();
    let mut clients = JoinSet::new();
    let share = uploads.len().div_ceil(CLIENTS);
    for uploads in uploads.chunks(share) {
        let (client, uploads) = (client.clone(), uploads.to_vec());
        clients.spawn(async move {
            let mut answers = Vec::new();
            for Upload { url, files } in uploads {
                let began = Instant::now();
                let answer = client
                    .post(&url)
                    .multipart(files.form())
                    .send()
                    .await
                    .expect("an answer");
                assert_eq!(answer.status(), reqwest::StatusCode::CREATED, "{url}");
                answers.push((answer.text().await.expect("a body"), began.elapsed()));
            }
            answers
        });
    }
    let answers: Vec<_> = clients.join_all().await.into_iter().flatten().collect();
    measured.took += began.elapsed();
    measured.times.extend(answers.iter().map(|(_, took)| *took));
    answers.into_iter().map(|(text, _)| text).collect()
}

/// A map of its own for each number: the number stands in its cells.
fn numbered(map: &OccupancyGrid, number: usize) -> OccupancyGrid {
    let mut map = map.clone();
    for (bit, cell) in map.cells_mut().iter_mut().take(32).enumerate() {
        *cell = if number >> bit & 1 == 1 {
            LogOdds::OCCUPIED
        } else {
            LogOdds::FREE
        };
    }
    map
}

#[tokio::test(flavor = "multi_thread")]
async fn uploads_a_second_against_a_bare_handler() {
    /// So many turns of each, one after the other: what else the machine does meets both.
    const TURNS: usize = 4;
    let count = full_form("MAPWELD_UPLOADS", 80);
    let folder = tempfile::tempdir().expect("a folder");
    let bare_url = bare(folder.path());
    let server = TestServer::start(&["--workers", "0", "--max-uploads", "16", "--key-rate", "0"]);
    let session = server.put("/v1/sessions/hall").json(&json!({ "auto_merge": false }));
    assert!(session.send().await.expect("an answer").status().is_success());
    let client = Client::new();
    let ([map, ..], _) = three_robots();
    let (mut bare, mut ours, mut kept) = (Measured::default(), Measured::default(), Vec::new());
    for turn in 0..TURNS {
        let (to_bare, to_us) = (0..count / TURNS)
            .map(|index| {
                let number = turn * count + index;
                let files = Files::of("m", &numbered(&map, number));
                let upload = |url: String| Upload {
                    url,
                    files: files.clone(),
                };
                let path = format!("/v1/sessions/hall/robots/r{number}/maps");
                (upload(bare_url.clone()), upload(server.url(&path)))
            })
            .unzip();
        send_all(&client, to_bare, &mut bare).await;
        kept.extend(send_all(&client, to_us, &mut ours).await);
    }
    for (who, measured) in [("bare handler", &bare), ("mapweld", &ours)] {
        tell(&format!(
            "{who}: {:.0} uploads a second of {} kB from {CLIENTS} clients, p50 {:.1} ms, p99 {:.1} ms",
            measured.a_second(),
            encode_pgm(&map).len() / 1000,
            measured.percentile(0.5),
            measured.percentile(0.99),
        ));
    }
    tell(&format!(
        "ratio: {:.2} of the bare handler's uploads a second; p50 x {:.1}, p99 x {:.1}",
        ours.a_second() / bare.a_second(),
        ours.percentile(0.5) / bare.percentile(0.5),
        ours.percentile(0.99) / bare.percentile(0.99),
    ));
    assert_eq!(kept.len(), count / TURNS * TURNS);
    let server = TestServer::start_in(server.kill().await, &["--workers", "0"]);
    for text in kept {
        let pushed: Value = serde_json::from_str(&text).expect("JSON");
        let map: Map = serde_json::from_value(pushed["map"].clone()).expect("a map");
        let path = format!("/v1/sessions/hall/maps/{}", map.id);
        assert_eq!(server.read::<Map>(&path).await, map, "an acknowledged map is lost");
    }
}

//! A folder of blobs that is full or read-only: refusals that say when to come again, nothing wrong, and no need of a hand
//! to heal. The folder is a file system of its own, of one megabyte, which only the server sees.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use reqwest::Client;

use super::home::Home;
use super::ledger::{Acknowledged, Ledger};
use super::replica::{Answer, Replica, ask, client, is_storage, push};
use super::tell;

/// Longest time to heal.
const HEALED: Duration = Duration::from_secs(10);
const OPTIONS: [&str; 6] = ["--lease", "2s", "--workers", "1", "--threads", "1"];

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_folder_of_blobs_that_is_full_or_read_only_causes_refusals_and_nothing_worse() {
    if !may_mount() {
        tell("SKIPPED: full and read-only folders: this machine does not let us mount a file system of our own");
        return;
    }
    let home = Home::sqlite();
    let blobs = home.path().join("blobs");
    std::fs::create_dir(&blobs).expect("a folder");
    let server = Replica::spawn(in_a_small_file_system(&blobs, &home), &home).expect("it comes up");
    let (client, mut ledger, mut seed) = (client(), Ledger::default(), 0);
    healed(&client, &server, &mut ledger, &mut seed).await;

    let filler = filled(&as_it_sees(&server, &blobs));
    is_refused(&client, &server, "full").await;
    std::fs::remove_file(filler).expect("it is there");
    let took = healed(&client, &server, &mut ledger, &mut seed).await;
    tell(&format!(
        "folder of blobs full: only 503 with Retry-After; healed {:.2} s after",
        took.as_secs_f64()
    ));

    remount(&server, &blobs, "ro");
    is_refused(&client, &server, "read-only").await;
    remount(&server, &blobs, "rw");
    let took = healed(&client, &server, &mut ledger, &mut seed).await;
    tell(&format!(
        "folder of blobs read-only: only 503 with Retry-After; healed {:.2} s after",
        took.as_secs_f64()
    ));

    let counted = ledger.audit(&client, server.url()).await;
    tell(&format!(
        "after the outages of the folder: {counted:?}, nothing lost, no job stuck"
    ));
}

/// Whether a mount that nobody else sees is allowed.
fn may_mount() -> bool {
    let tried = Command::new("unshare")
        .args(["-rm", "mount", "-t", "tmpfs", "tmpfs", "/tmp"])
        .stderr(Stdio::null())
        .status();
    tried.is_ok_and(|status| status.success())
}

fn in_a_small_file_system(blobs: &Path, home: &Home) -> Command {
    let mut command = Command::new("unshare");
    command
        .args([
            "-rm",
            "sh",
            "-c",
            r#"mount -t tmpfs -o size=1m tmpfs "$0" && exec "$@""#,
        ])
        .arg(blobs)
        .arg(env!("CARGO_BIN_EXE_mapweld"))
        .args(Replica::arguments(home, &OPTIONS))
        .arg("--blobs")
        .arg(blobs);
    command
}

/// The server's own view of a folder.
fn as_it_sees(server: &Replica, folder: &Path) -> PathBuf {
    let inside = folder.strip_prefix("/").expect("an absolute path");
    Path::new(&format!("/proc/{}/root", server.pid())).join(inside)
}

/// Fills a file system to the last byte, and tells by which file.
fn filled(folder: &Path) -> PathBuf {
    let path = folder.join("filler");
    let mut filler = File::create(&path).expect("a file");
    while filler.write_all(&[0; 512]).is_ok() {}
    path
}

fn remount(server: &Replica, folder: &Path, how: &str) {
    let told = Command::new("nsenter")
        .args([
            "--target",
            &server.pid().to_string(),
            "--user",
            "--mount",
            "--preserve-credentials",
            "mount",
            "-o",
        ])
        .arg(format!("remount,{how}"))
        .arg(folder)
        .output()
        .expect("nsenter runs");
    assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
}

async fn is_refused(client: &Client, server: &Replica, what: &str) {
    for seed in 1000..1003 {
        match push(client, server.url(), "hall", "r2", seed).await {
            Answer::Later(status, problem) => assert!(is_storage(status, &problem), "{what}: {status} {problem:?}"),
            other => panic!("{what}: nothing can be kept, and the answer was {other:?}"),
        }
    }
    let ready: Answer<serde_json::Value> = ask(client.get(format!("{}/readyz", server.url()))).await;
    assert!(
        matches!(ready, Answer::Later(status, problem) if is_storage(status, &problem)),
        "{what}: it is not ready"
    );
    // what was kept before is still read
    let session = client
        .get(format!("{}/v1/sessions/hall", server.url()))
        .send()
        .await
        .expect("an answer");
    assert!(session.status().is_success(), "{what}");
}

/// How long it takes until the server takes in a map.
async fn healed(client: &Client, server: &Replica, ledger: &mut Ledger, seed: &mut u32) -> Duration {
    let began = Instant::now();
    *seed += 1;
    loop {
        match push(client, server.url(), "hall", "r1", *seed).await {
            Answer::Done(pushed) => {
                ledger.add(Acknowledged { seed: *seed, pushed });
                return began.elapsed();
            }
            Answer::Later(..) => {}
            Answer::Broken(why) => panic!("{why}"),
        }
        assert!(began.elapsed() < HEALED, "it does not heal by itself");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

//! No container engine is needed to know that the commands of `Dockerfile` and `compose.yaml` work: they are run here,
//! over a database and a bucket, with only names of hosts, ports and passwords changed.

use std::collections::BTreeMap;
use std::process::Command;
use std::time::{Duration, Instant};

use mapweld::api::{Page, VersionSummary};

use super::home::Home;
use super::replica::{Answer, Replica, client, ended_job, is_storage, push, read};
use super::tell;
use crate::blobs::bucket::Bucket;
use crate::postgres::Database;

const DOCKERFILE: &str = include_str!("../../../Dockerfile");
const COMPOSE: &str = include_str!("../../../compose.yaml");
/// Longest time to heal.
const HEALED: Duration = Duration::from_secs(10);

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_replicas_with_the_commands_of_the_container_serve_one_fleet_over_a_database_and_a_bucket() {
    let Some(database) = Database::fresh() else { return };
    let mut bucket = Bucket::start("mapweld").await;
    let home = Home::over(database.url());
    let replicas = [(); 2].map(|()| Replica::spawn(container(&home, &database, &bucket), &home).expect("it comes up"));
    let urls = replicas
        .each_ref()
        .map(|replica| replica.url().replace("0.0.0.0", "127.0.0.1"));
    let client = client();

    let pushed = push(&client, &urls[0], "hall", "r1", 1)
        .await
        .done()
        .expect("is taken in");
    let job = ended_job(&client, &urls[1], pushed.job.expect("a job")).await;
    let version = job.version.expect("it succeeded");
    let picture = client
        .get(format!("{}/v1/sessions/hall/versions/{version}/map.png", urls[1]))
        .send()
        .await;
    assert!(picture.expect("an answer").status().is_success());
    assert!(
        bucket.behind("blobs").join("sha256").is_dir(),
        "the blobs are in the bucket"
    );

    bucket.leave();
    match push(&client, &urls[0], "hall", "r1", 2).await {
        Answer::Later(status, problem) => assert!(is_storage(status, &problem), "{status} {problem:?}"),
        other => panic!("there is no bucket, and the answer was {other:?}"),
    }
    bucket.come_back().await;
    let began = Instant::now();
    while push(&client, &urls[1], "hall", "r1", 2).await.done().is_none() {
        assert!(began.elapsed() < HEALED, "it does not heal by itself");
    }
    tell(&format!(
        "bucket away: 503 with Retry-After; healed {:.2} s after",
        began.elapsed().as_secs_f64()
    ));

    assert!(is_healthy(&urls[0]));
    let [first, second] = replicas;
    first.kill();
    assert!(!is_healthy(&urls[0]), "a health check that cannot fail");
    let pushed = push(&client, &urls[1], "hall", "r1", 3)
        .await
        .done()
        .expect("is taken in");
    ended_job(&client, &urls[1], pushed.job.expect("a job")).await;
    let versions: Page<VersionSummary> = read(&client, format!("{}/v1/sessions/hall/versions", urls[1])).await;
    assert!(versions.items.len() >= 2);
    drop(second);
}

/// The image's command in the environment that `compose.yaml` gives it.
fn container(home: &Home, database: &Database, bucket: &Bucket) -> Command {
    let words = exec_form(|line| line.starts_with("CMD ["));
    assert_eq!(words[0], "mapweld");
    let mut command = Command::new(env!("CARGO_BIN_EXE_mapweld"));
    command.args(words[1..].iter().map(|word| word.replace(":8080", ":0")));
    let mut here: BTreeMap<String, String> = bucket.settings().into_iter().collect();
    here.insert("MAPWELD_DATABASE_URL".to_owned(), database.url());
    for (name, value) in compose_environment() {
        // what names a host or a password of the container's network stands for the one here
        let value = if value.contains("${") || value.contains("://garage") {
            here.get(&name)
                .unwrap_or_else(|| panic!("{name}={value} has nothing here to stand for it"))
                .clone()
        } else {
            value
        };
        command.env(name, value);
    }
    // the image's own variables
    assert!(DOCKERFILE.contains("\nENV MAPWELD_DATA="));
    command.env("MAPWELD_DATA", home.path().join("data"));
    command
}

fn compose_environment() -> BTreeMap<String, String> {
    let compose: serde_json::Value = serde_saphyr::from_str(COMPOSE).expect("compose.yaml is YAML");
    let environment = compose["services"]["mapweld"]["environment"].clone();
    serde_json::from_value(environment).expect("texts by name")
}

/// Whether the image's health check is content.
fn is_healthy(url: &str) -> bool {
    let port = url.rsplit_once(':').expect("a port").1;
    let words = exec_form(|line| line.starts_with("    CMD ["));
    let checked = Command::new(&words[0])
        .args(words[1..].iter().map(|word| word.replace("8080", port)))
        .output()
        .expect("the check runs");
    checked.status.success()
}

/// The words of the one instruction in exec form that begins like this.
fn exec_form(begins: impl Fn(&str) -> bool) -> Vec<String> {
    let mut found = DOCKERFILE.lines().filter(|line| begins(line));
    let (line, more) = (found.next().expect("the instruction"), found.next());
    assert_eq!(more, None, "one of a kind");
    serde_json::from_str(&line[line.find('[').expect("a list")..]).expect("a list of texts")
}

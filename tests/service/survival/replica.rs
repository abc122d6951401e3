//! One server over a home, with the signals that befall it, and what a robot hears of it.

use std::fs::File;
use std::io::{BufRead as _, BufReader};
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use mapweld::api::{Job, Problem, ProblemCode, Pushed};
use reqwest::{Client, RequestBuilder, Response, StatusCode};
use serde::de::DeserializeOwned;

use super::PATIENCE;
use super::home::Home;
use crate::http::rooms::{Files, scrap};

/// A server in a process of its own; killed when it is dropped.
pub(super) struct Replica {
    child: Child,
    url: String,
    /// Kept open: a server that cannot say a word would end.
    _stdout: BufReader<ChildStdout>,
}

impl Replica {
    /// A server over this home; nothing when it ended before it listened, as a failpoint may have it.
    pub(super) fn start(home: &Home, options: &[&str], failpoint: Option<&str>) -> Option<Self> {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mapweld"));
        command.args(Self::arguments(home, options));
        if let Some(order) = failpoint {
            command.env("MAPWELD_FAILPOINT", order);
        }
        Self::spawn(command, home)
    }

    /// A server that must come up.
    pub(super) fn up(home: &Home, options: &[&str]) -> Self {
        Self::start(home, options, None).unwrap_or_else(|| {
            let log = std::fs::read_to_string(home.log()).unwrap_or_default();
            let tail: Vec<&str> = log.lines().rev().take(20).collect();
            panic!(
                "the server does not come up; the last of its log, backwards:\n{}",
                tail.join("\n")
            );
        })
    }

    /// What follows the program's name.
    pub(super) fn arguments(home: &Home, options: &[&str]) -> Vec<String> {
        let mut arguments: Vec<String> = ["serve", "--listen", "127.0.0.1:0", "--log", "mapweld=info"]
            .map(str::to_owned)
            .to_vec();
        arguments.extend(home.arguments());
        arguments.extend(options.iter().map(|option| (*option).to_owned()));
        arguments
    }

    /// Runs a command that ends up as a server.
    pub(super) fn spawn(mut command: Command, home: &Home) -> Option<Self> {
        let log = File::options()
            .create(true)
            .append(true)
            .open(home.log())
            .expect("a log");
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(log)
            .spawn()
            .expect("the program starts");
        let mut stdout = BufReader::new(child.stdout.take().expect("it is piped"));
        let mut line = String::new();
        stdout.read_line(&mut line).expect("it can be read");
        let Some(url) = line.trim().strip_prefix("listening on ") else {
            child.wait().expect("it can be waited for");
            return None;
        };
        Some(Self {
            url: url.to_owned(),
            child,
            _stdout: stdout,
        })
    }

    pub(super) fn url(&self) -> &str {
        &self.url
    }

    pub(super) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Sends `TERM`, `STOP` or `CONT`.
    pub(super) fn signal(&self, name: &str) {
        let told = Command::new("kill")
            .args([&format!("-{name}"), &self.pid().to_string()])
            .status()
            .expect("kill runs");
        assert!(told.success(), "the server is there to be sent {name}");
    }

    /// Sends `KILL` and waits until nothing is left.
    pub(super) fn kill(mut self) {
        self.end();
    }

    /// How it ended, if it did so within this time.
    pub(super) async fn ended(&mut self, within: Duration) -> Option<ExitStatus> {
        let deadline = Instant::now() + within;
        loop {
            if let Some(status) = self.child.try_wait().expect("it can be waited for") {
                return Some(status);
            }
            if Instant::now() >= deadline {
                return None;
            }
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }

    /// Whether it stands still.
    pub(super) fn is_stopped(&self) -> bool {
        let path = format!("/proc/{}/stat", self.pid());
        let stat = std::fs::read_to_string(path).unwrap_or_default();
        // the state follows the name, which stands in parentheses
        stat.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with('T'))
    }

    fn end(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for Replica {
    fn drop(&mut self) {
        self.end();
    }
}

/// What came of a request.
#[derive(Debug)]
pub(super) enum Answer<T> {
    /// A 2xx, whole.
    Done(T),
    /// A refusal that says when to come again.
    Later(StatusCode, Problem),
    /// No answer, or half of one: the server, or the way to it, is gone.
    Broken(String),
}

impl<T> Answer<T> {
    pub(super) fn done(self) -> Option<T> {
        match self {
            Self::Done(value) => Some(value),
            _ => None,
        }
    }
}

/// A client that gives up after a while.
pub(super) fn client() -> Client {
    Client::builder()
        .timeout(Duration::from_secs(20))
        .build()
        .expect("a client")
}

/// Sends a request. Any answer but a 2xx and a refusal with `Retry-After` is a failure of the test.
pub(super) async fn ask<T: DeserializeOwned>(request: RequestBuilder) -> Answer<T> {
    let response = match request.send().await {
        Ok(response) => response,
        Err(error) => return Answer::Broken(format!("{error:?}")),
    };
    let (status, url) = (response.status(), response.url().clone());
    let later = response.headers().contains_key("retry-after");
    let text = match response.text().await {
        Ok(text) => text,
        Err(error) => return Answer::Broken(format!("{error:?}")),
    };
    if status.is_success() {
        return Answer::Done(serde_json::from_str(&text).unwrap_or_else(|error| panic!("{url}: {error}: {text}")));
    }
    let problem: Problem =
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{url}: {status}: {error}: {text}"));
    assert!(
        matches!(status, StatusCode::SERVICE_UNAVAILABLE | StatusCode::TOO_MANY_REQUESTS) && later,
        "{url}: {status}, Retry-After {later}: {text}"
    );
    Answer::Later(status, problem)
}

/// Whether the storage was to blame.
pub(super) fn is_storage(status: StatusCode, problem: &Problem) -> bool {
    status == StatusCode::SERVICE_UNAVAILABLE && problem.code == ProblemCode::StorageUnavailable
}

/// Pushes the small map of this seed.
pub(super) async fn push(client: &Client, url: &str, session: &str, robot: &str, seed: u32) -> Answer<Pushed> {
    let form = Files::of("m", &scrap(seed)).form();
    let url = format!("{url}/v1/sessions/{session}/robots/{robot}/maps");
    let named = client
        .post(url)
        .header("idempotency-key", format!("{session}-{robot}-{seed}"));
    ask(named.multipart(form)).await
}

/// Asks for a merge.
pub(super) async fn merge(client: &Client, url: &str, session: &str) -> Answer<Job> {
    let request = client.post(format!("{url}/v1/sessions/{session}/merges"));
    ask(request.header("content-type", "application/json").body("{}")).await
}

/// What a server that is well answers.
pub(super) async fn read<T: DeserializeOwned>(client: &Client, url: String) -> T {
    let answer = client
        .get(&url)
        .send()
        .await
        .unwrap_or_else(|error| panic!("{url}: {error:?}"));
    let text = text_of(answer).await;
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{url}: {error}: {text}"))
}

/// The body of a success.
pub(super) async fn text_of(answer: Response) -> String {
    let (status, url) = (answer.status(), answer.url().clone());
    let text = answer.text().await.expect("a body");
    assert!(status.is_success(), "{url}: {status}: {text}");
    text
}

/// The job when it has ended; it must.
pub(super) async fn ended_job(client: &Client, url: &str, id: impl std::fmt::Display) -> Job {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let job: Job = read(client, format!("{url}/v1/jobs/{id}?wait=10")).await;
        if job.state.is_terminal() {
            return job;
        }
        assert!(Instant::now() < deadline, "the job is stuck: {job:?}");
    }
}

//! The real binary on a free port, with a folder of its own.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use mapweld::api::{Job, Problem, Pushed};
use reqwest::multipart::{Form, Part};
use reqwest::{Client, RequestBuilder, Response, StatusCode};
use serde::de::DeserializeOwned;
use tempfile::TempDir;

use super::rooms::Files;

/// Longest time for anything that a test waits for.
pub(crate) const PATIENCE: Duration = Duration::from_mins(1);

/// A server in a process of its own; killed when it is dropped.
pub(crate) struct TestServer {
    child: Child,
    url: String,
    client: Client,
    folder: TempDir,
    log: Arc<Mutex<Vec<String>>>,
}

impl TestServer {
    /// A server with these options besides its port and folder.
    pub(crate) fn start(options: &[&str]) -> Self {
        Self::start_in(tempfile::tempdir().expect("a folder"), options)
    }

    /// A server over a folder that was used before.
    pub(crate) fn start_in(folder: TempDir, options: &[&str]) -> Self {
        let command = command(folder.path(), options);
        Self::started(command, folder)
    }

    /// A server with these variables.
    #[cfg(feature = "otel")]
    pub(crate) fn start_with(options: &[&str], variables: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let mut command = command(folder.path(), options);
        command.envs(variables.iter().copied());
        Self::started(command, folder)
    }

    fn started(mut command: Command, folder: TempDir) -> Self {
        let mut child = command.spawn().expect("the binary starts");
        let mut line = String::new();
        let stdout = child.stdout.take().expect("it is piped");
        BufReader::new(stdout).read_line(&mut line).expect("it can be read");
        let Some(url) = line.trim().strip_prefix("listening on ") else {
            let mut errors = String::new();
            let stderr = child.stderr.as_mut().expect("it is piped");
            stderr.read_to_string(&mut errors).expect("it can be read");
            panic!("the server says {line:?} and {errors}");
        };
        // read from here on: a full pipe would stop the server
        let log = Arc::new(Mutex::new(Vec::new()));
        let (lines, told) = (child.stderr.take().expect("it is piped"), Arc::clone(&log));
        std::thread::spawn(move || {
            for line in BufReader::new(lines).lines().map_while(Result::ok) {
                told.lock().expect("no panic").push(line);
            }
        });
        Self {
            url: url.to_owned(),
            child,
            client: Client::builder().timeout(PATIENCE).build().expect("a client"),
            folder,
            log,
        }
    }

    /// What is found in the first line of the log in which something is found; waits for it.
    pub(crate) async fn log_line<T>(&self, find: impl Fn(&str) -> Option<T>) -> T {
        let began = std::time::Instant::now();
        loop {
            let lines = self.log.lock().expect("no panic").clone();
            if let Some(found) = lines.iter().find_map(|line| find(line)) {
                return found;
            }
            assert!(began.elapsed() < PATIENCE, "no such line: {lines:#?}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    /// `127.0.0.1:PORT`.
    pub(crate) fn address(&self) -> &str {
        self.url.strip_prefix("http://").expect("an address")
    }

    pub(crate) fn url(&self, path: &str) -> String {
        format!("{}{path}", self.url)
    }

    pub(crate) fn get(&self, path: &str) -> RequestBuilder {
        self.client.get(self.url(path))
    }

    pub(crate) fn post(&self, path: &str) -> RequestBuilder {
        self.client.post(self.url(path))
    }

    pub(crate) fn put(&self, path: &str) -> RequestBuilder {
        self.client.put(self.url(path))
    }

    pub(crate) fn request(&self, method: &str, path: &str) -> RequestBuilder {
        let method = method.parse().expect("a method");
        self.client.request(method, self.url(path))
    }

    /// Bytes of memory that it has had at most (`VmHWM`).
    pub(crate) fn peak_memory(&self) -> u64 {
        peak_memory_of(self.child.id())
    }

    /// Where it keeps everything.
    pub(crate) fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// The JSON at a path.
    pub(crate) async fn read<T: DeserializeOwned>(&self, path: &str) -> T {
        json(self.get(path).send().await.expect("an answer")).await
    }

    /// Pushes a map as its two files.
    pub(crate) async fn push(&self, session: &str, robot: &str, files: &Files) -> (StatusCode, Pushed) {
        let path = format!("/v1/sessions/{session}/robots/{robot}/maps");
        let answer = self
            .post(&path)
            .multipart(files.form())
            .send()
            .await
            .expect("an answer");
        (answer.status(), json(answer).await)
    }

    /// The job when it has ended.
    pub(crate) async fn ended(&self, job: impl std::fmt::Display) -> Job {
        let job: Job = self.read(&format!("/v1/jobs/{job}?wait=60")).await;
        assert!(job.state.is_terminal(), "the job does not end: {job:?}");
        job
    }

    /// Sends SIGTERM and waits for the end.
    pub(crate) async fn terminate(mut self) -> (ExitStatus, TempDir) {
        let told = Command::new("kill")
            .args(["-TERM", &self.child.id().to_string()])
            .status()
            .expect("kill runs");
        assert!(told.success(), "the server is there to be told");
        let status = self.wait().await;
        (status, self.release())
    }

    /// Sends SIGKILL.
    pub(crate) async fn kill(mut self) -> TempDir {
        self.child.kill().expect("it is there to be killed");
        self.wait().await;
        self.release()
    }

    /// Waits until it ends, as a failpoint has it do.
    pub(crate) async fn ended_by_itself(mut self) -> TempDir {
        self.wait().await;
        self.release()
    }

    async fn wait(&mut self) -> ExitStatus {
        let child = std::mem::replace(&mut self.child, gone());
        let waited = tokio::task::spawn_blocking(move || {
            let mut child = child;
            child.wait().expect("it can be waited for")
        });
        let waited = tokio::time::timeout(PATIENCE, waited).await;
        waited.expect("the server ends in time").expect("no panic")
    }

    fn release(mut self) -> TempDir {
        std::mem::replace(&mut self.folder, tempfile::tempdir().expect("a folder"))
    }
}

impl Drop for TestServer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Bytes of memory that a process has had at most (`VmHWM`).
pub(crate) fn peak_memory_of(process: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).expect("Linux tells of its processes");
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = line.and_then(|line| line.trim().strip_suffix(" kB"));
    kilobytes.and_then(|number| number.parse::<u64>().ok()).expect("kB") << 10
}

/// A process that has ended already.
fn gone() -> Child {
    let mut child = Command::new("true").spawn().expect("true runs");
    child.wait().expect("it ends");
    child
}

/// `mapweld serve` on a free port over this folder.
pub(crate) fn command(folder: &Path, options: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mapweld"));
    command
        .args(["serve", "--listen", "127.0.0.1:0", "--data"])
        .arg(folder)
        // a variable: options may say otherwise
        .env("MAPWELD_LOG", "info")
        .args(options)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

impl Files {
    /// As curl's `-F map=@NAME.yaml -F image=@NAME.pgm`.
    pub(crate) fn form(&self) -> Form {
        self.add_to(Form::new())
    }

    /// One more map of a form.
    pub(crate) fn add_to(&self, form: Form) -> Form {
        let part = |bytes: &[u8], name: &str| Part::bytes(bytes.to_vec()).file_name(name.to_owned());
        form.part("map", part(&self.yaml, &self.yaml_name))
            .part("image", part(&self.image, &self.image_name))
    }
}

/// The body of a success, parsed.
pub(crate) async fn json<T: DeserializeOwned>(answer: Response) -> T {
    let (status, url) = (answer.status(), answer.url().clone());
    let text = answer.text().await.expect("a body");
    assert!(status.is_success(), "{url}: {status}: {text}");
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{url}: {error}: {text}"))
}

/// The problem that a request is answered with; looks at all that every problem has.
pub(crate) async fn problem(request: RequestBuilder) -> Problem {
    let answer = request.send().await.expect("an answer");
    let (status, headers) = (answer.status(), answer.headers().clone());
    let text = answer.text().await.expect("a body");
    assert!(status.as_u16() >= 400, "{status}: {text}");
    assert_eq!(headers["content-type"], "application/problem+json", "{text}");
    let problem: Problem = serde_json::from_str(&text).expect("a problem");
    assert_eq!(problem.status, status.as_u16(), "{text}");
    assert_eq!(headers["x-request-id"], problem.request_id.as_str());
    assert!(
        problem.instance.is_some() && !problem.detail.is_empty() && !problem.title.is_empty(),
        "{text}"
    );
    problem
}

//! The page in a real browser: what somebody sees who opens it and lets it stand.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use fantoccini::{Client, ClientBuilder, Locator};
use hyper_util::client::legacy::connect::HttpConnector;
use serde_json::{Value, json};

use super::rooms::{Files, scrap, three_robots};
use super::server::{PATIENCE, TestServer};
use crate::skipped::skipped;

/// A browser without a window, by its driver; both end with it.
struct Browser {
    driver: Child,
    port: u16,
    client: Client,
    session: String,
    /// What driver and browser leave behind, until it is dropped.
    _folder: tempfile::TempDir,
}

impl Browser {
    /// Nothing, and a word about it, when this machine has no browser.
    async fn start() -> Option<Self> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let Ok(mut driver) = Command::new("chromedriver")
            .arg("--port=0")
            .env("TMPDIR", folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
        else {
            skipped("every test of the page in a browser", "chromium-driver");
            return None;
        };
        let mut lines = BufReader::new(driver.stdout.take().expect("it is piped")).lines();
        let port = lines.by_ref().map_while(Result::ok).find_map(|line| {
            let (_, port) = line.split_once("successfully on port ")?;
            port.trim_end_matches('.').parse::<u16>().ok()
        });
        let port = port.expect("the driver tells its port");
        // a full pipe would stop it
        std::thread::spawn(move || lines.for_each(drop));
        let wishes = json!({
            // as root, in a container, and with little shared memory
            "goog:chromeOptions": {
                "args": ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu", "--window-size=1280,1400"]
            },
            "goog:loggingPrefs": { "browser": "ALL" }
        });
        let Value::Object(wishes) = wishes else {
            unreachable!("an object stands above")
        };
        let client = ClientBuilder::new(HttpConnector::new())
            .capabilities(wishes)
            .connect(&format!("http://127.0.0.1:{port}"))
            .await
            .expect("the driver starts a browser");
        let session = client.session_id().await.expect("an answer").expect("a session");
        let browser = Self {
            driver,
            port,
            client,
            session,
            _folder: folder,
        };
        browser.run("console.error('heard');").await;
        assert_eq!(browser.complaints().await.len(), 1, "complaints are heard");
        Some(browser)
    }

    async fn open(&self, server: &TestServer, path: &str) {
        self.client.goto(&server.url(path)).await.expect("the page loads");
    }

    /// The text of an element as it is seen; empty when it is hidden.
    async fn text(&self, id: &str) -> String {
        let element = self.client.find(Locator::Id(id)).await.expect("it is on the page");
        element.text().await.expect("it has a text")
    }

    /// Waits until an element reads like this.
    async fn reads(&self, id: &str, wanted: impl Fn(&str) -> bool) -> String {
        let began = Instant::now();
        loop {
            let text = self.text(id).await;
            if wanted(&text) {
                return text;
            }
            assert!(began.elapsed() < PATIENCE, "{id} reads {text:?}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    async fn click(&self, id: &str) {
        let element = self.client.find(Locator::Id(id)).await.expect("it is on the page");
        element.click().await.expect("it can be clicked");
    }

    async fn run(&self, script: &str) -> Value {
        self.client.execute(script, Vec::new()).await.expect("the script runs")
    }

    /// What the browser complains of: errors of scripts, refusals by the content policy, files that are not there.
    async fn complaints(&self) -> Vec<Value> {
        let path = format!("http://127.0.0.1:{}/session/{}/se/log", self.port, self.session);
        let asked = reqwest::Client::new().post(path).json(&json!({ "type": "browser" }));
        let told: Value = asked.send().await.expect("an answer").json().await.expect("JSON");
        told["value"].as_array().expect("a list").clone()
    }

    async fn end(self) {
        assert_eq!(self.complaints().await, Vec::<Value>::new());
    }
}

impl Drop for Browser {
    /// The driver ends its browser, and removes its folder, when its session ends; not when it is killed itself.
    fn drop(&mut self) {
        let end_of_session = || -> std::io::Result<()> {
            let mut socket = TcpStream::connect(("127.0.0.1", self.port))?;
            socket.set_read_timeout(Some(PATIENCE))?;
            write!(
                socket,
                "DELETE /session/{} HTTP/1.1\r\nhost: 127.0.0.1\r\nconnection: close\r\n\r\n",
                self.session
            )?;
            socket.read_exact(&mut [0; 12]) // answered once it is gone; the connection stays
        };
        let ended = end_of_session();
        let _ = self.driver.kill();
        let _ = self.driver.wait();
        if !std::thread::panicking() {
            ended.expect("the driver ends its session");
        }
    }
}

#[tokio::test]
async fn the_page_follows_a_session_from_nothing_to_its_newest_version_and_back() {
    let Some(browser) = Browser::start().await else { return };
    let server = TestServer::start(&["--workers", "1", "--threads", "1"]);
    browser.open(&server, "/").await;
    browser
        .reads("no-sessions", |text| text.starts_with("No session yet"))
        .await;
    let example = browser.text("example").await;
    assert!(
        example.contains(&server.url("/v1/sessions/hall/robots/r1/maps")),
        "{example}"
    );

    // each version appears by itself
    let (maps, _) = three_robots();
    for (count, map) in maps.iter().enumerate() {
        let pushed = server.push("hall", &format!("r{count}"), &Files::of("m", map)).await.1;
        server.ended(pushed.job.expect("a job")).await;
        let count = count + 1;
        browser
            .reads("version", |text| text == format!("version {count} of {count}"))
            .await;
        let rows = browser.text("rows").await;
        let placed = rows.lines().filter(|row| row.contains(" placed ")).count();
        assert_eq!((placed, rows.contains("not placed")), (count, false), "{rows}");
    }
    let about = browser.reads("about", |text| text.starts_with("3 robots")).await;
    assert_eq!(about, "3 robots · 3 maps · anchor r0 · hough");
    assert_eq!(
        (browser.text("name").await.as_str(), browser.text("link").await.as_str()),
        ("hall", "live")
    );
    assert_eq!(browser.text("waiting").await, "");

    // a version of old stands while newer ones come
    browser.click("older").await;
    browser.reads("version", |text| text == "version 2 of 3").await;
    let pushed = server.push("hall", "r3", &Files::of("m", &scrap(1))).await.1;
    server.ended(pushed.job.expect("a job")).await;
    browser.reads("version", |text| text == "version 2 of 4").await;
    assert!(!browser.text("rows").await.contains("r3"));
    for number in [3, 4] {
        browser.click("newer").await;
        browser
            .reads("version", |text| text == format!("version {number} of 4"))
            .await;
    }

    // who was not placed stands there with the reason, and the picture and the files are there
    let rows = browser.text("rows").await;
    let last = rows.lines().find(|row| row.starts_with("r3 ")).expect("its row");
    assert!(last.contains("not placed"), "{last}");
    let version: Value = server.read("/v1/sessions/hall/versions/4").await;
    let reason = version["result"]["maps"][3]["reason"]["message"]
        .as_str()
        .expect("a reason");
    assert!(last.ends_with(reason), "{last}: {reason}");
    let overlay =
        "const image = document.getElementById('overlay'); return image.decode().then(() => image.naturalWidth);";
    assert!(browser.run(overlay).await.as_u64().is_some_and(|width| width > 100));
    let files = "return [...document.querySelectorAll('#files a')].map((link) => link.getAttribute('href'));";
    let files: Vec<String> = serde_json::from_value(browser.run(files).await).expect("addresses");
    assert_eq!(files.len(), 7);
    for file in files {
        let answer = server.get(&file).send().await.expect("an answer");
        assert!(answer.status().is_success(), "{file}: {}", answer.status());
    }
    browser.end().await;
}

#[tokio::test]
async fn what_strangers_have_written_is_text_on_the_page_and_a_link_leads_to_its_session() {
    let Some(browser) = Browser::start().await else { return };
    let server = TestServer::start(&["--workers", "0"]);
    let title = "<img src=x onerror=\"document.title = 'taken'\"><b>Ward</b>";
    for (session, title) in [("ward", title), ("hall", "Hall")] {
        let made = server
            .put(&format!("/v1/sessions/{session}"))
            .json(&json!({ "title": title }));
        assert!(made.send().await.expect("an answer").status().is_success());
    }
    browser.open(&server, "/#ward").await;
    browser.reads("name", |text| text == title).await;
    browser
        .reads("waiting", |text| text.starts_with("No version yet"))
        .await;
    assert!(browser.text("sessions").await.contains(title));
    let chosen = browser
        .client
        .find(Locator::XPath("//nav//strong[.='Hall'] | //aside//strong[.='Hall']"))
        .await
        .expect("a button");
    chosen.click().await.expect("it can be clicked");
    browser.reads("name", |text| text == "Hall").await;
    let address = browser.client.current_url().await.expect("an address");
    assert_eq!(address.fragment(), Some("hall"));
    assert_eq!(browser.client.title().await.expect("a title"), "mapweld");
    browser.end().await;
}

#[tokio::test]
async fn the_documents_page_shows_every_operation() {
    let Some(browser) = Browser::start().await else { return };
    let server = TestServer::start(&["--workers", "0"]);
    let document: Value = server.read("/openapi.json").await;
    let paths = document["paths"].as_object().expect("paths").values();
    let operations: usize = paths
        .map(|path| {
            let methods = path.as_object().expect("operations").keys();
            methods
                .filter(|method| ["get", "put", "post", "patch", "delete"].contains(&method.as_str()))
                .count()
        })
        .sum();
    browser.open(&server, "/docs/").await;
    let began = Instant::now();
    loop {
        let shown = browser
            .client
            .find_all(Locator::Css(".opblock"))
            .await
            .expect("a list")
            .len();
        if shown == operations {
            break;
        }
        assert!(began.elapsed() < PATIENCE, "{shown} of {operations}");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    browser.end().await;
}

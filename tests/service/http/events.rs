//! Server-sent events.

use mapweld::api::{Job, VersionSummary};
use mapweld::model::JobState;
use reqwest::{Response, StatusCode};

use super::rooms::{Files, scrap};
use super::server::{PATIENCE, TestServer};

/// The events of a stream.
struct Events {
    response: Response,
    text: String,
}

#[derive(Debug, Default)]
struct Event {
    name: String,
    id: String,
    data: String,
}

impl Events {
    async fn open(server: &TestServer, path: &str, last: Option<&str>) -> Self {
        let mut request = server.get(path);
        if let Some(last) = last {
            request = request.header("last-event-id", last);
        }
        let response = request.send().await.expect("an answer");
        assert_eq!(response.status(), StatusCode::OK);
        assert_eq!(response.headers()["content-type"], "text/event-stream");
        Self {
            response,
            text: String::new(),
        }
    }

    /// The next event; `None` when the stream ends.
    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some((block, rest)) = self.text.split_once("\n\n") {
                let (block, rest) = (block.to_owned(), rest.to_owned());
                self.text = rest;
                let mut event = Event::default();
                for line in block.lines() {
                    match line.split_once(':') {
                        Some(("event", value)) => value.trim().clone_into(&mut event.name),
                        Some(("id", value)) => value.trim().clone_into(&mut event.id),
                        Some(("data", value)) => event.data.push_str(value.trim()),
                        _ => {}
                    }
                }
                if !event.name.is_empty() {
                    return Some(event);
                }
                continue;
            }
            let chunk = tokio::time::timeout(PATIENCE, self.response.chunk()).await;
            let chunk = chunk.expect("an event in time").expect("the stream is whole")?;
            self.text.push_str(std::str::from_utf8(&chunk).expect("UTF-8"));
        }
    }

    /// The next event of this name.
    async fn next_named(&mut self, name: &str) -> Event {
        loop {
            let event = self.next().await.expect("the stream goes on");
            if event.name == name {
                return event;
            }
        }
    }
}

#[tokio::test]
async fn a_jobs_events_tell_every_state_and_end_with_it() {
    let server = TestServer::start(&["--workers", "0"]);
    let (_, pushed) = server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    let id = pushed.job.expect("a job");
    let path = format!("/v1/jobs/{id}/events");
    let mut events = Events::open(&server, &path, None).await;
    let state = |event: &Event| serde_json::from_str::<Job>(&event.data).expect("a job").state;
    assert_eq!(state(&events.next().await.expect("the first")), JobState::Queued);
    let cancel = server.post(&format!("/v1/jobs/{id}:cancel")).send().await;
    cancel.expect("an answer");
    let last = events.next().await.expect("the last");
    assert_eq!(state(&last), JobState::Cancelled);
    assert!(events.next().await.is_none(), "the stream ends with the job");

    let again = server.get(&path).header("last-event-id", &last.id).send().await;
    assert_eq!(again.expect("an answer").status(), StatusCode::NO_CONTENT);
}

#[tokio::test]
async fn a_sessions_events_tell_its_versions_and_none_is_missed_by_who_comes_back() {
    let server = TestServer::start(&[]);
    server.put("/v1/sessions/hall").send().await.expect("an answer");
    let mut events = Events::open(&server, "/v1/sessions/hall/events", None).await;
    events.next_named("session").await;
    server.push("hall", "r1", &Files::of("m", &scrap(1))).await;
    let number = |event: &Event| {
        let version: VersionSummary = serde_json::from_str(&event.data).expect("a version");
        version.number.get()
    };
    let first = events.next_named("version").await;
    assert_eq!((number(&first), first.id.as_str()), (1, "v1"));
    drop(events);
    for seed in [2, 3] {
        let (_, pushed) = server.push("hall", "r1", &Files::of("m", &scrap(seed))).await;
        server.ended(pushed.job.expect("a job")).await;
    }
    let mut events = Events::open(&server, "/v1/sessions/hall/events", Some("v1")).await;
    let missed = [events.next_named("version").await, events.next_named("version").await];
    assert_eq!(missed.map(|event| number(&event)), [2, 3]);
    let mut fresh = Events::open(&server, "/v1/sessions/hall/events", None).await;
    assert_eq!(number(&fresh.next_named("version").await), 3);
}

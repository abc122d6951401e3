//! One request, followed by its ids: through the log, to the job that it causes, and to a collector of spans.

use serde_json::Value;

use super::rooms::{Files, scrap};
use super::server::{TestServer, json};
use mapweld::api::Pushed;
use mapweld::model::JobState;

/// The example of the standard.
const TRACE: &str = "0af7651916cd43dd8448eb211c80319c";
const PARENT: &str = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";

/// Pushes a map and waits for its job.
async fn push(server: &TestServer, seed: u32, headers: &[(&str, &str)]) -> Pushed {
    let request = server.post("/v1/sessions/hall/robots/r1/maps");
    let request = request.multipart(Files::of("m", &scrap(seed)).form());
    let request = headers
        .iter()
        .fold(request, |request, (name, value)| request.header(*name, *value));
    let pushed: Pushed = json(request.send().await.expect("an answer")).await;
    let job = server.ended(pushed.job.expect("a job")).await;
    assert_eq!(job.state, JobState::Succeeded, "{job:?}");
    pushed
}

/// The line of the log that has these members, of the line itself or of its span.
async fn line(server: &TestServer, members: &[(&str, &str)]) -> Value {
    server
        .log_line(|line| {
            let line: Value = serde_json::from_str(line).expect("each line is JSON");
            let has = |(name, value): &(&str, &str)| line[name] == *value || line["span"][name] == *value;
            members.iter().all(has).then_some(line)
        })
        .await
}

#[tokio::test]
async fn the_log_tells_request_trace_and_job_of_what_one_request_has_caused() {
    let server = TestServer::start(&["--workers", "1", "--threads", "1", "--log-format", "json"]);
    let pushed = push(&server, 1, &[("x-request-id", "robot-7"), ("traceparent", PARENT)]).await;
    let job = pushed.job.expect("a job").to_string();
    let asked = line(&server, &[("operation", "push_map"), ("request_id", "robot-7")]).await;
    assert_eq!(
        (&asked["span"]["trace_id"], &asked["span"]["job"]),
        (&TRACE.into(), &job.as_str().into())
    );
    assert_eq!(asked["message"], "done");
    for message in ["job begins", "published"] {
        let told = line(&server, &[("message", message), ("job", &job)]).await;
        assert_eq!(told["span"]["trace_id"], TRACE, "{told}");
        assert_eq!(told["span"]["job"], job.as_str(), "{told}");
    }

    // what is no traceparent begins a trace of its own, and so does a request without one
    for (seed, headers) in [
        (2, &[("traceparent", "00-0-0-00"), ("x-request-id", "b")][..]),
        (3, &[("x-request-id", "c")]),
    ] {
        let pushed = push(&server, seed, headers).await;
        let job = pushed.job.expect("a job").to_string();
        let name = headers.last().map_or("", |(_, id)| *id);
        let request_id = if name == "c" { "c" } else { "b" };
        let asked = line(&server, &[("operation", "push_map"), ("request_id", request_id)]).await;
        let trace = asked["span"]["trace_id"].as_str().expect("a trace").to_owned();
        assert!(trace.len() == 32 && trace != TRACE, "{asked}");
        let begun = line(&server, &[("message", "job begins"), ("job", &job)]).await;
        assert_eq!(begun["span"]["trace_id"], trace.as_str());
    }
}

#[cfg(feature = "otel")]
mod collector {
    use std::collections::BTreeMap;
    use std::sync::{Arc, Mutex};

    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::net::{TcpListener, TcpStream};

    use super::*;

    /// Takes what is posted to `/v1/traces` as JSON.
    async fn collector() -> (String, Arc<Mutex<Vec<Value>>>) {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let url = format!("http://{}", listener.local_addr().expect("an address"));
        let taken = Arc::new(Mutex::new(Vec::new()));
        let all = Arc::clone(&taken);
        tokio::spawn(async move {
            loop {
                let (socket, _) = listener.accept().await.expect("a connection");
                tokio::spawn(take(socket, Arc::clone(&all)));
            }
        });
        (url, taken)
    }

    async fn take(mut socket: TcpStream, all: Arc<Mutex<Vec<Value>>>) {
        let (mut request, mut buffer) = (Vec::new(), vec![0; 65536]);
        loop {
            match socket.read(&mut buffer).await {
                Ok(0) | Err(_) => return,
                Ok(count) => request.extend_from_slice(&buffer[..count]),
            }
            let Some(end) = request.windows(4).position(|at| at == b"\r\n\r\n") else {
                continue;
            };
            let head = String::from_utf8_lossy(&request[..end]).to_lowercase();
            let length = head
                .lines()
                .find_map(|line| line.strip_prefix("content-length: ")?.parse().ok());
            let length: usize = length.expect("the exporter tells the length");
            if request.len() < end + 4 + length {
                continue;
            }
            assert!(head.starts_with("post /v1/traces "), "{head}");
            let body = serde_json::from_slice(&request[end + 4..end + 4 + length]).expect("JSON");
            all.lock().expect("no panic").push(body);
            request.drain(..end + 4 + length);
            let answer = "HTTP/1.1 200 OK\r\ncontent-type: application/json\r\ncontent-length: 2\r\n\r\n{}";
            socket.write_all(answer.as_bytes()).await.expect("it listens");
        }
    }

    /// All spans, by their names.
    fn spans(taken: &Mutex<Vec<Value>>) -> BTreeMap<String, Value> {
        let taken = taken.lock().expect("no panic");
        let each = |value: &Value, name: &str| value[name].as_array().cloned().unwrap_or_default();
        let resources = taken.iter().flat_map(|body| each(body, "resourceSpans"));
        let scopes = resources.flat_map(|resource| each(&resource, "scopeSpans"));
        let spans = scopes.flat_map(|scope| each(&scope, "spans"));
        spans
            .map(|span| (span["name"].as_str().unwrap_or_default().to_owned(), span))
            .collect()
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn spans_of_request_and_job_reach_a_collector_in_one_trace() {
        let (url, taken) = collector().await;
        let server = TestServer::start_with(
            &["--workers", "1", "--threads", "1", "--log", "error"],
            &[
                ("OTEL_EXPORTER_OTLP_ENDPOINT", &url),
                ("OTEL_EXPORTER_OTLP_PROTOCOL", "http/json"),
            ],
        );
        let pushed = push(&server, 1, &[("traceparent", PARENT)]).await;
        // what is not sent yet is sent at the end
        server.terminate().await;
        let spans = spans(&taken);
        let request = &spans["POST /v1/sessions/{session}/robots/{robot}/maps"];
        let job = &spans["job"];
        for span in [request, job] {
            assert_eq!(span["traceId"], TRACE, "{span}");
        }
        assert_eq!(request["parentSpanId"], "b7ad6b7169203331");
        assert_eq!(job["parentSpanId"], request["spanId"], "the job continues the request");
        let job_id = pushed.job.expect("a job").to_string();
        let text = job["attributes"].to_string();
        assert!(text.contains(&job_id), "{text}");
        let service = taken.lock().expect("no panic")[0]["resourceSpans"][0]["resource"].to_string();
        assert!(service.contains("mapweld"), "{service}");
    }
}

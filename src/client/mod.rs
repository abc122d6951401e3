//! The robot's side of the service: push a map, wait for the version, fetch it.
//!
//! Imports `model`, `api` and `clock`; nothing else of the server, for a robot needs a small binary. Every call is safe to
//! repeat (a push of the same content is the same map), so every call that may succeed later is tried again: with
//! exponential back-off, never sooner than the server's Retry-After asks, until [`Patience`] ends. Uploads tell their
//! digest, and what is fetched is held against its own.

mod error;
mod integrity;
mod retry;
mod spool;
#[cfg(test)]
mod tests;
mod upload;

pub use error::ClientError;
pub use retry::{Backoff, Patience};
pub use spool::{Recipient, Spool, SpoolError};
pub use upload::{FilePart, Upload};

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use bytes::{Bytes, BytesMut};
use futures_util::TryStreamExt as _;
use reqwest::header::{HeaderMap, HeaderValue};
use reqwest::{Method, RequestBuilder, StatusCode, Url, header, multipart};
use serde::de::DeserializeOwned;

use crate::api;
use crate::clock::{Ids as _, SystemIds};
use crate::model::{JobId, SessionId, SessionSettings, ShownKey, VersionSelector};

/// The longest that the server is asked to hold a question for a job.
const LONG_POLL: Duration = Duration::from_secs(20);
/// What an answer may take beyond what the request itself needs.
const ANSWER_WITHIN: Duration = Duration::from_secs(30);
/// The slowest link that an upload has to get through, in bytes a second.
const SLOWEST_LINK: usize = 16 << 10;

/// A connection to one server. Cheap to share by reference.
#[derive(Debug)]
pub struct Client {
    http: reqwest::Client,
    base: Url,
    patience: Patience,
    /// Shown with every request.
    key: Option<Credential>,
    /// Seeds of the back-off of each call, one after the other.
    seed: AtomicU64,
}

/// The value of `Authorization`. Sensitive: its `Debug` tells nothing.
#[derive(Debug)]
struct Credential(HeaderValue);

/// An answer of success, whole and undamaged.
struct Answer {
    status: StatusCode,
    body: Bytes,
}

/// A map on its way to the server.
struct Push {
    path: String,
    /// The server's `Idempotency-Key`: whichever attempt arrives first counts, and all are answered the same.
    name: String,
    content_type: String,
    digest: String,
    body: Bytes,
}

impl Push {
    fn request(&self, client: &Client) -> RequestBuilder {
        let seconds = (self.body.len() / SLOWEST_LINK) as u64;
        client
            .request(Method::POST, &self.path)
            .timeout(ANSWER_WITHIN + Duration::from_secs(seconds))
            .header(header::CONTENT_TYPE, &self.content_type)
            .header("content-digest", &self.digest)
            .header("idempotency-key", &self.name)
            .body(self.body.clone())
    }
}

impl Client {
    /// A client of the server at `server`, e.g. `http://127.0.0.1:8080`. `seed` decides only about the jitter of waits;
    /// robots should have different ones.
    ///
    /// # Errors
    /// When the address is no URL, or for https when the system has no certificates to trust.
    pub fn new(server: &str, patience: Patience, seed: u64) -> Result<Self, ClientError> {
        Self::trusting(server, patience, seed, None)
    }

    /// As [`Client::new`]; an https server must show a certificate that these, PEM, vouch for, whatever the system trusts.
    ///
    /// # Errors
    /// As [`Client::new`], and when there is no certificate in the text.
    pub fn trusting(
        server: &str,
        patience: Patience,
        seed: u64,
        authority: Option<&[u8]>,
    ) -> Result<Self, ClientError> {
        let bad = |detail: String| ClientError::BadServer {
            server: server.to_owned(),
            detail,
        };
        let mut base = Url::parse(server).map_err(|error| bad(error.to_string()))?;
        if !matches!(base.scheme(), "http" | "https") || base.host_str().is_none() {
            return Err(bad("the scheme or the host is missing".to_owned()));
        }
        if !base.path().ends_with('/') {
            base.set_path(&format!("{}/", base.path()));
        }
        let mut builder = reqwest::Client::builder()
            .user_agent(concat!("mapweld/", env!("CARGO_PKG_VERSION")))
            .connect_timeout(Duration::from_secs(5))
            // A redirected upload would be sent twice, or as a GET: the operator shall give the right address.
            .redirect(reqwest::redirect::Policy::none());
        if base.scheme() == "http" {
            // Plain HTTP works on a robot without any certificates installed.
            builder = builder.tls_certs_only([]);
        }
        if let Some(pem) = authority {
            let certificates = reqwest::Certificate::from_pem_bundle(pem).unwrap_or_default();
            if certificates.is_empty() {
                return Err(ClientError::BadAuthority);
            }
            builder = builder.tls_certs_only(certificates);
        }
        if base.host().is_some_and(is_loopback) {
            builder = builder.no_proxy();
        }
        let http = builder.build().map_err(|error| bad(causes(&error)))?;
        Ok(Self {
            http,
            base,
            patience,
            key: None,
            seed: AtomicU64::new(seed),
        })
    }

    /// The same client, which shows this key to the server.
    ///
    /// # Errors
    /// When the text is no key.
    pub fn with_key(self, key: &str) -> Result<Self, ClientError> {
        let key = ShownKey::parse(key.trim()).ok_or(ClientError::BadKey)?;
        let mut value = HeaderValue::try_from(format!("Bearer {}", key.reveal())).map_err(|_| ClientError::BadKey)?;
        value.set_sensitive(true);
        Ok(Self {
            key: Some(Credential(value)),
            ..self
        })
    }

    /// The server's address, with a slash at the end.
    #[must_use]
    pub fn server(&self) -> &str {
        self.base.as_str()
    }

    /// Makes a session with these settings, or finds it.
    ///
    /// # Errors
    /// [`ClientError::Refused`] when it exists with other settings.
    pub async fn put_session(
        &self,
        session: &SessionId,
        settings: &SessionSettings,
    ) -> Result<api::Session, ClientError> {
        let path = format!("v1/sessions/{session}");
        self.read(|| self.request(Method::PUT, &path).json(settings)).await
    }

    /// Pushes a map, trying again while that may help. The same content again is the same map.
    ///
    /// # Errors
    /// When the server refuses the map, or cannot be reached for longer than the patience lasts.
    pub async fn push_map(&self, to: &Recipient, upload: &Upload) -> Result<api::Pushed, ClientError> {
        let push = self.push(to, upload).await?;
        self.read(|| push.request(self)).await
    }

    /// Pushes a map in one attempt.
    ///
    /// # Errors
    /// As [`Client::push_map`]; [`ClientError::is_transient`] tells whether to try again.
    pub async fn push_map_once(&self, to: &Recipient, upload: &Upload) -> Result<api::Pushed, ClientError> {
        let push = self.push(to, upload).await?;
        self.decode(&self.attempt(push.request(self)).await?)
    }

    /// Waits until a job has ended, and gives the version that it published; `seen` is shown the job whenever it is
    /// looked at.
    ///
    /// # Errors
    /// [`ClientError::JobEnded`] when it failed or was cancelled.
    pub async fn wait_for_version(
        &self,
        job: JobId,
        mut seen: impl FnMut(&api::Job),
    ) -> Result<api::Version, ClientError> {
        let path = format!("v1/jobs/{job}?wait={}", LONG_POLL.as_secs());
        loop {
            let asked = || self.request(Method::GET, &path).timeout(LONG_POLL + ANSWER_WITHIN);
            let found: api::Job = self.read(asked).await?;
            seen(&found);
            if let Some(number) = found.version {
                return self.version(&found.session, VersionSelector::Number(number)).await;
            }
            if found.state.is_terminal() {
                let why = found.error.map(|error| format!(": {}", error.message));
                let ended = format!("{} without a version{}", found.state.as_str(), why.unwrap_or_default());
                return Err(ClientError::JobEnded { job, ended });
            }
        }
    }

    /// One version of a session.
    ///
    /// # Errors
    /// When there is no such version, or the server cannot be reached.
    pub async fn version(&self, session: &SessionId, which: VersionSelector) -> Result<api::Version, ClientError> {
        let path = format!("v1/sessions/{session}/versions/{which}");
        self.read(|| self.request(Method::GET, &path)).await
    }

    /// A file of a version, such as `map.png`, `map.yaml` or `overlay.png`.
    ///
    /// # Errors
    /// When there is no such version or file, or the server cannot be reached.
    pub async fn fetch(&self, session: &SessionId, which: VersionSelector, file: &str) -> Result<Bytes, ClientError> {
        let path = format!("v1/sessions/{session}/versions/{which}/{file}");
        Ok(self.call(|| self.request(Method::GET, &path)).await?.body)
    }

    /// Puts a push together: its attempts send the same bytes under the same name.
    async fn push(&self, to: &Recipient, upload: &Upload) -> Result<Push, ClientError> {
        let part = |file: &FilePart| {
            let length = file.content.len() as u64;
            multipart::Part::stream_with_length(file.content.clone(), length).file_name(file.name.clone())
        };
        let form = multipart::Form::new()
            .part("map", part(&upload.map))
            .part("image", part(&upload.image));
        let content_type = format!("multipart/form-data; boundary={}", form.boundary());
        let body: BytesMut = form
            .into_stream()
            .try_collect()
            .await
            .map_err(|error| self.unreachable(&error))?;
        Ok(Push {
            path: format!("v1/sessions/{}/robots/{}/maps", to.session, to.robot),
            name: SystemIds.next().to_string(),
            content_type,
            digest: integrity::told(&body),
            body: body.freeze(),
        })
    }

    fn request(&self, method: Method, path: &str) -> RequestBuilder {
        let url = self.base.join(path).expect("invariant: paths are made of parsed names");
        let request = self.http.request(method, url).timeout(ANSWER_WITHIN);
        match &self.key {
            Some(Credential(value)) => request.header(header::AUTHORIZATION, value.clone()),
            None => request,
        }
    }

    async fn read<T: DeserializeOwned>(&self, request: impl Fn() -> RequestBuilder) -> Result<T, ClientError> {
        self.decode(&self.call(request).await?)
    }

    /// Sends a request until it succeeds, is refused for good, or patience ends.
    async fn call(&self, request: impl Fn() -> RequestBuilder) -> Result<Answer, ClientError> {
        let mut backoff = Backoff::new(self.patience, self.seed.fetch_add(1, Ordering::Relaxed));
        loop {
            let error = match self.attempt(request()).await {
                Ok(answer) => return Ok(answer),
                Err(error) if error.is_transient() => error,
                Err(error) => return Err(error),
            };
            let Some(wait) = backoff.next_wait(error.retry_after()) else {
                return Err(ClientError::GaveUp {
                    attempts: backoff.attempts(),
                    last: Box::new(error),
                });
            };
            tracing::warn!("{error}; trying again in {:.1} s", wait.as_secs_f64());
            tokio::time::sleep(wait).await;
        }
    }

    async fn attempt(&self, request: RequestBuilder) -> Result<Answer, ClientError> {
        let response = request.send().await.map_err(|error| self.unreachable(&error))?;
        let (status, headers) = (response.status(), response.headers().clone());
        if status.is_success() {
            let body = response.bytes().await.map_err(|error| self.unreachable(&error))?;
            integrity::check(&headers, &body).map_err(|detail| ClientError::Damaged {
                server: self.base.to_string(),
                detail,
            })?;
            return Ok(Answer { status, body });
        }
        let retry_after = retry_after(&headers);
        let body = response.bytes().await.unwrap_or_default();
        Err(match serde_json::from_slice::<api::Problem>(&body) {
            Ok(problem) => ClientError::Refused {
                problem: Box::new(problem),
                retry_after,
            },
            Err(_) => ClientError::Foreign {
                server: self.base.to_string(),
                status: status.as_u16(),
                detail: beginning(&body),
                retry_after,
            },
        })
    }

    fn decode<T: DeserializeOwned>(&self, answer: &Answer) -> Result<T, ClientError> {
        serde_json::from_slice(&answer.body).map_err(|error| ClientError::Foreign {
            server: self.base.to_string(),
            status: answer.status.as_u16(),
            detail: format!("{error} in {}", beginning(&answer.body)),
            retry_after: None,
        })
    }

    fn unreachable(&self, error: &reqwest::Error) -> ClientError {
        ClientError::Unreachable {
            server: self.base.to_string(),
            detail: causes(error),
        }
    }
}

fn is_loopback(host: impl std::fmt::Display) -> bool {
    let host = host.to_string();
    let address = host
        .trim_start_matches('[')
        .trim_end_matches(']')
        .parse::<std::net::IpAddr>();
    host == "localhost" || address.is_ok_and(|address| address.is_loopback())
}

fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    retry::retry_after(text(header::RETRY_AFTER)?, text(header::DATE))
}

/// The innermost cause says what happened ("connection refused"); the outer ones only that something did.
fn causes(error: &reqwest::Error) -> String {
    let mut cause: &dyn std::error::Error = error;
    while let Some(inner) = cause.source() {
        cause = inner;
    }
    let what = if error.is_timeout() { "no answer in time: " } else { "" };
    format!("{what}{cause}")
}

fn beginning(body: &[u8]) -> String {
    String::from_utf8_lossy(body)
        .chars()
        .filter(|c| !c.is_control())
        .take(200)
        .collect()
}

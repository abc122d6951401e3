//! What every handler is given.

use std::ops::Deref;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;
use tracing::Instrument as _;

use super::auth::{Answers, Gate, RateLimit};
use super::error::{ApiError, ApiResult};
use super::load::Bound;
use crate::clock::{Clock, Ids};
use crate::codec::Limits;
use crate::compute::{Compute, RunControl};
use crate::config::ServeConfig;
use crate::store::{Blobs, Store};

/// The rooms behind the routes; cheap to clone.
#[derive(Clone)]
pub struct AppState(Arc<Inner>);

/// What is behind an [`AppState`].
pub struct Inner {
    /// Records and the queue.
    pub(super) store: Arc<dyn Store>,
    /// Bytes by their digest.
    pub(super) blobs: Blobs,
    /// Where everything that takes time is computed.
    pool: Compute,
    /// What time it is.
    pub(super) clock: Arc<dyn Clock>,
    /// New ids.
    pub(super) ids: Arc<dyn Ids>,
    /// Who may do what.
    pub(super) gate: Gate,
    /// What is taken in.
    pub(super) limits: HttpLimits,
    /// Whether a map makes its session.
    pub(super) auto_create: bool,
    /// Requests that work.
    pub(super) requests: Bound,
    /// Requests that wait for something to happen.
    pub(super) waiting: Bound,
    /// One-shot merges.
    pub(super) merges: Bound,
    /// A place for each upload that is held in memory.
    pub(super) uploads: Arc<Semaphore>,
    /// Told when the server is about to stop: who waits, stops waiting.
    pub(super) stop: CancellationToken,
}

/// What is taken in.
#[derive(Debug, Clone, Copy)]
pub(super) struct HttpLimits {
    /// Most bytes of a body.
    pub(super) body_bytes: u64,
    /// Longest time that a body may take to arrive.
    pub(super) body_time: Duration,
    /// What the decoders take in.
    pub(super) codec: Limits,
    /// Most maps of a one-shot merge.
    pub(super) maps: usize,
    /// Longest time of a one-shot merge.
    pub(super) merge_time: Duration,
    /// How long the answers to named requests are kept.
    pub(super) keep_answers: Duration,
}

/// The rooms that a server is made of.
pub struct Rooms {
    /// Records and the queue.
    pub store: Arc<dyn Store>,
    /// Bytes by their digest.
    pub blobs: Blobs,
    /// Where everything that takes time is computed.
    pub compute: Compute,
    /// What time it is.
    pub clock: Arc<dyn Clock>,
    /// New ids.
    pub ids: Arc<dyn Ids>,
    /// Most one-shot merges at one time.
    pub merges_at_once: u32,
    /// Told when the server is about to stop.
    pub stop: CancellationToken,
}

impl AppState {
    /// The state of a server with these settings.
    #[must_use]
    pub fn new(rooms: Rooms, config: &ServeConfig) -> Self {
        let rate = RateLimit::new(config.limits.key_rate, config.limits.key_burst);
        let answers = Answers::of(&super::openapi());
        Self(Arc::new(Inner {
            gate: Gate::new(answers, rate, config.insecure, config.is_beyond_loopback()),
            store: rooms.store,
            blobs: rooms.blobs,
            pool: rooms.compute,
            clock: rooms.clock,
            ids: rooms.ids,
            limits: HttpLimits {
                body_bytes: config.limits.max_body_bytes,
                body_time: config.limits.body_time,
                codec: config.limits.codec(),
                maps: config.limits.max_maps,
                merge_time: config.work.job_deadline,
                keep_answers: config.upkeep.keep_answers,
            },
            auto_create: !config.no_auto_create,
            requests: Bound::new("requests", "requests", config.limits.max_requests),
            waiting: Bound::new("event streams and long polls", "waiting", config.limits.max_waiting),
            merges: Bound::new("one-shot merges", "merges", rooms.merges_at_once),
            uploads: Arc::new(Semaphore::new(config.limits.max_uploads)),
            stop: rooms.stop,
        }))
    }

    /// Computes away from the threads that serve requests.
    pub(super) async fn compute<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> ApiResult<T> + Send + 'static,
    ) -> ApiResult<T> {
        self.pool.run(work).await.map_err(ApiError::internal)?
    }

    /// The control of a one-shot merge.
    pub(super) fn run_control(&self) -> RunControl {
        RunControl::start(Arc::clone(&self.clock), Some(self.limits.merge_time))
    }
}

/// Does the work to its end, also when the caller hangs up and nobody waits for it any more.
pub(super) async fn to_the_end<T: Send + 'static>(
    work: impl Future<Output = ApiResult<T>> + Send + 'static,
) -> ApiResult<T> {
    tokio::spawn(work.in_current_span()).await.map_err(ApiError::internal)?
}

impl Deref for AppState {
    type Target = Inner;
    fn deref(&self) -> &Inner {
        &self.0
    }
}

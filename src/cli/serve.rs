//! `mapweld serve`: the whole service in one process.

use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::pin::pin;
use std::sync::Arc;
use std::thread::available_parallelism;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use super::home::{open_blobs, open_store};
use super::runtime::{block_on, interrupted};
use super::{BadInput, Done, Failure, say};
use crate::clock::{Clock, SystemClock, SystemIds};
use crate::compute::Compute;
use crate::config::{LogFormat, ServeConfig};
use crate::failpoint;
use crate::http::{AppState, Door, Rooms, acceptor, app, listen};
use crate::meters;
use crate::store::{QueueLimits, Store};
use crate::telemetry;
use crate::worker::{Memory, Merges, Sweeper, Worker, WorkerSettings};

/// Serve the HTTP API, the page at / and the queue, from one folder.
#[derive(Debug, Args)]
pub(super) struct Serve {
    #[command(flatten)]
    config: ServeConfig,
}

impl Serve {
    pub(super) fn run(self) -> Result<Done, Failure> {
        let config = self.config;
        telemetry::init(&config.log, config.log_format == LogFormat::Json).bad_input(|| "--log")?;
        give_back_memory();
        block_on(async {
            let mut interrupted = pin!(interrupted());
            let server = tokio::select! {
                biased; // signals are heard before anybody is told that the server is up
                ended = &mut interrupted => return ended,
                server = Server::start(&config) => server?,
            };
            say(&format!("listening on {}", server.url()))?;
            interrupted.await?;
            server.stop().await;
            Ok(())
        })??;
        telemetry::finish();
        Ok(Done::Entirely)
    }
}

/// Has freed memory given back to the system soon, for as long as the process lives.
///
/// glibc lets its bounds grow with the blocks that it frees, so that after one large map up to 64 MB stay with the process:
/// the next large body would come on top of them, beyond the room that is promised. Bounds that are set stay as they are.
fn give_back_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    for (bound, bytes) in [(libc::M_MMAP_THRESHOLD, 4 << 20), (libc::M_TRIM_THRESHOLD, 8 << 20)] {
        #[expect(
            unsafe_code,
            reason = "sets a number of the allocator's own, under the allocator's own lock"
        )]
        // SAFETY: takes two numbers and touches no memory of ours; a bound that it does not take is answered by 0.
        let taken = unsafe { libc::mallopt(bound, bytes) };
        if taken == 0 {
            tracing::debug!(bound, bytes, "the allocator does not take a bound");
        }
    }
}

/// A server that runs in this process.
pub(super) struct Server {
    scheme: &'static str,
    address: SocketAddr,
    store: Arc<dyn Store>,
    stop: CancellationToken,
    listening: JoinHandle<()>,
    working: JoinHandle<()>,
    sweeping: JoinHandle<()>,
}

/// Longest time for requests in flight to finish once the server is told to stop.
const GRACE: Duration = Duration::from_secs(15);
/// Longest time for workers to give their jobs back; after that others take them over when the leases expire.
const GIVE_BACK: Duration = Duration::from_secs(20);
/// Maps whose features are remembered.
const MAPS_REMEMBERED: usize = 128;

impl Server {
    /// Opens the folder, takes up the work that is queued in it, and listens.
    pub(super) async fn start(config: &ServeConfig) -> Result<Self, Failure> {
        let limits = QueueLimits {
            per_session: config.limits.max_queued_per_session,
            total: config.limits.max_queued,
            max_attempts: config.work.max_attempts,
        };
        if let Some(order) = config.failpoint {
            failpoint::arm(order).bad_input(|| "--failpoint")?;
        }
        meters::install().context("cannot measure")?;
        let store = open_store(config, limits).await?;
        let has_keys = store.has_keys().await.context("cannot look for keys")?;
        config.check_listen(has_keys).bad_input(|| "--listen")?;
        let listener = TcpListener::bind(config.listen)
            .await
            .bad_input(|| format!("cannot listen on {}", config.listen))?;
        let address = listener.local_addr().context("the socket has no address")?;
        let tls = match (&config.tls_cert, &config.tls_key) {
            (Some(certificate), Some(key)) => Some(acceptor(certificate, key).bad_input(|| "--tls-cert")?),
            _ => None,
        };
        let scheme = if tls.is_some() { "https" } else { "http" };
        if tls.is_none() && config.is_beyond_loopback() && !config.insecure {
            tracing::warn!("keys and maps pass the network in the clear: give --tls-cert, or a proxy that encrypts");
        }
        let processors = available_parallelism().unwrap_or(NonZeroUsize::MIN);
        let workers = config.work.workers.unwrap_or(processors.get());
        let threads = config.work.threads.and_then(NonZeroUsize::new).unwrap_or(processors);
        let merges_at_once = config
            .limits
            .max_merges
            .unwrap_or(u32::try_from(processors.get()).unwrap_or(u32::MAX));
        let rooms = Rooms {
            merges_at_once,
            store: Arc::clone(&store),
            blobs: open_blobs(config)?,
            // requests find a place while every worker computes
            compute: Compute::new(
                threads,
                threads.saturating_add(workers).saturating_add(merges_at_once as usize),
            )
            .context("cannot start threads")?,
            clock: Arc::new(SystemClock::new()),
            ids: Arc::new(SystemIds),
            stop: CancellationToken::new(),
        };
        let stop = rooms.stop.clone();
        let sweeper = Sweeper {
            store: Arc::clone(&rooms.store),
            blobs: rooms.blobs.clone(),
            clock: Arc::clone(&rooms.clock),
            keep_versions: config.upkeep.keep_versions,
            keep_jobs: config.upkeep.keep_jobs,
            grace: config.upkeep.blob_grace,
        };
        let (every, stop_sweeping) = (config.upkeep.sweep_every, stop.clone());
        let sweeping = tokio::spawn(async move { sweeper.run(every, &stop_sweeping).await });
        let working = match NonZeroUsize::new(workers) {
            Some(at_once) => tokio::spawn(work(worker(&rooms, config, at_once), stop.clone())),
            None => tokio::spawn(async {}),
        };
        let door = Door {
            connections: config.limits.max_connections,
            head_time: config.limits.head_time,
            grace: GRACE,
            tls,
        };
        let listening = listen(listener, app(AppState::new(rooms, config)), stop.clone(), door);
        Ok(Self {
            scheme,
            address,
            store,
            stop,
            listening: tokio::spawn(listening),
            working,
            sweeping,
        })
    }

    /// Where it is reached.
    pub(super) fn url(&self) -> String {
        format!("{}://{}", self.scheme, self.address)
    }

    /// Takes no more requests, finishes those in flight, gives jobs back to the queue, and closes the folder.
    pub(super) async fn stop(self) {
        tracing::info!("stopping");
        self.stop.cancel();
        let (listening, working, sweeping) = tokio::join!(self.listening, self.working, self.sweeping);
        for ended in [listening, working, sweeping] {
            if let Err(error) = ended {
                tracing::error!(%error, "a part of the server ended in disorder");
            }
        }
        self.store.close().await;
        tracing::info!("stopped");
    }
}

fn worker(rooms: &Rooms, config: &ServeConfig, at_once: NonZeroUsize) -> Worker {
    let merges = Merges {
        store: Arc::clone(&rooms.store),
        blobs: rooms.blobs.clone(),
        compute: rooms.compute.clone(),
        memory: Memory::new(MAPS_REMEMBERED),
        cells_max: config.limits.max_cells,
    };
    let settings = WorkerSettings {
        at_once,
        lease: config.work.lease,
        deadline: config.work.job_deadline,
        ..WorkerSettings::new(name())
    };
    let clock: Arc<dyn Clock> = Arc::clone(&rooms.clock);
    Worker::new(Arc::clone(&rooms.store), Arc::new(merges), clock, settings)
}

/// What this process is called in the queue. In containers the number alone is the same for all.
fn name() -> String {
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    format!("mapweld-{}-{}", host.trim(), std::process::id())
}

async fn work(worker: Worker, stop: CancellationToken) {
    let late = async {
        stop.cancelled().await;
        tokio::time::sleep(GIVE_BACK).await;
    };
    tokio::select! {
        () = worker.run(stop.clone()) => {}
        () = late => tracing::warn!("a job did not stop in time: it is begun again when its lease expires"),
    }
}

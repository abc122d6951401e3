//! An S3 bucket keeps the contract, and what only a bucket promises. The S3 store runs in this process.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use bytes::Bytes;
use hyper::server::conn::http1;
use hyper_util::rt::TokioIo;
use mapweld::store::{Blobs, StoreError};
use s3s::auth::SimpleAuth;
use s3s::service::{S3Service, S3ServiceBuilder};
use s3s_fs::FileSystem;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::task::JoinSet;
use tokio_util::task::AbortOnDropHandle;

use super::{Place, contract};

const KEY: &str = "GK31c2f218a2e44f485b94239e";
const SECRET: &str = "b892c0665f0ada8a4755dae98baa3b133590e11dae3bcc1f9d769d67f16c3835";

/// An S3 store over a folder, which can be away for a while.
pub(crate) struct Bucket {
    name: &'static str,
    folder: TempDir,
    port: u16,
    service: S3Service,
    serving: Option<AbortOnDropHandle<()>>,
}

impl Bucket {
    /// A store with an empty bucket of this name.
    pub(crate) async fn start(name: &'static str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::create_dir(folder.path().join(name)).expect("a bucket");
        let mut builder = S3ServiceBuilder::new(FileSystem::new(folder.path()).expect("a folder"));
        builder.set_auth(SimpleAuth::from_single(KEY, SECRET));
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let port = listener.local_addr().expect("an address").port();
        let service = builder.build();
        let serving = Some(serve(listener, service.clone()));
        Self {
            name,
            folder,
            port,
            service,
            serving,
        }
    }

    /// The variables that lead to it, except which bucket.
    pub(crate) fn settings(&self) -> Vec<(String, String)> {
        [
            ("AWS_ENDPOINT_URL", format!("http://127.0.0.1:{}", self.port)),
            ("AWS_REGION", "garage".to_owned()),
            ("AWS_ACCESS_KEY_ID", KEY.to_owned()),
            ("AWS_SECRET_ACCESS_KEY", SECRET.to_owned()),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .to_vec()
    }

    /// Where it keeps what has keys with this prefix.
    pub(crate) fn behind(&self, prefix: &str) -> PathBuf {
        self.folder.path().join(self.name).join(prefix)
    }

    /// Ends all connections and takes no more.
    pub(crate) fn leave(&mut self) {
        self.serving = None;
    }

    /// Serves again.
    pub(crate) async fn come_back(&mut self) {
        let listener = loop {
            // the connections of before keep the port for a moment
            match TcpListener::bind(("127.0.0.1", self.port)).await {
                Ok(listener) => break listener,
                Err(_) => tokio::time::sleep(Duration::from_millis(20)).await,
            }
        };
        self.serving = Some(serve(listener, self.service.clone()));
    }
}

fn serve(listener: TcpListener, service: S3Service) -> AbortOnDropHandle<()> {
    AbortOnDropHandle::new(tokio::spawn(async move {
        // they end with this task
        let mut connections = JoinSet::new();
        loop {
            let Ok((socket, _)) = listener.accept().await else {
                return;
            };
            let service = service.clone();
            connections.spawn(async move {
                let _ = http1::Builder::new()
                    .serve_connection(TokioIo::new(socket), service)
                    .await;
            });
        }
    }))
}

fn open(bucket: &Bucket, prefix: &str) -> Blobs {
    Blobs::open_bucket(bucket.name, prefix, bucket.settings()).expect("opens")
}

async fn fresh() -> Place {
    let bucket = Bucket::start("maps").await;
    Place {
        blobs: open(&bucket, "fleet/a"),
        behind: bucket.behind("fleet/a"),
        _keep: Box::new(bucket),
    }
}

contract!(fresh);

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_bucket_without_a_prefix_is_used_whole() {
    let bucket = Bucket::start("maps").await;
    let key = open(&bucket, "")
        .put(Bytes::from_static(b"cells"))
        .await
        .expect("is kept");
    assert!(bucket.behind("").join(key.to_string()).exists());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_bucket_that_is_away_or_refuses_our_keys_is_unavailable_and_soon_says_so() {
    let mut bucket = Bucket::start("maps").await;
    let blobs = open(&bucket, "fleet/a");
    let key = blobs.put(Bytes::from_static(b"cells")).await.expect("is kept");
    let mut strange = bucket.settings();
    strange[3].1 = SECRET.replace('b', "c");
    let stranger = Blobs::open_bucket("maps", "fleet/a", strange).expect("opens");
    assert!(matches!(stranger.get(key).await, Err(StoreError::Unavailable(_))));

    bucket.leave();
    let began = Instant::now();
    assert!(matches!(blobs.get(key).await, Err(StoreError::Unavailable(_))));
    assert!(matches!(
        blobs.put(Bytes::from_static(b"more")).await,
        Err(StoreError::Unavailable(_))
    ));
    assert!(began.elapsed() < Duration::from_secs(20), "{:?}", began.elapsed());
    bucket.come_back().await;
    assert_eq!(blobs.get(key).await.expect("is there"), "cells");
}

//! The listening socket: connections in, and a graceful end.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::http::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;
use tower::ServiceExt as _;

use super::auth::Peer;

/// Longest time for a request's head to arrive; also how long a connection may idle.
const HEAD_TIME: Duration = Duration::from_secs(30);
/// Most connections at one time; further ones wait in the socket's backlog.
const CONNECTIONS_MAX: usize = 1024;
/// For this long after it was told to stop the server goes on as before, while it says by `/readyz` that it will not: a
/// request that is on its way is answered, not met by a closed door.
const LINGER: Duration = Duration::from_millis(500);
/// After an accept that failed for want of file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Serves connections until [`LINGER`] after `stop`; then takes no new ones, lets the requests in flight finish for at
/// most `grace`, and cuts the rest off.
///
/// # Panics
/// Never: the count of connections is not closed.
pub async fn listen(listener: TcpListener, app: Router, stop: CancellationToken, grace: Duration) {
    let closing = CancellationToken::new();
    let door = closing.clone();
    tokio::spawn(async move {
        stop.cancelled().await;
        tokio::time::sleep(LINGER).await;
        door.cancel();
    });
    let connections = TaskTracker::new();
    let cut = CancellationToken::new();
    let places = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    loop {
        let accepted = async {
            let place = places
                .clone()
                .acquire_owned()
                .await
                .expect("invariant: it is never closed");
            (listener.accept().await, place)
        };
        let (socket, place) = tokio::select! {
            () = closing.cancelled() => break,
            accepted = accepted => accepted,
        };
        match socket {
            Ok((socket, peer)) => {
                let (app, closing, cut) = (app.clone(), closing.clone(), cut.clone());
                connections.spawn(async move {
                    tokio::select! {
                        () = connection(socket, Peer(peer), app, closing) => {}
                        () = cut.cancelled() => {}
                    }
                    drop(place);
                });
            }
            Err(error) => {
                tracing::warn!(%error, "cannot accept a connection");
                tokio::time::sleep(ACCEPT_PAUSE).await;
            }
        }
    }
    drop(listener);
    connections.close();
    if tokio::time::timeout(grace, connections.wait()).await.is_err() {
        tracing::warn!(
            open = connections.len(),
            "cutting off connections that did not end in time"
        );
        cut.cancel();
        connections.wait().await;
    }
}

async fn connection(socket: TcpStream, peer: Peer, app: Router, closing: CancellationToken) {
    let _ = socket.set_nodelay(true); // only a matter of speed
    let service = app.map_request(move |request: Request<Incoming>| {
        let mut request = request.map(Body::new);
        request.extensions_mut().insert(peer);
        request
    });
    let service = service.map_err(|never: Infallible| match never {});
    let mut connection = std::pin::pin!(
        http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(HEAD_TIME)
            .serve_connection(TokioIo::new(socket), TowerToHyperService::new(service))
    );
    let served = tokio::select! {
        served = connection.as_mut() => served,
        () = closing.cancelled() => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };
    if let Err(error) = served {
        tracing::trace!(%error, "connection ended");
    }
}

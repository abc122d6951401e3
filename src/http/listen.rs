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
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio_rustls::TlsAcceptor;
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;
use tower::ServiceExt as _;

use super::auth::Peer;
use super::load::Crowded;

/// How connections are taken in.
#[derive(Clone)]
pub struct Door {
    /// Most connections at one time.
    pub connections: u32,
    /// Longest time for a request's head to arrive; also how long a connection may idle.
    pub head_time: Duration,
    /// Longest time for requests in flight to finish once the server is told to stop.
    pub grace: Duration,
    /// Encrypts connections.
    pub tls: Option<TlsAcceptor>,
}

/// Connections beyond [`Door::connections`] that are answered one request, so that probes pass and others are told in
/// words; further ones wait in the socket's backlog.
const CROWD: usize = 64;
/// Longest time for a head on one of these.
const CROWD_HEAD_TIME: Duration = Duration::from_secs(2);
/// For this long after it was told to stop the server goes on as before, while it says by `/readyz` that it will not: a
/// request that is on its way is answered, not met by a closed door.
const LINGER: Duration = Duration::from_millis(500);
/// After an accept that failed for want of file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Serves connections until `LINGER` after `stop`; then takes no new ones, lets the requests in flight finish for at
/// most [`Door::grace`], and cuts the rest off.
///
/// # Panics
/// Never: the count of connections is not closed.
pub async fn listen(listener: TcpListener, app: Router, stop: CancellationToken, door: Door) {
    let closing = CancellationToken::new();
    let close = closing.clone();
    tokio::spawn(async move {
        stop.cancelled().await;
        tokio::time::sleep(LINGER).await;
        close.cancel();
    });
    let connections = TaskTracker::new();
    let cut = CancellationToken::new();
    let places = Arc::new(Semaphore::new(door.connections as usize));
    let crowd = Arc::new(Semaphore::new(CROWD));
    loop {
        let accepted = async {
            let socket = listener.accept().await;
            if let Ok(place) = Arc::clone(&places).try_acquire_owned() {
                (socket, place, None)
            } else {
                let place = Arc::clone(&crowd).acquire_owned().await;
                let most = door.connections;
                (socket, place.expect("invariant: never closed"), Some(Crowded { most }))
            }
        };
        let (socket, place, crowded) = tokio::select! {
            () = closing.cancelled() => break,
            accepted = accepted => accepted,
        };
        match socket {
            Ok((socket, peer)) => {
                let (app, door) = (app.clone(), door.clone());
                let (closing, cut) = (closing.clone(), cut.clone());
                let visitor = Visitor {
                    peer: Peer(peer),
                    crowded,
                };
                connections.spawn(async move {
                    tokio::select! {
                        () = connection(socket, visitor, app, closing, door) => {}
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
    if tokio::time::timeout(door.grace, connections.wait()).await.is_err() {
        tracing::warn!(
            open = connections.len(),
            "cutting off connections that did not end in time"
        );
        cut.cancel();
        connections.wait().await;
    }
}

/// Who has connected, and how crowded it is.
#[derive(Debug, Clone, Copy)]
struct Visitor {
    peer: Peer,
    crowded: Option<Crowded>,
}

async fn connection(socket: TcpStream, visitor: Visitor, app: Router, closing: CancellationToken, door: Door) {
    let _ = socket.set_nodelay(true); // only a matter of speed
    let head_time = match visitor.crowded {
        Some(_) => door.head_time.min(CROWD_HEAD_TIME),
        None => door.head_time,
    };
    let Some(tls) = door.tls else {
        return serve(socket, visitor, app, closing, head_time).await;
    };
    match tokio::time::timeout(head_time, tls.accept(socket)).await {
        Ok(Ok(encrypted)) => serve(encrypted, visitor, app, closing, head_time).await,
        Ok(Err(error)) => tracing::trace!(%error, "no encrypted connection"),
        Err(_) => tracing::trace!("no encrypted connection in time"),
    }
}

async fn serve(
    socket: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    visitor: Visitor,
    app: Router,
    closing: CancellationToken,
    head_time: Duration,
) {
    let service = app.map_request(move |request: Request<Incoming>| {
        let mut request = request.map(Body::new);
        request.extensions_mut().insert(visitor.peer);
        if let Some(crowded) = visitor.crowded {
            request.extensions_mut().insert(crowded);
        }
        request
    });
    let service = service.map_err(|never: Infallible| match never {});
    let mut connection = std::pin::pin!(
        http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(head_time)
            .keep_alive(visitor.crowded.is_none())
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

//! A way to the database that can be cut, silenced and slowed.

use std::path::{Path, PathBuf};
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream, UnixStream};
use tokio::sync::watch;
use tokio_util::task::AbortOnDropHandle;

/// How the way is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    /// As if it were not there.
    Open,
    /// Connections are cut, and new ones at once.
    Cut,
    /// Connections stay, and nothing comes through.
    Silent,
    /// Everything comes through, this much later.
    Slow(Duration),
}

/// A port of this machine that leads to a socket.
pub(super) struct Proxy {
    port: u16,
    way: watch::Sender<Way>,
    _accepting: AbortOnDropHandle<()>,
}

impl Proxy {
    /// A way that is open.
    pub(super) async fn to(socket: PathBuf) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let port = listener.local_addr().expect("an address").port();
        let (way, seen) = watch::channel(Way::Open);
        let accepting = tokio::spawn(async move {
            loop {
                let (client, _) = listener.accept().await.expect("a connection");
                let (socket, seen) = (socket.clone(), seen.clone());
                tokio::spawn(async move { connect(client, &socket, seen).await });
            }
        });
        Self {
            port,
            way,
            _accepting: AbortOnDropHandle::new(accepting),
        }
    }

    pub(super) fn port(&self) -> u16 {
        self.port
    }

    /// From now on the way is like this.
    pub(super) fn set(&self, way: Way) {
        self.way.send_replace(way);
    }
}

async fn connect(client: TcpStream, socket: &Path, seen: watch::Receiver<Way>) {
    if *seen.borrow() == Way::Cut {
        return;
    }
    let server = UnixStream::connect(socket).await.expect("the database is there");
    client.set_nodelay(true).expect("a connection");
    let (from_client, to_client) = client.into_split();
    let (from_server, to_server) = server.into_split();
    let mut cut = seen.clone();
    // when one direction ends, both do: dropped together
    tokio::select! {
        _ = cut.wait_for(|way| *way == Way::Cut) => {}
        () = carry(from_client, to_server, seen.clone()) => {}
        () = carry(from_server, to_client, seen) => {}
    }
}

/// Carries bytes until one side has enough.
async fn carry(mut from: impl AsyncRead + Unpin, mut to: impl AsyncWrite + Unpin, mut seen: watch::Receiver<Way>) {
    let mut bytes = vec![0; 64 << 10];
    loop {
        let count = match from.read(&mut bytes).await {
            Ok(count) if count > 0 => count,
            _ => return,
        };
        let way = *seen.borrow();
        if let Way::Slow(late) = way {
            tokio::time::sleep(late).await;
        }
        if seen.wait_for(|way| *way != Way::Silent).await.is_err() || to.write_all(&bytes[..count]).await.is_err() {
            return;
        }
    }
}

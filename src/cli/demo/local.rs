//! The server that the demo runs in its own process.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use clap::Parser;

use crate::cli::push::random_seed;
use crate::cli::serve::Server;
use crate::cli::{BadInput, Failure};
use crate::config::ServeConfig;

/// A server in this process, with a folder of its own.
pub(super) struct LocalServer {
    server: Server,
    /// Removed with the server.
    temporary: Option<PathBuf>,
}

/// What `mapweld serve` does when nothing is said.
#[derive(Parser)]
struct Defaults {
    #[command(flatten)]
    config: ServeConfig,
}

impl LocalServer {
    /// Starts on this port, or a free one for 0, over this folder, or a temporary one.
    pub(super) async fn start(port: u16, data: Option<PathBuf>) -> Result<Self, Failure> {
        let temporary = match data {
            Some(_) => None,
            None => Some(std::env::temp_dir().join(format!("mapweld-demo-{:016x}", random_seed()))),
        };
        let defaults = Defaults::try_parse_from(["mapweld"]).bad_input(|| "the settings of the server")?;
        let config = ServeConfig {
            listen: SocketAddr::from((Ipv4Addr::LOCALHOST, port)),
            data: data.or(temporary.clone()).expect("invariant: one of the two is there"),
            database_url: None,
            blobs: None,
            ..defaults.config
        };
        Ok(Self {
            server: Server::start(&config).await?,
            temporary,
        })
    }

    /// Where it is reached.
    pub(super) fn url(&self) -> String {
        self.server.url()
    }

    /// Ends, and leaves nothing behind that was temporary.
    pub(super) async fn stop(self) -> Result<(), Failure> {
        self.server.stop().await;
        let Some(folder) = self.temporary else {
            return Ok(());
        };
        std::fs::remove_dir_all(&folder).map_err(|error| {
            let what = format!("cannot remove the temporary folder {}", folder.display());
            Failure::Internal(anyhow::Error::new(error).context(what))
        })
    }
}

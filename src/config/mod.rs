//! The settings of `mapweld serve`: options of the command line, each with an environment variable.
//!
//! Imports `codec`, for its limits, and `failpoint`.

mod place;
mod upkeep;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};

use crate::codec::Limits;
use crate::failpoint;
pub use place::{BadPlace, BlobPlace, DatabasePlace};
pub use upkeep::UpkeepConfig;

/// How a server is run.
#[derive(Debug, Clone, Args)]
pub struct ServeConfig {
    /// Address and port to listen on; port 0 takes a free one.
    #[arg(
        long,
        env = "MAPWELD_LISTEN",
        default_value = "127.0.0.1:8080",
        value_name = "ADDRESS:PORT"
    )]
    pub listen: SocketAddr,

    /// Folder of the database and the blobs, as long as nothing else is said; made when it is not there.
    #[arg(long, env = "MAPWELD_DATA", default_value = "./mapweld-data", value_name = "FOLDER")]
    pub data: PathBuf,

    /// Where records and the queue are kept: `sqlite:FILE` or `postgres://USER:PASSWORD@HOST:PORT/DATABASE`, which any
    /// number of replicas may share. Default: `mapweld.sqlite` in the data folder.
    #[arg(long, env = "MAPWELD_DATABASE_URL", hide_env_values = true, value_name = "URL")]
    pub database_url: Option<DatabasePlace>,

    /// Most connections to PostgreSQL; one of them listens for the other replicas' changes.
    #[arg(
        long,
        env = "MAPWELD_DATABASE_CONNECTIONS",
        default_value_t = 16,
        value_parser = clap::value_parser!(u32).range(2..=1000),
        value_name = "COUNT"
    )]
    pub database_connections: u32,

    /// Where blobs are kept: a folder or `s3://BUCKET/PREFIX`, with endpoint, region and keys in the usual `AWS_`
    /// variables. Default: `blobs` in the data folder.
    #[arg(long, env = "MAPWELD_BLOBS", value_name = "PLACE")]
    pub blobs: Option<BlobPlace>,

    /// The server's certificate, PEM, its own first: connections are encrypted.
    #[arg(long, env = "MAPWELD_TLS_CERT", requires = "tls_key", value_name = "FILE")]
    pub tls_cert: Option<PathBuf>,

    /// The private key of this certificate, PEM.
    #[arg(long, env = "MAPWELD_TLS_KEY", requires = "tls_cert", value_name = "FILE")]
    pub tls_key: Option<PathBuf>,

    /// Let everyone do everything: nobody has to show a key, also on an address that other machines reach.
    #[arg(long, env = "MAPWELD_INSECURE")]
    pub insecure: bool,

    /// Refuse maps for sessions that nobody has made.
    #[arg(long, env = "MAPWELD_NO_AUTO_CREATE")]
    pub no_auto_create: bool,

    /// The work.
    #[command(flatten)]
    pub work: WorkConfig,

    /// What is taken in.
    #[command(flatten)]
    pub limits: LimitConfig,

    /// What is kept, and for how long.
    #[command(flatten)]
    pub upkeep: UpkeepConfig,

    /// Lines on standard error: `error`, `warn`, `info`, `debug`, `trace`, or a filter such as `mapweld::http=debug`.
    #[arg(long, env = "MAPWELD_LOG", default_value = "info", value_name = "FILTER")]
    pub log: String,

    /// The form of these lines.
    #[arg(long, env = "MAPWELD_LOG_FORMAT", value_enum, default_value_t)]
    pub log_format: LogFormat,

    /// Where a debug build shall die, for tests.
    #[arg(long, env = "MAPWELD_FAILPOINT", hide = true)]
    pub failpoint: Option<failpoint::Order>,
}

/// How jobs are done.
#[derive(Debug, Clone, Args)]
pub struct WorkConfig {
    /// Jobs that run at one time; 0 only queues them. Default: one for each processor.
    #[arg(long, env = "MAPWELD_WORKERS", value_name = "COUNT")]
    pub workers: Option<usize>,

    /// Threads that compute, for all jobs and requests together. Default: one for each processor.
    #[arg(long, env = "MAPWELD_THREADS", value_name = "COUNT")]
    pub threads: Option<usize>,

    /// Longest time for one attempt at a job, and for a one-shot merge.
    #[arg(long, env = "MAPWELD_JOB_DEADLINE", default_value = "10m", value_parser = parse_duration, value_name = "TIME")]
    pub job_deadline: Duration,

    /// After this long without a sign of life of its worker a job is begun again.
    #[arg(long, env = "MAPWELD_LEASE", default_value = "30s", value_parser = parse_duration, value_name = "TIME")]
    pub lease: Duration,

    /// How often a job is begun before it is given up.
    #[arg(long, env = "MAPWELD_MAX_ATTEMPTS", default_value_t = 3, value_name = "COUNT")]
    pub max_attempts: u32,
}

/// What is taken in, and how much of it.
#[derive(Debug, Clone, Args)]
pub struct LimitConfig {
    /// Most bytes of a request's body.
    #[arg(long, env = "MAPWELD_MAX_BODY_BYTES", default_value_t = 128 << 20, value_name = "BYTES")]
    pub max_body_bytes: u64,

    /// Most cells of a map, uploaded or fused.
    #[arg(long, env = "MAPWELD_MAX_CELLS", default_value_t = Limits::default().cells, value_name = "CELLS")]
    pub max_cells: u64,

    /// Longest time that a request's body may take to arrive.
    #[arg(long, env = "MAPWELD_BODY_TIME", default_value = "60s", value_parser = parse_duration, value_name = "TIME")]
    pub body_time: Duration,

    /// Longest time that a request's head may take to arrive, and that a connection may idle.
    #[arg(long, env = "MAPWELD_HEAD_TIME", default_value = "30s", value_parser = parse_duration, value_name = "TIME")]
    pub head_time: Duration,

    /// Most connections; on further ones only `/livez` and `/readyz` are answered, all else with 503.
    #[arg(long, env = "MAPWELD_MAX_CONNECTIONS", default_value_t = 1024, value_parser = at_least_one(), value_name = "COUNT")]
    pub max_connections: u32,

    /// Most requests at one time; more are answered with 503.
    #[arg(long, env = "MAPWELD_MAX_REQUESTS", default_value_t = 256, value_parser = at_least_one(), value_name = "COUNT")]
    pub max_requests: u32,

    /// Most event streams and long polls at one time, which `--max-requests` does not count; more are answered with 503.
    #[arg(long, env = "MAPWELD_MAX_WAITING", default_value_t = 512, value_parser = at_least_one(), value_name = "COUNT")]
    pub max_waiting: u32,

    /// Most one-shot merges at one time; more are answered with 503. Default: one for each processor.
    #[arg(long, env = "MAPWELD_MAX_MERGES", value_parser = at_least_one(), value_name = "COUNT")]
    pub max_merges: Option<u32>,

    /// Most uploads that are held in memory at one time; more are answered with 503.
    #[arg(long, env = "MAPWELD_MAX_UPLOADS", default_value_t = 8, value_name = "COUNT")]
    pub max_uploads: usize,

    /// Most maps of a one-shot merge.
    #[arg(long, env = "MAPWELD_MAX_MAPS", default_value_t = 32, value_name = "COUNT")]
    pub max_maps: usize,

    /// Most jobs that wait, in all; more are answered with 429.
    #[arg(long, env = "MAPWELD_MAX_QUEUED", default_value_t = 1024, value_name = "COUNT")]
    pub max_queued: u32,

    /// Requests a second that one key may make; 0 for any number. More are answered with 429.
    #[arg(long, env = "MAPWELD_KEY_RATE", default_value_t = 100, value_name = "COUNT")]
    pub key_rate: u32,

    /// Requests that one key may make at once after a pause.
    #[arg(long, env = "MAPWELD_KEY_BURST", default_value_t = 200, value_name = "COUNT")]
    pub key_burst: u32,

    /// Most jobs of one session that wait.
    #[arg(
        long,
        env = "MAPWELD_MAX_QUEUED_PER_SESSION",
        default_value_t = 32,
        value_name = "COUNT"
    )]
    pub max_queued_per_session: u32,
}

/// The form of a line of the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum LogFormat {
    /// For people.
    #[default]
    Text,
    /// One JSON object a line.
    Json,
}

/// The server would be of use to nobody but strangers.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0} can be reached from other machines, and there is no key that callers could show; make one with mapweld keys \
     create, listen on 127.0.0.1, or say --insecure when the network is trusted"
)]
pub struct NoKeys(SocketAddr);

impl ServeConfig {
    /// Where records and the queue are kept.
    #[must_use]
    pub fn database(&self) -> DatabasePlace {
        let standard = || DatabasePlace::Sqlite(self.data.join("mapweld.sqlite"));
        self.database_url.clone().unwrap_or_else(standard)
    }

    /// Where blobs are kept.
    #[must_use]
    pub fn blob_place(&self) -> BlobPlace {
        let standard = || BlobPlace::Folder(self.data.join("blobs"));
        self.blobs.clone().unwrap_or_else(standard)
    }

    /// Refuses an address beyond this machine when no key was ever made, unless that is asked for.
    ///
    /// # Errors
    /// [`NoKeys`] names the address.
    pub fn check_listen(&self, has_keys: bool) -> Result<(), NoKeys> {
        if self.is_beyond_loopback() && !has_keys && !self.insecure {
            return Err(NoKeys(self.listen));
        }
        Ok(())
    }

    /// Whether other machines reach the server.
    #[must_use]
    pub fn is_beyond_loopback(&self) -> bool {
        !self.listen.ip().is_loopback()
    }
}

impl LimitConfig {
    /// What the decoders take in.
    #[must_use]
    pub fn codec(&self) -> Limits {
        Limits {
            bytes: self.max_body_bytes,
            cells: self.max_cells,
            ..Limits::default()
        }
    }
}

fn at_least_one() -> clap::builder::RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(1..)
}

/// A time such as `90s`, `10m` or `1h 30m`.
pub(crate) fn parse_duration(text: &str) -> Result<Duration, String> {
    let parsed: jiff::SignedDuration = text
        .parse()
        .map_err(|_| format!("{text:?} is no time; write it as 90s, 10m or 1h 30m"))?;
    match Duration::try_from(parsed) {
        Ok(duration) if duration > Duration::ZERO => Ok(duration),
        _ => Err(format!("{text:?} must be longer than 0s")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        config: ServeConfig,
    }

    fn parse(arguments: &[&str]) -> Result<ServeConfig, clap::Error> {
        Command::try_parse_from(["serve"].iter().chain(arguments)).map(|command| command.config)
    }

    #[test]
    fn a_server_stays_on_its_machine_unless_there_are_keys_or_it_is_told_to_be_insecure() {
        assert!(parse(&[]).expect("defaults").check_listen(false).is_ok());
        let open = ["--listen", "0.0.0.0:0"];
        let config = parse(&open).expect("parses");
        let error = config.check_listen(false).expect_err("refused");
        assert!(error.to_string().contains("--insecure"), "{error}");
        assert!(config.check_listen(true).is_ok());
        let insecure = parse(&[open[0], open[1], "--insecure"]).expect("parses");
        assert!(insecure.check_listen(false).is_ok());
    }

    #[test]
    fn times_are_written_with_their_unit() {
        let config = parse(&["--lease", "1m 30s"]).expect("parses");
        assert_eq!(config.work.lease, Duration::from_secs(90));
        for bad in ["30", "0s", "-5s", "soon"] {
            assert!(parse(&["--lease", bad]).is_err(), "{bad}");
        }
    }
}

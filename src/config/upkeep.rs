//! What is kept, and for how long.

use std::num::NonZeroU32;
use std::time::Duration;

use clap::Args;

use super::parse_duration;

/// How the house is kept.
#[derive(Debug, Clone, Args)]
pub struct UpkeepConfig {
    /// Versions that are kept of each session that does not say it itself, the newest ones; with older ones go the maps
    /// that no version is made of any more. Default: all.
    #[arg(long, env = "MAPWELD_KEEP_VERSIONS", value_name = "COUNT")]
    pub keep_versions: Option<NonZeroU32>,

    /// How long bytes that no record names are kept; longer than any upload takes.
    #[arg(long, env = "MAPWELD_BLOB_GRACE", default_value = "24h", value_parser = parse_duration, value_name = "TIME")]
    pub blob_grace: Duration,

    /// How long jobs that have ended are kept; longer when a version that they published is. Default: as long as their
    /// session.
    #[arg(long, env = "MAPWELD_KEEP_JOBS", value_parser = parse_duration, value_name = "TIME")]
    pub keep_jobs: Option<Duration>,

    /// How long the answer to a request with an `Idempotency-Key` is kept, and given again to one that comes with the same.
    #[arg(long, env = "MAPWELD_KEEP_ANSWERS", default_value = "24h", value_parser = parse_duration, value_name = "TIME")]
    pub keep_answers: Duration,

    /// How often old versions and answers, and bytes that no record names, are looked for.
    #[arg(long, env = "MAPWELD_SWEEP_EVERY", default_value = "10m", value_parser = parse_duration, value_name = "TIME")]
    pub sweep_every: Duration,
}

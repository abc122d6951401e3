//! The command line: one file a subcommand. The only room that prints, and that reads files and the environment.
//! May import everything.
//!
//! Exit codes, the same for every subcommand: 0 done; 1 something failed that is not the caller's fault; 2 bad input,
//! from an unknown option to a map that cannot be decoded; 3 done, but some maps were not placed; 4 done, but something that was kept is
//! damaged or lost.

#[cfg(feature = "server")]
mod backup;
#[cfg(all(feature = "client", feature = "server"))]
mod demo;
mod evaluate;
mod evaluate_sets;
#[cfg(feature = "experiments")]
mod experiments;
mod failure;
pub mod files;
#[cfg(feature = "server")]
mod fsck;
#[cfg(feature = "server")]
mod home;
#[cfg(feature = "server")]
mod keys;
mod merge;
mod merge_rules;
#[cfg(feature = "server")]
mod openapi;
pub mod placements;
#[cfg(feature = "client")]
mod push;
#[cfg(any(feature = "client", feature = "server"))]
mod runtime;
#[cfg(feature = "server")]
mod serve;
mod simulate;
mod simulate_fleets;
mod stopwatch;
mod terminal;
#[cfg(feature = "client")]
mod watch;

pub use failure::{BadInput, Failure};
pub use stopwatch::Stopwatch;
pub use terminal::{say, tell};

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Welds the occupancy grid maps of many robots into one.
#[derive(Debug, Parser)]
#[command(name = "mapweld", version, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
#[cfg_attr(
    all(feature = "client", feature = "server"),
    expect(clippy::large_enum_variant, reason = "there is one, for as long as the process")
)]
enum Command {
    #[cfg(all(feature = "client", feature = "server"))]
    Demo(demo::Demo),
    Merge(merge::Merge),
    #[cfg(feature = "client")]
    Push(push::Push),
    Evaluate(evaluate::Evaluate),
    #[cfg(feature = "experiments")]
    Experiments(experiments::Experiments),
    Simulate(simulate::Simulate),
    #[cfg(feature = "server")]
    Serve(serve::Serve),
    #[cfg(feature = "server")]
    Keys(keys::Keys),
    #[cfg(feature = "server")]
    Backup(backup::Backup),
    #[cfg(feature = "server")]
    Fsck(fsck::Fsck),
    #[cfg(feature = "server")]
    #[command(name = "openapi")]
    OpenApi(openapi::OpenApi),
}

/// How a subcommand ended when it did not fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Done {
    /// All that was asked for.
    Entirely,
    /// The work was done, and some maps have no place in the result.
    SomeNotPlaced,
    /// The work was done, and something that was kept is damaged or lost.
    Damaged,
}

impl From<Done> for ExitCode {
    fn from(done: Done) -> Self {
        match done {
            Done::Entirely => Self::SUCCESS,
            Done::SomeNotPlaced => Self::from(3),
            Done::Damaged => Self::from(4),
        }
    }
}

/// Parses the arguments of this process, runs the subcommand, and tells how it went.
#[must_use]
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(refusal) => {
            let shown = refusal.print();
            let asked_for_help = !refusal.use_stderr();
            return if asked_for_help && shown.is_ok() {
                ExitCode::SUCCESS
            } else {
                ExitCode::from(2)
            };
        }
    };
    match cli.command.run() {
        Ok(done) => done.into(),
        Err(failure) => failure.report(),
    }
}

impl Command {
    fn run(self) -> Result<Done, Failure> {
        match self {
            #[cfg(all(feature = "client", feature = "server"))]
            Self::Demo(demo) => demo.run(),
            Self::Merge(merge) => merge.run(),
            #[cfg(feature = "client")]
            Self::Push(push) => push.run(),
            Self::Evaluate(evaluate) => evaluate.run(),
            #[cfg(feature = "experiments")]
            Self::Experiments(experiments) => experiments.run(),
            Self::Simulate(simulate) => simulate.run(),
            #[cfg(feature = "server")]
            Self::Serve(serve) => serve.run(),
            #[cfg(feature = "server")]
            Self::Keys(keys) => keys.run(),
            #[cfg(feature = "server")]
            Self::Backup(backup) => backup.run(),
            #[cfg(feature = "server")]
            Self::Fsck(fsck) => fsck.run(),
            #[cfg(feature = "server")]
            Self::OpenApi(openapi) => openapi.run(),
        }
    }
}

/// Runs `work` in a pool of `threads` threads, or in one as wide as the machine when none are named.
///
/// # Errors
/// When the threads cannot be started.
pub fn in_pool<T: Send>(
    threads: Option<std::num::NonZeroUsize>,
    work: impl FnOnce() -> T + Send,
) -> Result<T, Failure> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.map_or(0, std::num::NonZeroUsize::get))
        .build()
        .map_err(anyhow::Error::from)?;
    Ok(pool.install(work))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn the_pool_has_as_many_threads_as_asked_for() {
        let threads = in_pool(std::num::NonZeroUsize::new(2), rayon::current_num_threads).expect("two threads start");
        assert_eq!(threads, 2);
    }
}

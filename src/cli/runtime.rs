//! What the commands that talk to a network need around them.

use std::time::Duration;

use super::Failure;

/// How long a computation that nobody waits for any more may hold up the end of the process.
const LAST_WAIT: Duration = Duration::from_secs(5);

/// Runs a future to its end, with timers, sockets and signals.
///
/// # Errors
/// When the machine gives no threads or sockets for it.
pub(super) fn block_on<F: Future>(work: F) -> Result<F::Output, Failure> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(anyhow::Error::from)?;
    let done = runtime.block_on(work);
    runtime.shutdown_timeout(LAST_WAIT);
    Ok(done)
}

/// Shows what the client warns of, such as attempts that failed, to the person at the terminal.
#[cfg(feature = "client")]
pub(super) fn warnings_to_stderr() {
    // Refused when something else has already taken over the log: then it is told there.
    let _ = tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_max_level(tracing::Level::WARN)
        .with_target(false)
        .with_ansi(false)
        .without_time()
        .try_init();
}

/// Ends with Ctrl-C, or with the SIGTERM of whoever supervises this process.
pub(super) async fn interrupted() -> Result<(), Failure> {
    let failed = |error| Failure::Internal(anyhow::Error::new(error).context("cannot wait for signals"));
    #[cfg(unix)]
    {
        let mut terminated =
            tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()).map_err(failed)?;
        tokio::select! {
            pressed = tokio::signal::ctrl_c() => pressed.map_err(failed),
            _ = terminated.recv() => Ok(()),
        }
    }
    #[cfg(not(unix))]
    tokio::signal::ctrl_c().await.map_err(failed)
}

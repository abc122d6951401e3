//! The log: lines on standard error, as text or JSON.
//!
//! Who has changed what (target `mapweld::audit`) is told whatever the filter says, unless it names that target.
//!
//! Imports nothing of the crate.

use std::io;

use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::ParseError;

/// The filter of the log is not understood.
#[derive(Debug, thiserror::Error)]
#[error("the log filter {filter:?} is not understood: {reason}")]
pub struct BadFilter {
    filter: String,
    reason: ParseError,
}

/// The target of the lines that tell who has changed what.
const AUDIT: &str = "mapweld::audit";

/// Sends the process's log to standard error from now on. A second call changes nothing.
///
/// # Errors
/// [`BadFilter`] when the filter cannot be parsed.
pub fn init(filter: &str, json: bool) -> Result<(), BadFilter> {
    let whole = if filter.contains(AUDIT) {
        filter.to_owned()
    } else {
        format!("{filter},{AUDIT}=info")
    };
    let parsed = EnvFilter::builder().parse(whole).map_err(|reason| BadFilter {
        filter: filter.to_owned(),
        reason,
    })?;
    let lines = tracing_subscriber::fmt()
        .with_env_filter(parsed)
        .with_writer(io::stderr);
    // An error says that a subscriber is there already.
    let _ = if json {
        lines.json().flatten_event(true).try_init()
    } else {
        lines.with_ansi(false).compact().try_init()
    };
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_that_is_not_understood_is_named() {
        let error = init("mapweld=loud", false).expect_err("no such level");
        assert!(error.to_string().contains("mapweld=loud"), "{error}");
    }
}

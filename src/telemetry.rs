//! The log: lines on standard error, as text or JSON.
//!
//! Who has changed what (target `mapweld::audit`) is told whatever the filter says, unless it names that target.
//!
//! Spans carry the id of the trace that they belong to ([`join`]); with the feature `otel` and a collector told by
//! `OTEL_EXPORTER_OTLP_ENDPOINT` they are sent there.
//!
//! Imports `model`.

use std::io;

use tracing::Span;
use tracing_subscriber::filter::ParseError;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;
use tracing_subscriber::{EnvFilter, Layer as _};
use uuid::Uuid;

use crate::model::{JobId, TraceParent};

/// The filter of the log is not understood.
#[derive(Debug, thiserror::Error)]
#[error("the log filter {filter:?} is not understood: {reason}")]
pub struct BadFilter {
    filter: String,
    reason: ParseError,
}

/// The target of the lines that tell who has changed what.
const AUDIT: &str = "mapweld::audit";

/// The log cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum BadTelemetry {
    /// The filter of the log is not understood.
    #[error(transparent)]
    Filter(#[from] BadFilter),
    /// The exporter of spans cannot be made out of the `OTEL_` variables.
    #[cfg(feature = "otel")]
    #[error("spans cannot be exported as the OTEL_ variables say: {0}")]
    Exporter(#[from] opentelemetry_otlp::ExporterBuildError),
}

/// Sends the process's log to standard error from now on. A second call changes nothing.
///
/// # Errors
/// [`BadTelemetry`] when the filter cannot be parsed, or spans cannot be exported where they shall.
pub fn init(filter: &str, json: bool) -> Result<(), BadTelemetry> {
    let whole = if filter.contains(AUDIT) {
        filter.to_owned()
    } else {
        format!("{filter},{AUDIT}=info")
    };
    let parsed = EnvFilter::builder().parse(whole).map_err(|reason| BadFilter {
        filter: filter.to_owned(),
        reason,
    })?;
    let lines = tracing_subscriber::fmt::layer().with_writer(io::stderr);
    let lines = if json {
        lines.json().flatten_event(true).boxed()
    } else {
        lines.with_ansi(false).compact().boxed()
    };
    let log = tracing_subscriber::registry().with(lines.with_filter(parsed));
    #[cfg(feature = "otel")]
    let log = log.with(otel::layer()?);
    // An error says that a subscriber is there already.
    let _ = log.try_init();
    Ok(())
}

/// Joins a span to the trace of its parent, or to a new one, records the trace's id in the span's field `trace_id`, and
/// gives what the span's own children, and jobs, shall be told. `fresh` is an id that nothing else has.
#[must_use = "what the span causes belongs to the same trace"]
pub fn join(span: &Span, parent: Option<TraceParent>, fresh: Uuid) -> TraceParent {
    let (trace, low) = (fresh.as_u128(), fresh.as_u64_pair().1);
    // the lower half of an id is random, and never 0: its first bits tell the variant
    let new = TraceParent::new(trace, low, true).expect("invariant: a UUID has bits that are set");
    let joined = parent.and_then(|parent| parent.with_span(low)).unwrap_or(new);
    #[cfg(feature = "otel")]
    let joined = otel::join(span, parent).unwrap_or(joined);
    span.record("trace_id", joined.trace_id());
    joined
}

/// Gives a span another name at the collector: a request's is known only once its route is.
pub fn rename(span: &Span, name: impl FnOnce() -> String) {
    #[cfg(feature = "otel")]
    otel::rename(span, name);
    #[cfg(not(feature = "otel"))]
    let _ = (span, name);
}

/// Tells the span that is entered which job it has caused, in its field `job`.
pub fn tell_job(job: &JobId) {
    Span::current().record("job", tracing::field::display(job));
}

/// Sends what has not been sent yet; for the end of the process.
pub fn finish() {
    #[cfg(feature = "otel")]
    otel::finish();
}

#[cfg(feature = "otel")]
mod otel;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_of_a_known_trace_stays_in_it_under_an_id_of_its_own() {
        let parent: TraceParent = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-00"
            .parse()
            .expect("the example of the standard");
        let fresh = Uuid::from_u128(0x0193_9f3e_7a52_7c1e_b5e6_3d8f_0f6f_2a10);
        let joined = join(&Span::none(), Some(parent), fresh);
        assert_eq!(
            joined.to_string(),
            "00-0af7651916cd43dd8448eb211c80319c-b5e63d8f0f6f2a10-00"
        );
        let new = join(&Span::none(), None, fresh);
        assert_eq!(
            new.to_string(),
            "00-01939f3e7a527c1eb5e63d8f0f6f2a10-b5e63d8f0f6f2a10-01"
        );
    }

    #[test]
    fn a_filter_that_is_not_understood_is_named() {
        let error = init("mapweld=loud", false).expect_err("no such level");
        assert!(error.to_string().contains("mapweld=loud"), "{error}");
    }
}

//! Spans to an OpenTelemetry collector by OTLP over HTTP. Endpoint, headers, service name, sampler and batches are those
//! of the usual `OTEL_` variables; without an endpoint nothing is sent.

use std::sync::OnceLock;

use opentelemetry::Context;
use opentelemetry::trace::{
    SpanContext, SpanId, TraceContextExt as _, TraceFlags, TraceId, TraceState, TracerProvider as _,
};
use opentelemetry_otlp::{ExporterBuildError, SpanExporter};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::SdkTracerProvider;
use tracing::level_filters::LevelFilter;
use tracing::{Span, Subscriber};
use tracing_opentelemetry::OpenTelemetrySpanExt as _;
use tracing_subscriber::Layer;
use tracing_subscriber::registry::LookupSpan;

use crate::model::TraceParent;

/// The variables that name a collector.
const ENDPOINTS: [&str; 2] = ["OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT"];

static PROVIDER: OnceLock<SdkTracerProvider> = OnceLock::new();

/// The layer that sends spans, if a collector is told.
pub(super) fn layer<S>() -> Result<Option<impl Layer<S>>, ExporterBuildError>
where
    S: Subscriber + for<'span> LookupSpan<'span>,
{
    let is_told = |name: &&str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    if !ENDPOINTS.iter().any(is_told) {
        return Ok(None);
    }
    let exporter = SpanExporter::builder().with_http().build()?;
    let mut resource = Resource::builder();
    if !is_told(&"OTEL_SERVICE_NAME") {
        resource = resource.with_service_name("mapweld");
    }
    let provider = SdkTracerProvider::builder()
        .with_batch_exporter(exporter)
        .with_resource(resource.build())
        .build();
    let tracer = PROVIDER.get_or_init(|| provider).tracer("mapweld");
    let spans = tracing_opentelemetry::layer().with_tracer(tracer).with_location(false);
    Ok(Some(spans.with_filter(LevelFilter::INFO)))
}

/// Puts a span under its parent; what its children are told, if it is recorded at all.
pub(super) fn join(span: &Span, parent: Option<TraceParent>) -> Option<TraceParent> {
    PROVIDER.get()?;
    if let Some(parent) = parent {
        let flags = if parent.is_sampled() {
            TraceFlags::SAMPLED
        } else {
            TraceFlags::default()
        };
        let remote = SpanContext::new(
            TraceId::from(parent.trace()),
            SpanId::from(parent.span()),
            flags,
            true,
            TraceState::default(),
        );
        // refused when the span is disabled: then it has no context of its own either
        let _ = span.set_parent(Context::new().with_remote_span_context(remote));
    }
    let context = span.context();
    let own = context.span().span_context().clone();
    let trace = u128::from_be_bytes(own.trace_id().to_bytes());
    let id = u64::from_be_bytes(own.span_id().to_bytes());
    TraceParent::new(trace, id, own.is_sampled())
}

/// Renames a span that has begun, which a field `otel.name` of it does not: with its context it was made.
pub(super) fn rename(span: &Span, name: impl FnOnce() -> String) {
    if PROVIDER.get().is_some() {
        span.context().span().update_name(name());
    }
}

/// Sends what has not been sent yet.
pub(super) fn finish() {
    if let Some(provider) = PROVIDER.get() {
        // nobody is there any more who could be told that it did not work
        let _ = provider.shutdown();
    }
}

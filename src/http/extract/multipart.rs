//! multipart/form-data bodies.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use axum::body::Body;
use axum::extract::multipart::MultipartError;
use axum::extract::{FromRequest, Multipart, Request};
use axum::http::header;
use bytes::Bytes;
use futures_util::stream;

use crate::api::{FieldError, ProblemCode};
use crate::http::error::{ApiError, ApiResult};

/// The most parts that a body may have.
const PARTS_MAX: usize = 256;

/// Bytes that the parser is given at a time: it copies what it is given, so it never holds the whole body again.
const BITE: usize = 64 << 10;
/// The most bytes that the parser may read without coming to the data of a part: preamble and headers. It looks at them
/// again with every bite.
const HEAD_MAX: usize = 4 * BITE;

/// One part of a multipart body.
#[derive(Debug, Clone)]
pub(in crate::http) struct Part {
    /// Its name.
    pub(in crate::http) name: String,
    /// The name of the file that it was made from.
    pub(in crate::http) file_name: Option<String>,
    /// What it holds.
    pub(in crate::http) bytes: Bytes,
}

/// The parts of a body that is already in memory, in their order.
pub(in crate::http) async fn read_parts(content_type: &str, bytes: Bytes) -> ApiResult<Vec<Part>> {
    let budget = Arc::new(AtomicUsize::new(HEAD_MAX));
    let request = Request::builder()
        .header(header::CONTENT_TYPE, content_type)
        .body(bitten(bytes, Arc::clone(&budget)))
        .map_err(|error| malformed(&error.to_string()))?;
    let mut request = request;
    axum::extract::DefaultBodyLimit::disable().apply(&mut request); // the body's length has been looked at
    let mut multipart = Multipart::from_request(request, &())
        .await
        .map_err(|rejection| malformed(&rejection.body_text()))?;
    let refusal = |error: MultipartError| {
        if budget.load(Ordering::Relaxed) < BITE {
            malformed(&format!(
                "what stands before the data of a part is longer than {HEAD_MAX} bytes"
            ))
        } else {
            malformed(&error.body_text())
        }
    };
    let mut parts = Vec::new();
    loop {
        budget.store(HEAD_MAX, Ordering::Relaxed);
        let Some(field) = multipart.next_field().await.map_err(refusal)? else {
            return Ok(parts);
        };
        if parts.len() == PARTS_MAX {
            return Err(malformed(&format!("it has more than {PARTS_MAX} parts")));
        }
        budget.store(usize::MAX, Ordering::Relaxed);
        let (name, file_name) = (field.name().map(str::to_owned), field.file_name().map(str::to_owned));
        let bytes = field.bytes().await.map_err(refusal)?;
        parts.push(Part {
            name: name.ok_or_else(|| malformed("a part has no name"))?,
            file_name,
            bytes,
        });
    }
}

/// The body in bites, as many as the budget allows. After each the parser gets to look at what it has: it reads on for as
/// long as there is anything to read.
fn bitten(bytes: Bytes, budget: Arc<AtomicUsize>) -> Body {
    Body::from_stream(stream::unfold((bytes, budget), |(mut rest, budget)| async move {
        tokio::task::yield_now().await;
        let bite = rest.split_to(rest.len().min(BITE));
        if bite.is_empty() {
            return None;
        }
        let within = budget.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
            left.checked_sub(bite.len())
        });
        let bite = within.map(|_| bite).map_err(|_| HeadTooLong);
        Some((bite, (rest, budget)))
    }))
}

/// The budget of a head is used up.
#[derive(Debug, thiserror::Error)]
#[error("what stands before the data of a part is too long")]
struct HeadTooLong;

fn malformed(reason: &str) -> ApiError {
    ApiError::new(ProblemCode::MalformedMultipart, reason).field(FieldError::missing(
        "body",
        "multipart/form-data with a boundary (RFC 7578)",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODY: &str = "--x\r\nContent-Disposition: form-data; name=\"map\"; filename=\"a.yaml\"\r\n\r\nimage: a.pgm\r\n\
                        --x\r\nContent-Disposition: form-data; name=\"image\"\r\n\r\nP5\r\n--x--\r\n";

    #[tokio::test]
    async fn parts_come_with_their_names_in_their_order() {
        let parts = read_parts("multipart/form-data; boundary=x", Bytes::from_static(BODY.as_bytes()))
            .await
            .expect("two parts");
        assert_eq!(
            (parts[0].name.as_str(), parts[0].file_name.as_deref()),
            ("map", Some("a.yaml"))
        );
        assert_eq!((parts[1].name.as_str(), &parts[1].bytes[..]), ("image", &b"P5"[..]));
    }

    #[tokio::test]
    async fn a_part_longer_than_a_bite_comes_whole() {
        let long: Vec<u8> = (0..=250_u8).cycle().take(3 * BITE + 7).collect();
        let head = b"--x\r\nContent-Disposition: form-data; name=\"image\"\r\n\r\n";
        let body = [&head[..], &long, b"\r\n--x--\r\n"].concat();
        let parts = read_parts("multipart/form-data; boundary=x", body.into());
        assert_eq!(parts.await.expect("one part")[0].bytes, long);
    }

    #[tokio::test]
    async fn a_head_without_end_is_refused_and_a_long_one_is_not() {
        let named = |letters: usize| {
            let name = "n".repeat(letters);
            format!("--x\r\nContent-Disposition: form-data; name=\"{name}\"\r\n\r\n\r\n--x--\r\n")
        };
        let read = |body: String| read_parts("multipart/form-data; boundary=x", body.into());
        let parts = read(named(HEAD_MAX - 2 * BITE)).await.expect("a long name");
        assert_eq!(parts[0].name.len(), HEAD_MAX - 2 * BITE);
        for endless in [named(HEAD_MAX), "-".repeat(2 * HEAD_MAX)] {
            let refused = read(endless).await.expect_err("a head that is too long").to_string();
            assert!(refused.contains("before the data of a part"), "{refused}");
        }
    }

    #[tokio::test]
    async fn a_body_that_is_cut_off_or_has_no_boundary_is_refused() {
        let cut = Bytes::from_static(&BODY.as_bytes()[..60]);
        assert!(read_parts("multipart/form-data; boundary=x", cut).await.is_err());
        assert!(read_parts("multipart/form-data", Bytes::new()).await.is_err());
    }
}

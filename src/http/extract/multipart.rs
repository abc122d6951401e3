//! multipart/form-data bodies.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use bytes::Bytes;
use futures_util::stream::{self, Stream};
use memchr::memmem;
use multer::Multipart;

use crate::api::{FieldError, ProblemCode};
use crate::http::error::{ApiError, ApiResult};

/// The most parts that a body may have.
const PARTS_MAX: usize = 256;

/// Bytes that the parser is given at a time. It copies them, and takes the next ones with each of its steps, whether it needs
/// them or not: a few steps for each part.
const BITE: usize = 4 << 10;
/// The most bytes that the parser may read without coming to the data of a part: preamble and headers. It looks at them
/// again with every bite.
const HEAD_MAX: usize = 16 * BITE;

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

/// The parts of a body that is already in memory, in their order. What they hold is that memory, not a copy.
pub(in crate::http) async fn read_parts(content_type: &str, bytes: Bytes) -> ApiResult<Vec<Part>> {
    let boundary = multer::parse_boundary(content_type).map_err(|error| malformed(&error.to_string()))?;
    // The parser tells names and lengths; where a part's data lies in the body is found as it finds it itself.
    let mut at = memmem::find(&bytes, format!("--{boundary}").as_bytes()).unwrap_or_default();
    let budget = Arc::new(AtomicUsize::new(HEAD_MAX));
    let mut multipart = Multipart::new(bitten(bytes.clone(), Arc::clone(&budget)), boundary);
    let refusal = |error: multer::Error| {
        if budget.load(Ordering::Relaxed) < BITE {
            malformed(&format!(
                "what stands before the data of a part is longer than {HEAD_MAX} bytes"
            ))
        } else {
            malformed(&error.to_string())
        }
    };
    let mut parts = Vec::new();
    loop {
        budget.store(HEAD_MAX, Ordering::Relaxed);
        let Some(mut field) = multipart.next_field().await.map_err(refusal)? else {
            return Ok(parts);
        };
        if parts.len() == PARTS_MAX {
            return Err(malformed(&format!("it has more than {PARTS_MAX} parts")));
        }
        budget.store(usize::MAX, Ordering::Relaxed);
        let start = after(&bytes, at, CRLF).and_then(|head| after(&bytes, head, b"\r\n\r\n"));
        let start = start.ok_or_else(|| malformed("the head of a part has no end"))?;
        let mut end = start;
        while let Some(data) = field.chunk().await.map_err(refusal)? {
            if bytes.get(end..end + data.len()) != Some(&data[..]) {
                return Err(malformed("the head of a part is not one by RFC 7578"));
            }
            end += data.len();
        }
        at = end + CRLF.len();
        parts.push(Part {
            name: field
                .name()
                .map(str::to_owned)
                .ok_or_else(|| malformed("a part has no name"))?,
            file_name: field.file_name().map(str::to_owned),
            bytes: bytes.slice(start..end),
        });
    }
}

const CRLF: &[u8] = b"\r\n";

/// Where the next `pattern` ends, from a place on.
fn after(bytes: &[u8], from: usize, pattern: &[u8]) -> Option<usize> {
    let at = memmem::find(bytes.get(from..)?, pattern)?;
    Some(from + at + pattern.len())
}

/// The body in bites, as many as the budget allows. After each the parser gets to look at what it has: it reads on for as
/// long as there is anything to read.
fn bitten(bytes: Bytes, budget: Arc<AtomicUsize>) -> impl Stream<Item = Result<Bytes, HeadTooLong>> + Send {
    stream::unfold((bytes, budget), |(mut rest, budget)| async move {
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
    })
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
    async fn parts_are_pieces_of_the_body_and_not_copies() {
        let odd = "a preamble\r\n\r\nof two lines\r\n--x \t\r\nContent-Disposition: form-data; name=\"a\"\r\n\r\n\r\n-x\r\n\r\n\
                   \r\n--x\r\ncontent-disposition: form-data; name=\"b\"\r\n\r\n\r\n--x--\r\nan epilogue";
        for (body, wanted) in [(BODY, ["image: a.pgm", "P5"]), (odd, ["\r\n-x\r\n\r\n", ""])] {
            let body = Bytes::from_static(body.as_bytes());
            let parts = read_parts("multipart/form-data; boundary=x", body.clone()).await;
            let parts = parts.expect("two parts");
            assert_eq!(parts.len(), 2);
            for (part, wanted) in parts.iter().zip(wanted) {
                assert_eq!(part.bytes, wanted);
                assert!(body.as_ptr_range().contains(&part.bytes.as_ptr()), "{wanted:?}");
            }
        }
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

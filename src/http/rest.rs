//! The rest of a body that was answered before it was read.
//!
//! A connection that is closed with bytes unread is reset, and the reset may reach the client before the answer does: it
//! would see a broken pipe instead of its refusal. So what is left is read and thrown away, within bounds of bytes and
//! time, while the answer goes out.

use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{Request, State};
use axum::http::header;
use futures_util::StreamExt as _;
use http_body::{Frame, SizeHint};
use tokio::runtime::Handle;
use tokio::time::timeout;

use super::load::Crowded;
use super::state::AppState;

/// How much is read for nothing.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    /// The most bytes.
    bytes: u64,
    /// The longest time in all.
    time: Duration,
    /// The longest time without a byte.
    pause: Duration,
}

/// The most bytes, where a body that is allowed may not be longer.
const BYTES: u64 = 64 << 20;
/// The longest time in all, and where the server is crowded already.
const TIME: Duration = Duration::from_secs(10);
const CROWDED_TIME: Duration = Duration::from_secs(1);
/// The longest time without a byte.
const PAUSE: Duration = Duration::from_secs(2);

/// Has what is left of the request's body read once nobody wants it any more.
pub(super) async fn read_rest(State(state): State<AppState>, request: Request) -> Request {
    let crowded = request.extensions().get::<Crowded>().is_some();
    let bounds = Bounds {
        bytes: state.limits.body_bytes.max(BYTES),
        time: if crowded { CROWDED_TIME } else { TIME },
        pause: PAUSE,
    };
    // who waits for "100 Continue" has sent nothing yet, and sends nothing once it is refused
    let sent = !request.headers().contains_key(header::EXPECT);
    request.map(|body| Body::new(Wanted { body, sent, bounds }))
}

/// A body whose rest is read when it is dropped.
struct Wanted {
    body: Body,
    /// Whether the client sends it by now.
    sent: bool,
    bounds: Bounds,
}

impl HttpBody for Wanted {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        self.sent = true;
        let frame = Pin::new(&mut self.body).poll_frame(context);
        if matches!(frame, Poll::Ready(None | Some(Err(_)))) {
            self.sent = false; // there is nothing more to come
        }
        frame
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

impl Drop for Wanted {
    fn drop(&mut self) {
        if !self.sent || self.body.is_end_stream() {
            return;
        }
        if let Ok(runtime) = Handle::try_current() {
            runtime.spawn(throw_away(std::mem::take(&mut self.body), self.bounds));
        }
    }
}

/// Reads the body and keeps nothing of it.
async fn throw_away(body: Body, bounds: Bounds) {
    let reading = async {
        let (mut body, mut left) = (body.into_data_stream(), bounds.bytes);
        while let Ok(Some(Ok(bytes))) = timeout(bounds.pause, body.next()).await {
            match left.checked_sub(bytes.len() as u64) {
                Some(rest) => left = rest,
                None => break,
            }
        }
    };
    if timeout(bounds.time, reading).await.is_err() {
        tracing::trace!("the rest of a refused body did not arrive in time");
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU64, Ordering};

    use futures_util::stream;

    use super::*;

    const BOUNDS: Bounds = Bounds {
        bytes: 100,
        time: Duration::from_secs(10),
        pause: Duration::from_secs(10),
    };

    /// Four bytes at a time, so many times, and then nothing for ever or the end. What was read is counted.
    fn fours(times: u64, ends: bool) -> (Body, Arc<AtomicU64>) {
        let read = Arc::new(AtomicU64::new(0));
        let count = Arc::clone(&read);
        let bytes = stream::repeat_with(move || {
            count.fetch_add(4, Ordering::Relaxed);
            Ok::<_, Infallible>(Bytes::from_static(b"four"))
        });
        let bytes = bytes.take(usize::try_from(times).expect("a few"));
        let body = if ends {
            Body::from_stream(bytes)
        } else {
            Body::from_stream(bytes.chain(stream::pending()))
        };
        (body, read)
    }

    /// Waits until the body is gone, within a second, and tells what was read of it.
    async fn gone(read: &Arc<AtomicU64>) -> u64 {
        for _ in 0..200 {
            if Arc::strong_count(read) == 1 {
                return read.load(Ordering::Relaxed);
            }
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        panic!("the body is still held");
    }

    fn wanted(body: Body, sent: bool, bounds: Bounds) -> Wanted {
        Wanted { body, sent, bounds }
    }

    #[tokio::test]
    async fn what_nobody_has_read_is_read_to_its_end() {
        let (body, read) = fours(5, true);
        drop(wanted(body, true, BOUNDS));
        assert_eq!(gone(&read).await, 20);
    }

    #[tokio::test]
    async fn a_body_that_is_read_half_is_read_to_its_end() {
        let (body, read) = fours(5, true);
        let mut half = Body::new(wanted(body, true, BOUNDS)).into_data_stream();
        assert!(half.next().await.is_some());
        drop(half);
        assert_eq!(gone(&read).await, 20);
    }

    #[tokio::test]
    async fn no_more_bytes_are_read_than_the_bound() {
        let (body, read) = fours(1000, true);
        drop(wanted(body, true, BOUNDS));
        assert_eq!(gone(&read).await, 104, "25 fours, and the one that is too much");
    }

    #[tokio::test]
    async fn a_client_that_falls_silent_is_given_up() {
        let quick = Duration::from_millis(10);
        for bounds in [Bounds { pause: quick, ..BOUNDS }, Bounds { time: quick, ..BOUNDS }] {
            let (body, read) = fours(2, false);
            drop(wanted(body, true, bounds));
            assert_eq!(gone(&read).await, 8);
        }
    }

    #[tokio::test]
    async fn a_client_that_waits_to_be_told_to_go_on_is_not_told_to() {
        let (body, read) = fours(5, true);
        drop(wanted(body, false, BOUNDS));
        assert_eq!(gone(&read).await, 0);
        // once it was told to, it sends
        let (body, read) = fours(5, true);
        let mut begun = Body::new(wanted(body, false, BOUNDS)).into_data_stream();
        assert!(begun.next().await.is_some());
        drop(begun);
        assert_eq!(gone(&read).await, 20);
    }

    #[tokio::test]
    async fn a_body_that_was_read_is_not_read_again() {
        let (body, read) = fours(2, true);
        let whole = axum::body::to_bytes(Body::new(wanted(body, true, BOUNDS)), 100).await;
        assert_eq!(whole.expect("eight bytes").len(), 8);
        assert_eq!(gone(&read).await, 8);
    }
}

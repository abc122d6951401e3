//! Bodies of uploads: the first line is the media type and, after a question mark, the query; the rest is the body.
#![no_main]

use bytes::Bytes;
use libfuzzer_sys::fuzz_target;
use mapweld::http::fuzzed_upload;
use mapweld_fuzz::{limits, must_be_kept};
use tokio::runtime::Builder;

fuzz_target!(|bytes: &[u8]| {
    let mut halves = bytes.splitn(2, |&byte| byte == b'\n');
    let (Some(head), Some(body)) = (halves.next(), halves.next()) else {
        return;
    };
    let Ok(head) = std::str::from_utf8(head) else {
        return;
    };
    let (content_type, query) = head.split_once('?').unwrap_or((head, ""));
    let runtime = Builder::new_current_thread().build().expect("a runtime of one thread");
    let (body, limits) = (Bytes::copy_from_slice(body), limits());
    let uploaded = fuzzed_upload(content_type, query, body, &limits);
    if let Ok(decoded) = runtime.block_on(uploaded) {
        must_be_kept(&decoded);
    }
});

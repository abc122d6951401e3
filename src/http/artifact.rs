//! Files that never change: strong entity tags, 304, and parts of them by `Range`.

use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use bytes::Bytes;

use super::error::ApiError;
use super::extract::{CONTENT_DIGEST, REPR_DIGEST};
use crate::api::{FieldError, ProblemCode};
use crate::model::{BlobKey, Digest};

/// A kind of file: what a tag tells apart, and its media type.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kind {
    name: &'static str,
    media_type: &'static str,
}

/// A PNG.
pub(super) const PNG: Kind = Kind {
    name: "png",
    media_type: "image/png",
};
/// A PGM.
pub(super) const PGM: Kind = Kind {
    name: "pgm",
    media_type: "image/x-portable-graymap",
};
/// A YAML file that names a PNG.
pub(super) const YAML_PNG: Kind = Kind {
    name: "yaml-png",
    media_type: "application/yaml",
};
/// A YAML file that names a PGM.
pub(super) const YAML_PGM: Kind = Kind {
    name: "yaml-pgm",
    media_type: "application/yaml",
};
/// A `nav_msgs/OccupancyGrid`.
pub(super) const OCCUPANCY_GRID: Kind = Kind {
    name: "occupancy-grid",
    media_type: "application/json",
};
/// A version's description.
pub(super) const VERSION: Kind = Kind {
    name: "version",
    media_type: "application/json",
};
/// The transforms of a version.
pub(super) const TRANSFORMS: Kind = Kind {
    name: "transforms",
    media_type: "application/json",
};
/// An archive.
pub(super) const ZIP: Kind = Kind {
    name: "zip",
    media_type: "application/zip",
};

/// One file with its tag.
#[derive(Debug, Clone)]
pub(super) struct Artifact {
    tag: HeaderValue,
    /// The digest of its bytes, where that is known beforehand.
    digest: Option<Digest>,
    media_type: &'static str,
}

impl Artifact {
    /// A file that is kept as it is: its tag is the digest of its bytes.
    pub(super) fn kept(key: BlobKey, kind: Kind) -> Self {
        Self {
            digest: Some(key.0),
            ..Self::tagged(&key.0.to_string(), kind)
        }
    }

    /// A file that this version of the program makes from the content of this digest.
    pub(super) fn derived(digest: Digest, kind: Kind) -> Self {
        Self::tagged(&format!("{digest}.{}.{}", kind.name, env!("CARGO_PKG_VERSION")), kind)
    }

    fn tagged(tag: &str, kind: Kind) -> Self {
        Self {
            tag: HeaderValue::from_str(&format!("\"{tag}\"")).expect("invariant: digests and names are printable"),
            digest: None,
            media_type: kind.media_type,
        }
    }

    /// Whether the caller has it: `If-None-Match` names it.
    pub(super) fn is_known_to(&self, headers: &HeaderMap) -> bool {
        headers.get_all(header::IF_NONE_MATCH).iter().any(|value| {
            let tags = value.to_str().unwrap_or_default().split(',').map(str::trim);
            tags.map(|tag| tag.strip_prefix("W/").unwrap_or(tag))
                .any(|tag| tag == "*" || tag.as_bytes() == self.tag.as_bytes())
        })
    }

    /// 304.
    pub(super) fn not_modified(&self) -> Response {
        (StatusCode::NOT_MODIFIED, self.headers()).into_response()
    }

    /// The file, or the part of it that `Range` asks for, with the digests of both (RFC 9530). Hashes: files of many
    /// megabytes not on a thread that serves requests.
    pub(super) fn answer(&self, headers: &HeaderMap, bytes: Bytes) -> Response {
        let media_type = [(header::CONTENT_TYPE, HeaderValue::from_static(self.media_type))];
        let whole = bytes.len();
        let digest = told(self.digest.unwrap_or_else(|| Digest::of_bytes(&bytes)));
        let repr = [(REPR_DIGEST, digest.clone())];
        match self.range(headers, whole) {
            Range::Whole => {
                let content = [(CONTENT_DIGEST, digest)];
                (
                    StatusCode::OK,
                    self.headers(),
                    media_type,
                    repr,
                    content,
                    Body::from(bytes),
                )
                    .into_response()
            }
            Range::Part(first, last) => {
                let part = bytes.slice(first..=last);
                let content = [(CONTENT_DIGEST, told(Digest::of_bytes(&part)))];
                let range = [(header::CONTENT_RANGE, format!("bytes {first}-{last}/{whole}"))];
                let status = StatusCode::PARTIAL_CONTENT;
                (
                    status,
                    self.headers(),
                    media_type,
                    repr,
                    content,
                    range,
                    Body::from(part),
                )
                    .into_response()
            }
            Range::Outside(asked) => {
                let limit = format!("within the {whole} bytes of the file");
                let error = ApiError::new(
                    ProblemCode::RangeNotSatisfiable,
                    format!("range is {asked:?}; it must lie {limit}"),
                );
                let range = [(header::CONTENT_RANGE, format!("bytes */{whole}"))];
                (range, error.field(FieldError::new("range", asked, limit))).into_response()
            }
        }
    }

    fn headers(&self) -> [(header::HeaderName, HeaderValue); 3] {
        [
            (header::ETAG, self.tag.clone()),
            // A session that is deleted and made again counts from 1 again: always ask, and be told 304.
            (header::CACHE_CONTROL, HeaderValue::from_static("no-cache")),
            (header::ACCEPT_RANGES, HeaderValue::from_static("bytes")),
        ]
    }

    /// The one range that is asked for. Several at once, and other units, are answered with the whole, as RFC 9110
    /// allows; so is a range of another state of the file.
    fn range(&self, headers: &HeaderMap, whole: usize) -> Range {
        let same = headers
            .get(header::IF_RANGE)
            .is_none_or(|tag| tag.as_bytes() == self.tag.as_bytes());
        let asked = headers.get(header::RANGE).and_then(|value| value.to_str().ok());
        match asked.and_then(|text| text.strip_prefix("bytes=")) {
            Some(text) if same => parse_range(text, whole),
            _ => Range::Whole,
        }
    }
}

/// A digest as a header tells it.
fn told(digest: Digest) -> HeaderValue {
    let text = format!("sha-256=:{}:", STANDARD.encode(digest.as_bytes()));
    HeaderValue::from_str(&text).expect("invariant: base64 is printable")
}

#[derive(Debug, PartialEq, Eq)]
enum Range {
    Whole,
    Part(usize, usize),
    Outside(String),
}

fn parse_range(text: &str, whole: usize) -> Range {
    let Some((first, last)) = text.split_once('-') else {
        return Range::Whole;
    };
    match (first.parse::<usize>(), last.parse::<usize>()) {
        (Ok(first), Ok(last)) if first > last => Range::Whole,
        (Ok(first), Ok(last)) if first < whole => Range::Part(first, last.min(whole - 1)),
        (Ok(first), Err(_)) if last.is_empty() && first < whole => Range::Part(first, whole - 1),
        (Err(_), Ok(count)) if first.is_empty() && count > 0 && whole > 0 => {
            Range::Part(whole - count.min(whole), whole - 1)
        }
        (Ok(_), Ok(_)) => Range::Outside(text.to_owned()),
        (Ok(_), Err(_)) if last.is_empty() => Range::Outside(text.to_owned()),
        (Err(_), Ok(_)) if first.is_empty() => Range::Outside(text.to_owned()),
        _ => Range::Whole,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(name: header::HeaderName, value: &str) -> HeaderMap {
        HeaderMap::from_iter([(name, HeaderValue::from_str(value).expect("a header"))])
    }

    #[test]
    fn a_caller_that_names_the_tag_has_the_file() {
        let artifact = Artifact::kept(BlobKey::of(b"abc"), PNG);
        let tag = artifact.tag.to_str().expect("printable").to_owned();
        for known in [tag.clone(), format!("\"x\", {tag}"), format!("W/{tag}"), "*".to_owned()] {
            assert!(artifact.is_known_to(&headers(header::IF_NONE_MATCH, &known)), "{known}");
        }
        assert!(!artifact.is_known_to(&headers(header::IF_NONE_MATCH, "\"x\"")));
        assert!(!artifact.is_known_to(&HeaderMap::new()));
    }

    #[test]
    fn the_tags_of_different_files_of_one_content_differ() {
        let digest = Digest::of_bytes(b"abc");
        assert_ne!(Artifact::derived(digest, PNG).tag, Artifact::derived(digest, PGM).tag);
    }

    #[test]
    fn one_range_is_honoured_and_what_is_odd_is_answered_whole() {
        let outside = |text: &str| Range::Outside(text.to_owned());
        let cases = [
            ("0-3", Range::Part(0, 3)),
            ("4-", Range::Part(4, 9)),
            ("-4", Range::Part(6, 9)),
            ("0-99", Range::Part(0, 9)),
            ("10-", outside("10-")),
            ("-0", outside("-0")),
            ("3-1", Range::Whole),
            ("0-1,4-5", Range::Whole),
            ("x", Range::Whole),
        ];
        for (text, range) in cases {
            assert_eq!(parse_range(text, 10), range, "{text}");
        }
        let artifact = Artifact::kept(BlobKey::of(b"abc"), PNG);
        let answer = artifact.answer(&headers(header::RANGE, "bytes=1-2"), Bytes::from_static(b"abc"));
        assert_eq!(answer.status(), StatusCode::PARTIAL_CONTENT);
        assert_eq!(answer.headers()[header::CONTENT_RANGE], "bytes 1-2/3");
        // SHA-256 of abc, and of bc
        assert_eq!(
            answer.headers()[REPR_DIGEST],
            "sha-256=:ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=:"
        );
        assert_eq!(answer.headers()[CONTENT_DIGEST], told(Digest::of_bytes(b"bc")));
        let answer = artifact.answer(&headers(header::RANGE, "bytes=3-"), Bytes::from_static(b"abc"));
        assert_eq!(answer.status(), StatusCode::RANGE_NOT_SATISFIABLE);
        assert_eq!(answer.headers()[header::CONTENT_RANGE], "bytes */3");
    }
}

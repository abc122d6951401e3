//! What a request says of the bytes of its body: `Content-Digest` and `Repr-Digest` (RFC 9530).

use axum::http::{HeaderMap, HeaderName};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use bytes::Bytes;
use sha2::{Digest as _, Sha256, Sha512};

use crate::api::{FieldError, ProblemCode};
use crate::http::error::{ApiError, ApiResult};

/// The digest of what was sent.
pub(in crate::http) const CONTENT_DIGEST: HeaderName = HeaderName::from_static("content-digest");
/// The digest of the whole of what is represented; the same, as no body is encoded.
pub(in crate::http) const REPR_DIGEST: HeaderName = HeaderName::from_static("repr-digest");

/// The digests that a body must have.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct ToldDigests(Vec<Told>);

#[derive(Debug, PartialEq, Eq)]
struct Told {
    header: HeaderName,
    algorithm: Algorithm,
    digest: Vec<u8>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Algorithm {
    Sha256,
    Sha512,
}

impl ToldDigests {
    /// What the headers say. Algorithms that are not known here are left aside, as RFC 9530 wants it.
    pub(super) fn of(headers: &HeaderMap) -> ApiResult<Self> {
        let mut told = Vec::new();
        for header in [CONTENT_DIGEST, REPR_DIGEST] {
            for value in headers.get_all(&header) {
                let text = value.to_str().unwrap_or("\u{fffd}");
                for member in text.split(',') {
                    let (name, value) = member.split_once('=').ok_or_else(|| malformed(&header, text))?;
                    let algorithm = match name.trim() {
                        "sha-256" => Algorithm::Sha256,
                        "sha-512" => Algorithm::Sha512,
                        _ => continue,
                    };
                    told.push(Told {
                        digest: bytes_of(value).ok_or_else(|| malformed(&header, text))?,
                        header: header.clone(),
                        algorithm,
                    });
                }
            }
        }
        Ok(Self(told))
    }

    /// Refuses a body that has another digest.
    pub(super) async fn check(self, bytes: &Bytes) -> ApiResult<()> {
        if self.0.is_empty() {
            return Ok(());
        }
        let bytes = bytes.clone();
        // megabytes are not hashed on a thread that serves requests
        let checked = tokio::task::spawn_blocking(move || self.0.iter().try_for_each(|told| told.check(&bytes)));
        checked.await.map_err(ApiError::internal)?
    }
}

impl Told {
    fn check(&self, bytes: &[u8]) -> ApiResult<()> {
        let (name, found) = match self.algorithm {
            Algorithm::Sha256 => ("sha-256", Sha256::digest(bytes).to_vec()),
            Algorithm::Sha512 => ("sha-512", Sha512::digest(bytes).to_vec()),
        };
        if found == self.digest {
            return Ok(());
        }
        let form = |digest: &[u8]| format!("{name}=:{}:", STANDARD.encode(digest));
        let (sent, limit) = (form(&self.digest), form(&found));
        let detail = format!(
            "{} is {sent}, but the body that arrived has {limit}; send it again",
            self.header
        );
        Err(
            ApiError::new(ProblemCode::DigestMismatch, detail).field(FieldError::new(
                self.header.as_str(),
                sent,
                limit,
            )),
        )
    }
}

/// A byte sequence of RFC 8941: base64 between colons, then perhaps parameters.
fn bytes_of(value: &str) -> Option<Vec<u8>> {
    let value = value.split(';').next()?.trim();
    STANDARD.decode(value.strip_prefix(':')?.strip_suffix(':')?).ok()
}

fn malformed(header: &HeaderName, sent: &str) -> ApiError {
    let limit = "a dictionary as in sha-256=:BASE64: (RFC 9530)";
    let error = ApiError::new(
        ProblemCode::BadRequest,
        format!("{header} is {sent:?}; it must be {limit}"),
    );
    error.field(FieldError::new(header.as_str(), sent, limit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    /// RFC 9530, section 5.1 and appendix D: the digests of `{"hello": "world"}` with a line feed.
    const BODY: &[u8] = b"{\"hello\": \"world\"}\n";
    const SHA_256: &str = "sha-256=:RK/0qy18MlBSVnWgjwz6lZEWjP/lF5HF9bvEF8FabDg=:";

    fn told(value: &str) -> ApiResult<ToldDigests> {
        let headers = HeaderMap::from_iter([(CONTENT_DIGEST, HeaderValue::from_str(value).expect("a header"))]);
        ToldDigests::of(&headers)
    }

    async fn check(value: &str, body: &'static [u8]) -> ApiResult<()> {
        told(value)?.check(&Bytes::from_static(body)).await
    }

    #[tokio::test]
    async fn a_body_is_held_against_every_digest_that_is_known_here() {
        assert!(check(SHA_256, BODY).await.is_ok());
        assert!(check(&format!("md5=:AAAA:, {SHA_256};x=1"), BODY).await.is_ok());
        assert!(check("unixsum=30637", b"whatever").await.is_ok());
        let error = check(SHA_256, b"{}").await.expect_err("another body").to_string();
        assert!(error.contains("content-digest") && error.contains("RK/0"), "{error}");
        let both = format!("{SHA_256}, sha-512=:AAAA:");
        assert!(
            check(&both, BODY).await.is_err(),
            "one that fits does not make up for one that does not"
        );
    }

    #[test]
    fn a_digest_that_cannot_be_read_is_refused() {
        for bad in ["sha-256", "sha-256=RK/0", "sha-256=:R!:", "sha-256=:RK/0"] {
            assert!(told(bad).is_err(), "{bad}");
        }
        assert_eq!(
            ToldDigests::of(&HeaderMap::new()).expect("nothing"),
            ToldDigests::default()
        );
    }
}

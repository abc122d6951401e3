//! Bytes arrive as they were sent: digests of RFC 9530 with uploads, and a look at those of answers.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use reqwest::header::HeaderMap;
use sha2::{Digest as _, Sha256};

/// The headers that tell the digest of what is sent, and of the whole of what is represented: the same here, as nothing
/// is asked for in parts.
const HEADERS: [&str; 2] = ["content-digest", "repr-digest"];

/// The value of `Content-Digest` for these bytes.
pub(super) fn told(bytes: &[u8]) -> String {
    format!("sha-256=:{}:", STANDARD.encode(Sha256::digest(bytes)))
}

/// Holds bytes against what their headers say. What says nothing, or uses other hashes, is taken as it is.
///
/// # Errors
/// A sentence about the header that does not fit.
pub(super) fn check(headers: &HeaderMap, bytes: &[u8]) -> Result<(), String> {
    let mut found = None;
    for name in HEADERS {
        for value in headers.get_all(name) {
            let members = value.to_str().unwrap_or_default().split(',').map(str::trim);
            for member in members.filter(|member| member.starts_with("sha-256=:")) {
                let found: &String = found.get_or_insert_with(|| told(bytes));
                // parameters may follow
                if member.split(';').next() != Some(found.as_str()) {
                    return Err(format!("{name} is {member}, but what arrived has {found}"));
                }
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 9530, appendix D.
    const BODY: &[u8] = b"{\"hello\": \"world\"}\n";
    const SHA_256: &str = "sha-256=:RK/0qy18MlBSVnWgjwz6lZEWjP/lF5HF9bvEF8FabDg=:";

    fn headers(name: &'static str, value: &str) -> HeaderMap {
        HeaderMap::from_iter([(name.parse().expect("a name"), value.parse().expect("a value"))])
    }

    #[test]
    fn the_digest_of_the_standard_is_ours() {
        assert_eq!(told(BODY), SHA_256);
    }

    #[test]
    fn bytes_that_are_not_those_that_were_sent_are_noticed() {
        for name in HEADERS {
            for good in [SHA_256, &format!("md5=:AAAA:, {SHA_256};x=1"), "sha-512=:AAAA:", ""] {
                assert_eq!(check(&headers(name, good), BODY), Ok(()), "{good}");
            }
            let refused = check(&headers(name, SHA_256), b"{}").expect_err("other bytes");
            assert!(refused.contains(name) && refused.contains("RK/0"), "{refused}");
        }
        assert_eq!(check(&HeaderMap::new(), BODY), Ok(()));
    }
}

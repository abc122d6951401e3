//! A change that its caller has named, so that it takes effect once however often it is asked for.

use std::fmt;
use std::str::FromStr;

use super::Invalid;

/// The name that a caller gives to one change: the value of `Idempotency-Key`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CallName(String);

impl CallName {
    /// The most characters.
    pub const CHARS_MAX: usize = 255;

    /// The name, if it is allowed: 1 to 255 visible ASCII characters.
    ///
    /// # Errors
    /// [`Invalid`] names the limit.
    pub fn parse(text: &str) -> Result<Self, Invalid> {
        let good = (1..=Self::CHARS_MAX).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_graphic());
        good.then(|| Self(text.to_owned()))
            .ok_or_else(|| Invalid::new("idempotency-key", text, "1 to 255 visible ASCII characters"))
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for CallName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl FromStr for CallName {
    type Err = Invalid;
    fn from_str(text: &str) -> Result<Self, Invalid> {
        Self::parse(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_visible_and_not_too_long() {
        for good in ["7", "\"8e03978e-40d5-43dd-bc93-6894a57f9324\"", &"x".repeat(255)] {
            assert_eq!(CallName::parse(good).expect("allowed").as_str(), good);
        }
        for bad in ["", "two words", "schlüssel", &"x".repeat(256)] {
            let refused = CallName::parse(bad).expect_err(bad);
            assert!(refused.to_string().contains("idempotency-key"), "{refused}");
        }
    }
}

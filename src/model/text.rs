//! Short texts that people write.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::Invalid;

/// What [`is_plain`] says of characters, as a regular expression. Attributes that want a literal repeat it.
pub(super) const PLAIN: &str = r"^[^\u0000-\u001f\u007f-\u009f]*$";

/// Whether a text is not too long and has no control characters.
pub(super) fn is_plain(text: &str, chars_max: usize) -> bool {
    // a character takes at most 4 bytes: long texts are not counted
    text.len() <= 4 * chars_max && text.chars().count() <= chars_max && !text.chars().any(char::is_control)
}

macro_rules! plain_text {
    ($(#[$doc:meta])* $name:ident, $field:literal, $chars_max:tt) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
        #[serde(try_from = "String", into = "String")]
        #[schema(value_type = String, min_length = 1, max_length = $chars_max, pattern = r"^[^\u0000-\u001f\u007f-\u009f]*$")]
        pub struct $name(String);

        impl $name {
            /// The most characters.
            pub const CHARS_MAX: usize = $chars_max;

            /// The text, if it is allowed: not empty, not too long, no control characters.
            ///
            /// # Errors
            /// [`Invalid`] names the limit.
            pub fn parse(text: &str) -> Result<Self, Invalid> {
                let good = !text.is_empty() && is_plain(text, Self::CHARS_MAX);
                good.then(|| Self(text.to_owned())).ok_or_else(|| {
                    let limit = concat!("1 to ", $chars_max, " characters without control characters");
                    Invalid::new($field, text, limit)
                })
            }

            /// The text.
            #[must_use]
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl TryFrom<String> for $name {
            type Error = Invalid;
            fn try_from(text: String) -> Result<Self, Invalid> {
                Self::parse(&text)
            }
        }

        impl From<$name> for String {
            fn from(text: $name) -> Self {
                text.0
            }
        }
    };
}

plain_text!(
    /// Who said something: a person or a program.
    Author,
    "author",
    100
);
plain_text!(
    /// Why somebody said something.
    Note,
    "note",
    500
);

/// A title for people: at most [`Title::CHARS_MAX`] characters, no control characters.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(try_from = "String", into = "String")]
#[schema(value_type = String, max_length = 200, pattern = r"^[^\u0000-\u001f\u007f-\u009f]*$")]
pub struct Title(String);

impl Title {
    /// The most characters of a title.
    pub const CHARS_MAX: usize = 200;

    /// The title, if it is allowed.
    ///
    /// # Errors
    /// [`Invalid`] names the limit.
    pub fn parse(text: &str) -> Result<Self, Invalid> {
        is_plain(text, Self::CHARS_MAX)
            .then(|| Self(text.to_owned()))
            .ok_or_else(|| {
                let limit = format!("at most {} characters without control characters", Self::CHARS_MAX);
                Invalid::new("title", text, limit)
            })
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for Title {
    type Error = Invalid;
    fn try_from(text: String) -> Result<Self, Invalid> {
        Self::parse(&text)
    }
}

impl From<Title> for String {
    fn from(title: Title) -> Self {
        title.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pattern_says_what_the_check_says() {
        let pattern = PLAIN.strip_prefix("^[^").and_then(|rest| rest.strip_suffix("]*$"));
        let escaped: Vec<u32> = (pattern.expect("a class of characters").split(['-', '\\']))
            .filter_map(|text| u32::from_str_radix(text.strip_prefix('u')?, 16).ok())
            .collect();
        let [low, most_low, high, most_high] = escaped[..] else {
            panic!("two ranges: {escaped:x?}")
        };
        for character in '\0'..='\u{2fff}' {
            let code = u32::from(character);
            let excluded = (low..=most_low).contains(&code) || (high..=most_high).contains(&code);
            assert_eq!(is_plain(&character.to_string(), 1), !excluded, "{code:x}");
        }
    }

    #[test]
    fn a_title_out_of_range_is_refused_with_the_limit() {
        assert!(Title::parse("").is_ok() && Title::parse(&"ä".repeat(200)).is_ok());
        let error = Title::parse(&"x".repeat(201)).expect_err("too long");
        assert!(error.to_string().contains("at most 200 characters"), "{error}");
        assert!(Title::parse("a\nb").is_err());
    }

    #[test]
    fn texts_out_of_range_are_refused_with_the_limit() {
        assert_eq!(Author::parse("Ada L.").expect("a name").as_str(), "Ada L.");
        let error = Author::parse(&"x".repeat(101)).expect_err("too long");
        assert_eq!((error.field, error.limit.contains("100")), ("author", true));
        assert!(Author::parse("").is_err() && Author::parse("a\nb").is_err());
        assert!(Note::parse(&"ä".repeat(500)).is_ok() && Note::parse(&"ä".repeat(501)).is_err());
    }
}

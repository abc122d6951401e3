//! Short texts that people write.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::Invalid;
use super::session::is_plain;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_out_of_range_are_refused_with_the_limit() {
        assert_eq!(Author::parse("Ada L.").expect("a name").as_str(), "Ada L.");
        let error = Author::parse(&"x".repeat(101)).expect_err("too long");
        assert_eq!((error.field, error.limit.contains("100")), ("author", true));
        assert!(Author::parse("").is_err() && Author::parse("a\nb").is_err());
        assert!(Note::parse(&"ä".repeat(500)).is_ok() && Note::parse(&"ä".repeat(501)).is_err());
    }
}

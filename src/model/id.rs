//! The names that things go by.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use super::Invalid;

const NAME_LIMIT: &str = "1 to 64 of a-z, 0-9 and -, beginning with a letter or digit";

/// `[a-z0-9][a-z0-9-]{0,63}`
fn parse_name(field: &'static str, name: &str) -> Result<Box<str>, Invalid> {
    let allowed = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-';
    let good = (1..=64).contains(&name.len()) && !name.starts_with('-') && name.bytes().all(allowed);
    good.then(|| name.into())
        .ok_or_else(|| Invalid::new(field, name, NAME_LIMIT))
}

macro_rules! name {
    ($(#[$doc:meta])* $name:ident, $field:literal) => {
        $(#[$doc])*
        ///
        /// Invariant: `[a-z0-9][a-z0-9-]{0,63}`. `ward-3` is one; `Ward 3`, `-3` and the empty text are none.
        #[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
        #[serde(try_from = "String", into = "String")]
        #[schema(value_type = String, pattern = "^[a-z0-9][a-z0-9-]{0,63}$", examples("ward-3"))]
        pub struct $name(Box<str>);

        impl $name {
            /// The name, if it is allowed.
            ///
            /// # Errors
            /// [`Invalid`] says what a name looks like.
            pub fn parse(name: &str) -> Result<Self, Invalid> {
                parse_name($field, name).map(Self)
            }

            /// The name.
            #[must_use]
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(&self.0)
            }
        }

        impl FromStr for $name {
            type Err = Invalid;
            fn from_str(name: &str) -> Result<Self, Invalid> {
                Self::parse(name)
            }
        }

        impl TryFrom<String> for $name {
            type Error = Invalid;
            fn try_from(name: String) -> Result<Self, Invalid> {
                Self::parse(&name)
            }
        }

        impl From<$name> for String {
            fn from(name: $name) -> Self {
                name.0.into()
            }
        }
    };
}

name!(
    /// A session: a place and a time that robots map together. The caller chooses its name.
    SessionId,
    "session"
);
name!(
    /// A robot within a session.
    RobotId,
    "robot"
);

macro_rules! uuid_id {
    ($(#[$doc:meta])* $name:ident, $field:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
        #[serde(transparent)]
        #[schema(value_type = String, format = Uuid)]
        pub struct $name(Uuid);

        impl $name {
            /// The id of this UUID.
            #[must_use]
            pub fn new(uuid: Uuid) -> Self {
                Self(uuid)
            }

            /// The UUID.
            #[must_use]
            pub fn uuid(self) -> Uuid {
                self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.hyphenated().fmt(f)
            }
        }

        impl FromStr for $name {
            type Err = Invalid;
            fn from_str(text: &str) -> Result<Self, Invalid> {
                Uuid::try_parse(text)
                    .map(Self)
                    .map_err(|_| Invalid::new($field, text, "a UUID"))
            }
        }
    };
}

uuid_id!(
    /// One map that was received: a `UUIDv7`.
    MapId,
    "map"
);
uuid_id!(
    /// One job: a `UUIDv7`.
    JobId,
    "job"
);
uuid_id!(
    /// One standing constraint: a `UUIDv7`.
    ConstraintId,
    "constraint"
);
uuid_id!(
    /// One API key: a `UUIDv7`. No secret: it names the key in lists and logs.
    KeyId,
    "key"
);

/// The number of a version within its session: 1, 2, 3 ... without gaps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(try_from = "u32", into = "u32")]
#[schema(value_type = u32, minimum = 1)]
pub struct VersionNumber(u32);

impl VersionNumber {
    /// A session's first version.
    pub const FIRST: Self = Self(1);

    /// The number; `None` for zero.
    #[must_use]
    pub fn new(number: u32) -> Option<Self> {
        (number > 0).then_some(Self(number))
    }

    /// As a number.
    #[must_use]
    pub fn get(self) -> u32 {
        self.0
    }
}

impl fmt::Display for VersionNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl FromStr for VersionNumber {
    type Err = Invalid;
    fn from_str(text: &str) -> Result<Self, Invalid> {
        text.parse()
            .ok()
            .and_then(Self::new)
            .ok_or_else(|| Invalid::new("version", text, "a whole number from 1 on"))
    }
}

impl TryFrom<u32> for VersionNumber {
    type Error = Invalid;
    fn try_from(number: u32) -> Result<Self, Invalid> {
        Self::new(number).ok_or_else(|| Invalid::new("version", "0", "a whole number from 1 on"))
    }
}

impl From<VersionNumber> for u32 {
    fn from(number: VersionNumber) -> Self {
        number.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_small_letters_digits_and_inner_dashes_are_allowed() {
        for name in ["a", "7", "ward-3", "r2-d2-", &"x".repeat(64)] {
            assert_eq!(SessionId::parse(name).expect("allowed").as_str(), name);
        }
    }

    #[test]
    fn other_names_are_refused_with_the_field_the_value_and_the_limit() {
        for name in ["", "-a", "A", "a b", "a/b", "..", "ä", &"x".repeat(65)] {
            assert!(RobotId::parse(name).is_err(), "{name:?}");
        }
        let error = RobotId::parse("Ward 3").expect_err("refused");
        assert_eq!((error.field, error.value.as_str()), ("robot", "\"Ward 3\""));
        assert!(error.limit.contains("64"));
        assert!(serde_json::from_str::<SessionId>("\"A\"").is_err());
    }

    #[test]
    fn there_is_no_version_zero() {
        assert!(VersionNumber::new(0).is_none());
        assert!(serde_json::from_str::<VersionNumber>("0").is_err());
        assert_eq!(serde_json::to_string(&VersionNumber::FIRST).expect("serialises"), "1");
    }
}

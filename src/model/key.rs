//! API keys: who may call the service, and for what.
//!
//! A key is shown to its owner once, as `mapweld_ID_SECRET`; kept is the SHA-256 of the secret. The secret has 256 random
//! bits, so a plain hash is enough: there is nothing to guess that a slow hash would protect.

use std::fmt;
use std::str::FromStr;

use subtle::ConstantTimeEq;
use uuid::Uuid;

use super::{Digest, Invalid, KeyId, RobotId, SessionId, Timestamp};

/// What is kept of a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ApiKey {
    /// Names it in lists and logs.
    pub id: KeyId,
    /// What its owner calls it.
    pub name: KeyName,
    /// What it is good for.
    pub scope: Scope,
    /// SHA-256 of its secret.
    pub digest: Digest,
    /// When it was made.
    pub created_at: Timestamp,
    /// From when on it is not good any more; never, if none.
    pub expires_at: Option<Timestamp>,
    /// When it was taken back.
    pub revoked_at: Option<Timestamp>,
}

/// What a key is good for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Scope {
    /// Everything, also what cannot be undone.
    Admin,
    /// All sessions: making and changing them, pushing for any robot, merging.
    Operator,
    /// One robot: pushing its own maps, and reading what becomes of them in its own session.
    Robot {
        /// Its session.
        session: SessionId,
        /// Its name in this session.
        robot: RobotId,
    },
    /// Reading everything, changing nothing.
    Read,
}

/// What a key's owner calls it.
///
/// Invariant: 1 to 64 of ASCII letters, digits, space and `._@-`: it stands in logs as it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeyName(Box<str>);

/// A key as a caller shows it. Its secret never leaves it but by [`ShownKey::reveal`]; not even its `Debug` tells it.
#[derive(Clone)]
pub struct ShownKey {
    id: KeyId,
    secret: [u8; 32],
}

/// Whether a key is good.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// It is.
    Good,
    /// It was, until then.
    Expired(Timestamp),
    /// It was, until somebody took it back.
    Revoked(Timestamp),
}

impl ApiKey {
    /// Whether this is the key that is shown; in a time that does not depend on how much of it is right.
    #[must_use]
    pub fn is(&self, shown: &ShownKey) -> bool {
        let same = self.digest.as_bytes().ct_eq(shown.digest().as_bytes());
        self.id == shown.id && bool::from(same)
    }

    /// Whether it is good at this time.
    #[must_use]
    pub fn standing(&self, now: Timestamp) -> Standing {
        match (self.revoked_at, self.expires_at) {
            (Some(revoked), _) if revoked <= now => Standing::Revoked(revoked),
            (_, Some(expires)) if expires <= now => Standing::Expired(expires),
            _ => Standing::Good,
        }
    }
}

impl Scope {
    /// Its words, without whom it is for.
    pub const WORDS: [&str; 4] = ["admin", "operator", "robot", "read"];

    /// Its word, without whom it is for.
    #[must_use]
    pub fn as_str(&self) -> &'static str {
        match self {
            Self::Admin => "admin",
            Self::Operator => "operator",
            Self::Robot { .. } => "robot",
            Self::Read => "read",
        }
    }

    /// The scope of this word; a robot's needs its session and its name, the others have none.
    ///
    /// # Errors
    /// [`Invalid`] names what is missing, unknown or too much.
    pub fn parse(word: &str, session: Option<SessionId>, robot: Option<RobotId>) -> Result<Self, Invalid> {
        match (word, session, robot) {
            ("robot", Some(session), Some(robot)) => Ok(Self::Robot { session, robot }),
            ("robot", None, _) => Err(Invalid::new(
                "session",
                "",
                "named: a robot's key is good for one session",
            )),
            ("robot", _, None) => Err(Invalid::new("robot", "", "named: a robot's key is good for one robot")),
            ("admin" | "operator" | "read", Some(session), _) => Err(Invalid::new(
                "session",
                session.as_str(),
                "absent: only the key of a robot belongs to a session",
            )),
            ("admin" | "operator" | "read", _, Some(robot)) => Err(Invalid::new(
                "robot",
                robot.as_str(),
                "absent: only the key of a robot belongs to a robot",
            )),
            ("admin", None, None) => Ok(Self::Admin),
            ("operator", None, None) => Ok(Self::Operator),
            ("read", None, None) => Ok(Self::Read),
            _ => Err(Invalid::new("scope", word, "admin, operator, robot or read")),
        }
    }
}

/// The word, and for a robot its session and name: `robot warehouse/r1`.
impl fmt::Display for Scope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Robot { session, robot } => write!(f, "robot {session}/{robot}"),
            other => f.write_str(other.as_str()),
        }
    }
}

impl KeyName {
    /// The name, if it is allowed.
    ///
    /// # Errors
    /// [`Invalid`] says what a name looks like.
    pub fn parse(name: &str) -> Result<Self, Invalid> {
        let allowed = |byte: u8| byte.is_ascii_alphanumeric() || b" ._@-".contains(&byte);
        let good = (1..=64).contains(&name.len()) && name.bytes().all(allowed);
        good.then(|| Self(name.into()))
            .ok_or_else(|| Invalid::new("name", name, "1 to 64 of A-Z, a-z, 0-9, space and ._@-"))
    }

    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for KeyName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl FromStr for KeyName {
    type Err = Invalid;
    fn from_str(name: &str) -> Result<Self, Invalid> {
        Self::parse(name)
    }
}

impl ShownKey {
    /// The key with this secret, which must be random.
    #[must_use]
    pub fn new(id: KeyId, secret: [u8; 32]) -> Self {
        Self { id, secret }
    }

    /// Reads `mapweld_ID_SECRET`; `None` for anything else. The text is not told: it may be a secret with a typing
    /// mistake.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let (id, secret) = text.strip_prefix("mapweld_")?.split_once('_')?;
        let canonical = id.len() == 32 && !id.bytes().any(|byte| byte.is_ascii_uppercase());
        let id = Uuid::try_parse(id).ok().filter(|_| canonical)?;
        // a digest is written as a secret is: 64 small hexadecimal digits
        let secret: Digest = secret.parse().ok()?;
        Some(Self::new(KeyId::new(id), *secret.as_bytes()))
    }

    /// Which key it claims to be.
    #[must_use]
    pub fn id(&self) -> KeyId {
        self.id
    }

    /// What is kept of its secret.
    #[must_use]
    pub fn digest(&self) -> Digest {
        Digest::of_bytes(&self.secret)
    }

    /// The key in full, for its owner and nobody else.
    #[must_use]
    pub fn reveal(&self) -> String {
        let secret = self.secret.iter().fold(String::new(), |mut text, byte| {
            text.extend([byte >> 4, byte & 15].map(|digit| char::from_digit(u32::from(digit), 16).unwrap_or('0')));
            text
        });
        format!("mapweld_{}_{secret}", self.id.uuid().simple())
    }
}

impl fmt::Debug for ShownKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ShownKey({}, ...)", self.id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(number: u8) -> (ShownKey, ApiKey) {
        let shown = ShownKey::new(KeyId::new(Uuid::from_u128(7)), [number; 32]);
        let kept = ApiKey {
            id: shown.id(),
            name: KeyName::parse("crane 7").expect("a name"),
            scope: Scope::Read,
            digest: shown.digest(),
            created_at: Timestamp::UNIX_EPOCH,
            expires_at: None,
            revoked_at: None,
        };
        (shown, kept)
    }

    #[test]
    fn a_key_survives_its_text_and_nothing_else_is_one() {
        let text = key(0xab).0.reveal();
        assert_eq!(text.len(), "mapweld__".len() + 32 + 64);
        let again = ShownKey::parse(&text).expect("a key");
        assert_eq!(again.reveal(), text);
        let cut = &text[..text.len() - 1];
        for bad in [
            "",
            "mapweld_",
            cut,
            &text.to_uppercase(),
            &text[1..],
            &format!("{text}0"),
        ] {
            assert!(ShownKey::parse(bad).is_none(), "{bad}");
        }
    }

    #[test]
    fn only_the_right_secret_under_the_right_id_is_the_key() {
        let (shown, kept) = key(1);
        assert!(kept.is(&shown));
        assert!(!kept.is(&key(2).0), "another secret");
        let other = ShownKey::new(KeyId::new(Uuid::from_u128(8)), [1; 32]);
        assert!(!kept.is(&other), "another id");
    }

    #[test]
    fn a_secret_does_not_show_in_what_is_printed_for_programmers() {
        let (shown, kept) = key(0xab);
        for text in [format!("{shown:?}"), format!("{kept:?}")] {
            assert!(!text.contains("abab"), "{text}");
        }
    }

    #[test]
    fn a_key_is_good_until_it_expires_or_is_revoked() {
        let at = |second| Timestamp::from_second(second).expect("a time");
        let (_, mut kept) = key(1);
        assert_eq!(kept.standing(at(1_000_000)), Standing::Good);
        kept.expires_at = Some(at(10));
        assert_eq!(kept.standing(at(9)), Standing::Good);
        assert_eq!(kept.standing(at(10)), Standing::Expired(at(10)));
        kept.revoked_at = Some(at(5));
        assert_eq!(kept.standing(at(10)), Standing::Revoked(at(5)));
    }

    #[test]
    fn a_robots_scope_names_its_session_and_robot_and_no_other_does() {
        let session = || SessionId::parse("hall").ok();
        let robot = || RobotId::parse("r1").ok();
        let scope = Scope::parse("robot", session(), robot()).expect("both");
        assert_eq!(scope.to_string(), "robot hall/r1");
        let field = |word, session, robot| Scope::parse(word, session, robot).expect_err("refused").field;
        assert_eq!(field("robot", None, robot()), "session");
        assert_eq!(field("robot", session(), None), "robot");
        assert_eq!(field("owner", None, None), "scope");
        for word in Scope::WORDS.into_iter().filter(|word| *word != "robot") {
            assert_eq!(Scope::parse(word, None, None).expect("alone").as_str(), word);
            assert_eq!(field(word, session(), None), "session");
            assert_eq!(field(word, None, robot()), "robot");
        }
    }

    #[test]
    fn a_name_can_stand_in_a_log() {
        assert!(KeyName::parse("Anna B. - crane_7@dock").is_ok());
        for bad in ["", "two\nlines", "a=\"b\"", &"x".repeat(65)] {
            assert!(KeyName::parse(bad).is_err(), "{bad:?}");
        }
    }
}

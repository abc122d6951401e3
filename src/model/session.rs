//! A session: a place and a time that robots map together.

use std::collections::BTreeMap;
use std::num::NonZeroU32;

use serde::{Deserialize, Serialize};
use utoipa::openapi::{ObjectBuilder, RefOr, Schema, Type};
use utoipa::{PartialSchema, ToSchema};

use super::{Invalid, MethodSpec, RobotId, SessionId, Timestamp};
use crate::grid::Lattice;

/// A session as it is kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    /// Its name.
    pub id: SessionId,
    /// What can be changed about it.
    pub settings: SessionSettings,
    /// When it was made.
    pub created_at: Timestamp,
    /// When its settings last changed.
    pub updated_at: Timestamp,
}

/// What can be said about a session when it is made, and changed later.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SessionSettings {
    /// A title for people.
    pub title: Option<Title>,
    /// Labels to find it by.
    pub labels: Labels,
    /// The robot whose map frame is the session frame; the first robot to push, unless it is said.
    pub anchor: Option<RobotId>,
    /// Whether an upload starts a merge by itself.
    pub auto_merge: bool,
    /// How maps are registered.
    pub method: MethodSpec,
    /// Resolution of the fused map in metres a cell; the finest of the maps, unless it is said.
    pub resolution: Option<Resolution>,
    /// How many versions are kept, the newest ones; as many as the server keeps, unless it is said. With versions go the
    /// maps that no version is made of any more.
    #[schema(value_type = Option<u32>, format = Int64, minimum = 1, maximum = 4_294_967_295_u64)]
    pub keep_versions: Option<NonZeroU32>,
}

impl Default for SessionSettings {
    fn default() -> Self {
        Self {
            title: None,
            labels: Labels::default(),
            anchor: None,
            auto_merge: true,
            method: MethodSpec::default(),
            resolution: None,
            keep_versions: None,
        }
    }
}

impl SessionSettings {
    /// Whether a request to make a session with `self` is answered by one that has `standing`: equal, except that an
    /// anchor that was not asked for may have been chosen since.
    #[must_use]
    pub fn is_met_by(&self, standing: &Self) -> bool {
        let mut asked = self.clone();
        if asked.anchor.is_none() {
            asked.anchor.clone_from(&standing.anchor);
        }
        asked == *standing
    }
}

/// A change of a session's settings: what is absent stays; `null` takes back what may be absent.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SessionPatch {
    /// A new title.
    #[serde(with = "present", skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Title>)]
    pub title: Option<Option<Title>>,
    /// New labels, all of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub labels: Option<Labels>,
    /// A new anchor; versions from now on are told in its frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub anchor: Option<RobotId>,
    /// Whether an upload starts a merge by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub auto_merge: Option<bool>,
    /// A new method.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub method: Option<MethodSpec>,
    /// A new resolution of the fused map, in metres a cell.
    #[serde(with = "present", skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Resolution>)]
    pub resolution: Option<Option<Resolution>>,
    /// How many versions to keep from now on.
    #[serde(with = "present", skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<u32>, format = Int64, minimum = 1, maximum = 4_294_967_295_u64)]
    pub keep_versions: Option<Option<NonZeroU32>>,
}

impl SessionPatch {
    /// The settings with this change made.
    #[must_use]
    pub fn applied_to(self, settings: SessionSettings) -> SessionSettings {
        SessionSettings {
            title: self.title.unwrap_or(settings.title),
            labels: self.labels.unwrap_or(settings.labels),
            anchor: self.anchor.or(settings.anchor),
            auto_merge: self.auto_merge.unwrap_or(settings.auto_merge),
            method: self.method.unwrap_or(settings.method),
            resolution: self.resolution.unwrap_or(settings.resolution),
            keep_versions: self.keep_versions.unwrap_or(settings.keep_versions),
        }
    }
}

/// Tells `null` (take it back) from an absent field (let it stay).
mod present {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[expect(clippy::option_option, reason = "absent, null and a value are three answers")]
    pub(super) fn deserialize<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<Option<T>>, D::Error> {
        Option::deserialize(deserializer).map(Some)
    }

    #[expect(
        clippy::option_option,
        clippy::ref_option,
        reason = "absent, null and a value are three answers; serde gives the reference"
    )]
    pub(super) fn serialize<T: Serialize, S: Serializer>(
        field: &Option<Option<T>>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        field.serialize(serializer)
    }
}

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

/// Labels by name: at most [`Labels::COUNT_MAX`]; names of 1 to [`Labels::CHARS_MAX`] characters, values of at most as
/// many, no control characters.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "BTreeMap<String, String>", into = "BTreeMap<String, String>")]
pub struct Labels(BTreeMap<String, String>);

impl PartialSchema for Labels {
    fn schema() -> RefOr<Schema> {
        let text = |least| {
            ObjectBuilder::new()
                .schema_type(Type::String)
                .min_length(Some(least))
                .max_length(Some(Self::CHARS_MAX))
                .pattern(Some(r"^[^\u0000-\u001f\u007f-\u009f]*$"))
        };
        let labels = ObjectBuilder::new()
            .schema_type(Type::Object)
            .description(Some("Labels by name, none with control characters."))
            .property_names(Some(text(1)))
            .additional_properties(Some(Schema::from(text(0))))
            .max_properties(Some(Self::COUNT_MAX));
        labels.into()
    }
}

impl ToSchema for Labels {}

impl Labels {
    /// The most labels of a session.
    pub const COUNT_MAX: usize = 32;
    /// The most characters of a label's name, and of its value.
    pub const CHARS_MAX: usize = 100;

    /// The labels, if they are allowed.
    ///
    /// # Errors
    /// [`Invalid`] names the label and the limit.
    pub fn parse(labels: BTreeMap<String, String>) -> Result<Self, Invalid> {
        if labels.len() > Self::COUNT_MAX {
            let limit = format!("at most {} labels", Self::COUNT_MAX);
            return Err(Invalid::new("labels", &labels.len().to_string(), limit));
        }
        let good = |text: &str| is_plain(text, Self::CHARS_MAX);
        match labels
            .iter()
            .find(|(name, value)| name.is_empty() || !good(name) || !good(value))
        {
            None => Ok(Self(labels)),
            Some((name, value)) => {
                let limit = format!(
                    "names of 1 to {max} and values of at most {max} characters without control characters",
                    max = Self::CHARS_MAX
                );
                Err(Invalid::new("labels", &format!("{name}={value}"), limit))
            }
        }
    }

    /// The labels by name.
    #[must_use]
    pub fn as_map(&self) -> &BTreeMap<String, String> {
        &self.0
    }
}

impl TryFrom<BTreeMap<String, String>> for Labels {
    type Error = Invalid;
    fn try_from(labels: BTreeMap<String, String>) -> Result<Self, Invalid> {
        Self::parse(labels)
    }
}

impl From<Labels> for BTreeMap<String, String> {
    fn from(labels: Labels) -> Self {
        labels.0
    }
}

/// Which sessions are asked for, by their labels: those that have all of these, with this value where one is said.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct LabelFilter(BTreeMap<String, Option<String>>);

impl LabelFilter {
    /// A filter of texts `NAME=VALUE`, split at the first `=`, or `NAME`.
    ///
    /// # Errors
    /// [`Invalid`] names the text that is no label, or that asks for another value of a name that was there before.
    pub fn parse<'a>(texts: impl IntoIterator<Item = &'a str>) -> Result<Self, Invalid> {
        let mut wanted = BTreeMap::new();
        for text in texts {
            let (name, value) = match text.split_once('=') {
                Some((name, value)) => (name, Some(value)),
                None => (text, None),
            };
            let good = |text: &str| is_plain(text, Labels::CHARS_MAX);
            if name.is_empty() || !good(name) || !value.is_none_or(good) {
                let limit = format!("NAME or NAME=VALUE of at most {} characters each", Labels::CHARS_MAX);
                return Err(Invalid::new("label", text, limit));
            }
            let before = wanted.insert(name.to_owned(), value.map(str::to_owned));
            if before.is_some() {
                return Err(Invalid::new(
                    "label",
                    text,
                    "of another name than the other labels that are asked for",
                ));
            }
            if wanted.len() > Labels::COUNT_MAX {
                let limit = format!("one of at most {} labels", Labels::COUNT_MAX);
                return Err(Invalid::new("label", text, limit));
            }
        }
        Ok(Self(wanted))
    }
}

/// Metres a cell that a lattice can have.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(try_from = "f64", into = "f64")]
#[schema(value_type = f64, minimum = 0.001, maximum = 100)]
pub struct Resolution(f64);

impl Resolution {
    /// The resolution, if a lattice can have it.
    ///
    /// # Errors
    /// [`Invalid`] names the range.
    pub fn parse(metres: f64) -> Result<Self, Invalid> {
        let (min, max) = (Lattice::RESOLUTION_MIN, Lattice::RESOLUTION_MAX);
        (min..=max).contains(&metres).then_some(Self(metres)).ok_or_else(|| {
            Invalid::new(
                "resolution",
                &metres.to_string(),
                format!("within {min} and {max} metres a cell"),
            )
        })
    }

    /// Metres a cell.
    #[must_use]
    pub fn metres(self) -> f64 {
        self.0
    }
}

impl TryFrom<f64> for Resolution {
    type Error = Invalid;
    fn try_from(metres: f64) -> Result<Self, Invalid> {
        Self::parse(metres)
    }
}

impl From<Resolution> for f64 {
    fn from(resolution: Resolution) -> Self {
        resolution.0
    }
}

pub(super) fn is_plain(text: &str, chars_max: usize) -> bool {
    // a character takes at most 4 bytes: long texts are not counted
    text.len() <= 4 * chars_max && text.chars().count() <= chars_max && !text.chars().any(char::is_control)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_made_of_nothing_and_refuse_what_they_do_not_know() {
        let settings: SessionSettings = serde_json::from_str("{}").expect("all optional");
        assert_eq!(settings, SessionSettings::default());
        assert!(settings.auto_merge);
        assert!(serde_json::from_str::<SessionSettings>(r#"{"automerge":true}"#).is_err());
        assert!(serde_json::from_str::<SessionSettings>(r#"{"resolution":0}"#).is_err());
    }

    #[test]
    fn settings_survive_json() {
        let text = r#"{"title":"Ward 3","labels":{"floor":"2"},"anchor":"r1","auto_merge":false,"resolution":0.05}"#;
        let settings: SessionSettings = serde_json::from_str(text).expect("parses");
        let again = serde_json::to_string(&settings).expect("serialises");
        assert_eq!(
            serde_json::from_str::<SessionSettings>(&again).expect("parses again"),
            settings
        );
    }

    #[test]
    fn a_patch_tells_null_from_absent() {
        let settings: SessionSettings = serde_json::from_str(r#"{"title":"old","resolution":0.1}"#).expect("parses");
        let patch: SessionPatch = serde_json::from_str(r#"{"title":null,"auto_merge":false}"#).expect("parses");
        let patched = patch.applied_to(settings);
        assert_eq!(patched.title, None);
        assert_eq!(patched.resolution.map(Resolution::metres), Some(0.1));
        assert!(!patched.auto_merge);
    }

    #[test]
    fn settings_asked_for_without_an_anchor_are_met_by_any_anchor() {
        let asked = SessionSettings::default();
        let standing = SessionSettings {
            anchor: Some(RobotId::parse("r1").expect("a name")),
            ..SessionSettings::default()
        };
        assert!(asked.is_met_by(&standing));
        assert!(!standing.is_met_by(&asked));
    }

    #[test]
    fn a_filter_names_labels_with_their_values_or_without() {
        let filter = LabelFilter::parse(["floor=2", "site", "note=a=b", "empty="]).expect("labels");
        let json = serde_json::to_string(&filter).expect("serialises");
        assert_eq!(json, r#"{"empty":"","floor":"2","note":"a=b","site":null}"#);
        for bad in [&["=2"][..], &[""], &["floor=1", "floor=2"], &["a\nb"]] {
            assert!(LabelFilter::parse(bad.iter().copied()).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn titles_and_labels_out_of_range_are_refused_with_the_limit() {
        assert!(Title::parse(&"ä".repeat(200)).is_ok());
        let error = Title::parse(&"x".repeat(201)).expect_err("too long");
        assert!(error.to_string().contains("at most 200 characters"), "{error}");
        assert!(Title::parse("a\nb").is_err());
        let label = |name: &str, value: &str| Labels::parse(BTreeMap::from([(name.to_owned(), value.to_owned())]));
        assert!(label("floor", "").is_ok());
        assert!(label("", "2").is_err());
        assert!(label("floor", &"2".repeat(101)).is_err());
        let many = (0..33).map(|i| (i.to_string(), String::new())).collect();
        assert!(Labels::parse(many).is_err());
    }
}

//! A session: a place and a time that robots map together.

use std::num::NonZeroU32;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{Invalid, Labels, MethodSpec, RobotId, SessionId, Timestamp, Title};
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
}

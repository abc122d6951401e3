//! A version: the answer of one merge, kept for good.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;
use serde_json::value::RawValue;

use super::{BlobKey, Digest, Invalid, JobId, MapId, RobotId, SessionId, Timestamp, VersionNumber};

/// One fused map of a session with everything that explains it. Immutable.
#[derive(Debug, Clone, PartialEq)]
pub struct Version {
    /// The session.
    pub session: SessionId,
    /// Its number in the session.
    pub number: VersionNumber,
    /// The version before it.
    pub parent: Option<VersionNumber>,
    /// The job that made it.
    pub job: JobId,
    /// The robot whose map frame it is told in.
    pub anchor: RobotId,
    /// The maps that went in, one a robot, ordered by robot.
    pub inputs: Vec<VersionInput>,
    /// What is placed where and why; the document that answers a one-shot merge of the same maps.
    pub result: ResultText,
    /// The cells of the fused map.
    pub grid: BlobKey,
    /// The fused map as a picture for map servers.
    pub png: BlobKey,
    /// Each robot in its own colour.
    pub overlay: BlobKey,
    /// [`Digest::of_grid`] of the fused map.
    pub digest: Digest,
    /// The version whose content this one repeats; none for a merge.
    pub restored_from: Option<VersionNumber>,
    /// When it was published.
    pub created_at: Timestamp,
}

/// One map that went into a version.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VersionInput {
    /// The robot.
    pub robot: RobotId,
    /// Its map.
    pub map: MapId,
    /// The map's content.
    pub digest: Digest,
}

/// A JSON document that is handed on as it was written, byte for byte: numbers are not read and written again.
#[derive(Debug, Clone)]
pub struct ResultText(Box<RawValue>);

impl ResultText {
    /// The document of any value.
    ///
    /// # Errors
    /// When the value cannot be written as JSON.
    pub fn of(value: &impl Serialize) -> Result<Self, serde_json::Error> {
        serde_json::value::to_raw_value(value).map(Self)
    }

    /// A document that was written before.
    ///
    /// # Errors
    /// When the text is no JSON.
    pub fn parse(text: String) -> Result<Self, serde_json::Error> {
        RawValue::from_string(text).map(Self)
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        self.0.get()
    }

    /// The document, to be put into another one.
    #[must_use]
    pub fn raw(&self) -> &RawValue {
        &self.0
    }
}

impl PartialEq for ResultText {
    fn eq(&self, other: &Self) -> bool {
        self.as_str() == other.as_str()
    }
}

impl Eq for ResultText {}

impl Serialize for ResultText {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

/// Which version is asked for: `latest` or a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VersionSelector {
    /// The newest.
    Latest,
    /// This one.
    Number(VersionNumber),
}

impl fmt::Display for VersionSelector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Latest => f.write_str("latest"),
            Self::Number(number) => number.fmt(f),
        }
    }
}

impl FromStr for VersionSelector {
    type Err = Invalid;
    fn from_str(text: &str) -> Result<Self, Invalid> {
        if text == "latest" {
            return Ok(Self::Latest);
        }
        text.parse()
            .ok()
            .and_then(VersionNumber::new)
            .map(Self::Number)
            .ok_or_else(|| Invalid::new("version", text, "\"latest\" or a whole number from 1 on"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_version_is_asked_for_by_number_or_as_the_latest() {
        assert_eq!("latest".parse(), Ok(VersionSelector::Latest));
        assert_eq!("1".parse(), Ok(VersionSelector::Number(VersionNumber::FIRST)));
        for bad in ["0", "-1", "1.5", "newest", ""] {
            assert!(bad.parse::<VersionSelector>().is_err(), "{bad:?}");
        }
    }

    #[test]
    fn a_result_keeps_its_bytes() {
        let text = r#"{"b":0.1000,"a":[1e3]}"#;
        let result = ResultText::parse(text.to_owned()).expect("JSON");
        assert_eq!(serde_json::to_string(&result).expect("serialises"), text);
        assert!(ResultText::parse("{".to_owned()).is_err());
    }
}

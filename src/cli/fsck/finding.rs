//! What a check finds, a line of JSON each.

use serde::Serialize;

use crate::model::BlobKey;

/// One thing that is not as it should be.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Finding {
    /// What kind of thing.
    pub(super) kind: Kind,
    /// The blob, if it is about one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) blob: Option<String>,
    /// The record, if it is about one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) record: Option<String>,
    /// In words.
    pub(super) detail: String,
}

/// The kinds of finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Kind {
    /// The database finds its file damaged.
    DatabaseDamaged,
    /// A record cannot be read.
    RecordDamaged,
    /// A record names bytes that are not there.
    BlobMissing,
    /// Bytes are not those that were kept.
    BlobDamaged,
    /// A record says something else than its bytes.
    RecordMismatch,
    /// Versions of a session do not count without gaps.
    VersionGap,
    /// Bytes that no record names: no damage.
    Orphan,
    /// Something among the blobs that is none: no damage.
    Stray,
}

impl Kind {
    /// Whether something was lost.
    pub(super) fn is_damage(self) -> bool {
        !matches!(self, Self::Orphan | Self::Stray)
    }
}

impl Finding {
    pub(super) fn new(kind: Kind, detail: impl Into<String>) -> Self {
        Self {
            kind,
            blob: None,
            record: None,
            detail: detail.into(),
        }
    }

    pub(super) fn of(self, record: impl Into<String>) -> Self {
        Self {
            record: Some(record.into()),
            ..self
        }
    }

    pub(super) fn at(self, blob: BlobKey) -> Self {
        Self {
            blob: Some(blob.to_string()),
            ..self
        }
    }

    /// It as a line.
    pub(super) fn line(&self) -> String {
        serde_json::to_string(self).expect("invariant: a finding is plain data")
    }
}

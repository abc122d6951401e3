//! The records of the service: sessions, maps, jobs, versions, and the names they go by.
//!
//! Imports `geometry`, `grid` and `registration`. Pure types: what they mean and which values are allowed; how they are
//! kept is the business of `store`, how they look on the wire that of `api`.

mod call;
mod constraint;
mod digest;
mod id;
mod job;
mod key;
mod labels;
mod map;
mod pose;
mod session;
mod steering;
mod text;
mod trace;
mod version;

pub use call::CallName;
pub use constraint::{Apart, Constraint, Fixed, Guess, Hypothesis, Rule};
pub use digest::{BlobKey, Digest};
pub use id::{ConstraintId, JobId, KeyId, MapId, RobotId, SessionId, VersionNumber};
pub use job::{Job, JobError, JobKind, JobState, MergeRequest, StageSeconds};
pub use key::{ApiKey, KeyName, Scope, ShownKey, Standing};
pub use labels::{LabelFilter, Labels};
pub use map::{MapRecord, NewMap, RobotSummary};
pub use pose::Pose;
pub use session::{Resolution, Session, SessionPatch, SessionSettings};
pub use steering::{Clash, Effect, Steering, Tie, beside};
pub use text::{Author, Note, Title};
pub use trace::TraceParent;
pub use version::{ResultText, Version, VersionInput, VersionSelector};

/// Which method registers the maps of a session, and with which parameters.
pub use crate::registration::MethodSpec;

/// A moment, to the microsecond in the records.
pub use jiff::Timestamp;

/// A value from outside that a record cannot hold: which field, which value, and what would have been allowed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field} {value} is not allowed: it must be {limit}")]
pub struct Invalid {
    /// The field's name in requests.
    pub field: &'static str,
    /// What it was, shortened for messages.
    pub value: String,
    /// What is allowed.
    pub limit: String,
}

impl Invalid {
    /// Longest part of a bad value that is repeated in a message.
    const SHOWN_CHARS: usize = 80;

    pub(crate) fn new(field: &'static str, value: &str, limit: impl Into<String>) -> Self {
        let mut value = format!("{value:?}");
        if let Some((cut, _)) = value.char_indices().nth(Self::SHOWN_CHARS) {
            value.truncate(cut);
            value.push('…');
        }
        Self {
            field,
            value,
            limit: limit.into(),
        }
    }
}

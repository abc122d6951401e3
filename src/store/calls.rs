//! Changes that callers have named: a request that comes again is answered again, and changes nothing again.
//!
//! The protocol:
//!
//! 1. A request under a name is entered before it takes effect ([`CallStore::begin_call`]), with its digest and with the
//!    id of what it will make. Whoever comes under the same name meanwhile is told to come again, or that the name stands
//!    for another request.
//! 2. It takes effect. What it makes has the id that was entered: an attempt that comes after one that was lost between
//!    this step and the next finds it, and makes nothing. So it needs no transaction around both.
//! 3. Its answer is kept ([`CallStore::keep_answer`]), and given again until it expires.
//!
//! A request that is refused has changed nothing: the name is given back ([`CallStore::end_call`]). An attempt of which
//! nothing is heard any more holds the name for its lease only.

use async_trait::async_trait;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::StoreError;
use crate::model::{CallName, Digest, Timestamp};

/// Where named changes are kept.
#[async_trait]
pub trait CallStore: Send + Sync {
    /// Enters a request that is about to take effect.
    async fn begin_call(&self, call: &Call, now: Timestamp) -> Result<Begun, StoreError>;

    /// Keeps the answer, whoever of several attempts has it first: they have made the same.
    async fn keep_answer(&self, attempt: &Attempt, answer: &KeptAnswer) -> Result<(), StoreError>;

    /// Ends an attempt that has no answer to be kept. Changes nothing when another attempt has begun since.
    async fn end_call(&self, attempt: &Attempt, end: CallEnd, now: Timestamp) -> Result<(), StoreError>;

    /// Forgets what has expired; says how many.
    async fn forget_calls(&self, now: Timestamp) -> Result<u64, StoreError>;
}

/// A request under a name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Call {
    /// Whose name it is: the id of a key, or "anyone".
    pub owner: String,
    /// The name.
    pub name: CallName,
    /// Method, path and query.
    pub target: String,
    /// The digest of the body.
    pub digest: Digest,
    /// The id of what it makes, unless an earlier attempt has one.
    pub makes: Uuid,
    /// Until when the name is held for this attempt.
    pub lease_until: Timestamp,
    /// From when on the name is free again.
    pub expires_at: Timestamp,
}

/// What came of entering a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Begun {
    /// It shall take effect.
    Now(Attempt),
    /// It has taken effect, and this was the answer.
    Answered(KeptAnswer),
    /// Another attempt is under way.
    UnderWay,
    /// The name stands for another request.
    OtherRequest,
}

/// The right to let a named request take effect.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attempt {
    /// Whose name it is.
    pub owner: String,
    /// The name.
    pub name: CallName,
    /// The id of what it makes.
    pub makes: Uuid,
    /// Grows with every attempt.
    pub token: u64,
}

/// How an attempt ends that has no answer to be kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CallEnd {
    /// Nothing was changed: the name is free.
    Refused,
    /// Nobody knows whether something was changed: the name stays, with the id; the next attempt may begin at once.
    Unknown,
}

/// An answer that is given again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptAnswer {
    /// Its status.
    pub status: u16,
    /// Its headers.
    pub headers: Vec<KeptHeader>,
    /// Its body.
    pub body: String,
}

/// Name and value of a header.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeptHeader(pub String, pub String);

/// A named request as it stands in a row.
#[derive(Debug)]
pub(super) struct KeptCall {
    pub(super) target: String,
    pub(super) digest: Digest,
    pub(super) makes: Uuid,
    pub(super) token: u64,
    pub(super) lease_until: Timestamp,
    pub(super) expires_at: Timestamp,
    pub(super) answer: Option<KeptAnswer>,
}

/// What a row says about a request that comes under its name.
#[derive(Debug)]
pub(super) enum Verdict {
    /// The row is over: the request takes its place.
    Anew,
    /// The attempt of the row was lost: another one, for the same id.
    Again(Uuid),
    /// Nothing is written.
    Told(Begun),
}

impl KeptCall {
    pub(super) fn verdict(self, call: &Call, now: Timestamp) -> Verdict {
        let free = self.answer.is_some() || self.lease_until <= now;
        if free && self.expires_at <= now {
            return Verdict::Anew;
        }
        if self.target != call.target || self.digest != call.digest {
            return Verdict::Told(Begun::OtherRequest);
        }
        match self.answer {
            Some(answer) => Verdict::Told(Begun::Answered(answer)),
            None if free => Verdict::Again(self.makes),
            None => Verdict::Told(Begun::UnderWay),
        }
    }
}

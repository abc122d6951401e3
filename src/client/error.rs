//! What can go wrong between a robot and its server.

use std::time::Duration;

use super::SpoolError;
use crate::api::{Problem, ProblemCode};

/// Why a call to the server did not do what it should.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The server's address is none.
    #[error("server is {server:?}; it must be an http:// or https:// URL: {detail}")]
    BadServer {
        /// The address as it was given.
        server: String,
        /// What is wrong with it.
        detail: String,
    },
    /// The key is none. Its text is not repeated: it may be a secret with a typing mistake.
    #[error("the key is not of the form mapweld_ID_SECRET that `mapweld keys create` prints")]
    BadKey,
    /// The certificates to trust are none.
    #[error("there is no PEM certificate among those to trust")]
    BadAuthority,
    /// The server could not be reached, or the connection broke.
    #[error("cannot reach {server}: {detail}")]
    Unreachable {
        /// The server's address.
        server: String,
        /// What broke, from the outside in.
        detail: String,
    },
    /// The server answered with a problem (RFC 9457).
    #[error("the server refused ({} {}): {}", .problem.status, .problem.title, .problem.detail)]
    Refused {
        /// What the server says.
        problem: Box<Problem>,
        /// When it wants to be asked again.
        retry_after: Option<Duration>,
    },
    /// Something between us and the server, or a server that is no mapweld, answered.
    #[error("{server} answered {status}, but not as mapweld does: {detail}")]
    Foreign {
        /// The server's address.
        server: String,
        /// The HTTP status.
        status: u16,
        /// The beginning of the answer, or what is wrong with it.
        detail: String,
        /// When it wants to be asked again.
        retry_after: Option<Duration>,
    },
    /// What arrived is not what the server sent.
    #[error("what {server} sent was damaged on its way: {detail}")]
    Damaged {
        /// The server's address.
        server: String,
        /// Which digest does not fit.
        detail: String,
    },
    /// The call was tried again and again in vain.
    #[error("gave up after {attempts} attempts: {last}")]
    GaveUp {
        /// How often it was tried.
        attempts: u32,
        /// How the last attempt ended.
        last: Box<ClientError>,
    },
    /// The job that was waited for ended without a version.
    #[error("the merge job {job} {ended}")]
    JobEnded {
        /// The job.
        job: crate::model::JobId,
        /// How it ended, and why.
        ended: String,
    },
    /// Maps could not be kept on disk.
    #[error(transparent)]
    Spool(#[from] SpoolError),
}

impl ClientError {
    /// Whether the same call may well succeed later: every call of this client is safe to repeat.
    #[must_use]
    pub fn is_transient(&self) -> bool {
        match self {
            Self::Unreachable { .. } | Self::Damaged { .. } | Self::GaveUp { .. } => true,
            Self::Refused { problem, .. } => {
                // another attempt is being answered; the body was damaged on its way
                let passing = [ProblemCode::IdempotencyKeyInUse, ProblemCode::DigestMismatch];
                passing.contains(&problem.code) || passes_by_itself(problem.status)
            }
            Self::Foreign { status, .. } => passes_by_itself(*status),
            Self::BadServer { .. } | Self::BadKey | Self::BadAuthority | Self::JobEnded { .. } | Self::Spool(_) => {
                false
            }
        }
    }

    /// When the server wants to be asked again, if it said so.
    #[must_use]
    pub fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Refused { retry_after, .. } | Self::Foreign { retry_after, .. } => *retry_after,
            _ => None,
        }
    }
}

/// Request timeout, too early, too many requests, bad gateway, unavailable, gateway timeout. Not 500: a bug of the
/// server answers the same way each time.
fn passes_by_itself(status: u16) -> bool {
    matches!(status, 408 | 425 | 429 | 502 | 503 | 504)
}

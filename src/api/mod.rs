//! What goes over the wire: requests, answers and errors, with their OpenAPI schemas.
//!
//! Imports `geometry`, `grid`, `registration`, `fusion` and `model`. No logic beyond turning records into documents;
//! the server writes these types and the client reads them. JSON in `snake_case`; times are RFC 3339.

mod constraint;
mod job;
mod map;
mod merge;
mod page;
mod pose;
mod problem;
mod session;
mod transforms;
mod verbatim;
mod version;

pub use constraint::{Constraint, ConstraintEffect, NewConstraint, NewFixed, NewGuess, NewMerge, NewRule};
pub use job::Job;
pub use map::{Map, Pushed};
pub use merge::{
    Basis, Bridge, Candidate, Evidence, FrameJump, FusedMap, Group, GroupMember, MapPlacement, MergeResult, PairCheck,
    PairOutcome, PairResult, PairRole, PlacementStatus, Reason, ReasonCode, RunnerUp, Timings, Welded,
};
pub use page::Page;
pub use pose::{CellCounts, Pose};
pub use problem::{FieldError, PROBLEM_JSON, Problem, ProblemCode};
pub use session::{Robot, Session};
pub use transforms::{Rotation, Stamp, Transform, TransformHeader, TransformStamped, Transforms, Vector3};
pub use verbatim::Verbatim;
pub use version::{Version, VersionInput, VersionSummary};

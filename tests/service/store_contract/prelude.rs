//! Words for the clauses: times, names, small maps, and calls that must succeed.

pub(crate) use std::collections::BTreeSet;
pub(crate) use std::sync::Arc;
pub(crate) use std::time::Duration;

pub(crate) use mapweld::model::{
    Apart, BlobKey, Clash, Constraint, ConstraintId, Digest, Fixed, Job, JobError, JobId, JobState, MapId, MapRecord,
    MergeRequest, NewMap, Pose, ResultText, RobotId, Rule, Session, SessionId, SessionPatch, SessionSettings,
    Timestamp, VersionInput, VersionNumber, VersionSelector,
};
pub(crate) use mapweld::store::{
    AddMap, Added, AskedMerge, Change, Claim, Lease, Missing, NewVersion, Page, ProgressReport, QueueScope, Retry,
    StoreError,
};

pub(crate) use super::{AnyStore, LEASE, LIMITS};

use mapweld::clock::{Ids, SystemIds};
use mapweld::geometry::{Angle, Pose2};
use mapweld::grid::{Lattice, LogOdds, OccupancyGrid};

pub(crate) fn at(seconds: i64) -> Timestamp {
    Timestamp::from_second(1_800_000_000 + seconds).expect("a time")
}

pub(crate) fn session(name: &str) -> SessionId {
    SessionId::parse(name).expect("a name")
}

pub(crate) fn robot(name: &str) -> RobotId {
    RobotId::parse(name).expect("a name")
}

pub(crate) fn job_id() -> JobId {
    JobId::new(SystemIds.next())
}

/// A small map that differs with `seed`.
pub(crate) fn a_map(seed: u16) -> NewMap {
    let origin = Pose2::new(-1.5, 0.25, Angle::from_radians(0.1));
    let lattice = Lattice::new(16, 3, 0.05, origin).expect("valid");
    let mut grid = OccupancyGrid::unknown(lattice);
    for (bit, cell) in grid.cells_mut().iter_mut().take(16).enumerate() {
        *cell = if seed >> bit & 1 == 1 {
            LogOdds::OCCUPIED
        } else {
            LogOdds::FREE
        };
    }
    NewMap::of(&grid, BlobKey::of(&seed.to_le_bytes()))
}

pub(crate) fn upload(session: &SessionId, robot_name: &str, seed: u16) -> AddMap {
    AddMap {
        session: session.clone(),
        create_session: Some(SessionSettings::default()),
        robot: robot(robot_name),
        id: MapId::new(SystemIds.next()),
        job: job_id(),
        map: a_map(seed),
        trace: None,
    }
}

pub(crate) async fn push(store: &AnyStore, session: &SessionId, robot: &str, seed: u16, now: Timestamp) -> Added {
    store
        .add_map_and_enqueue(upload(session, robot, seed), now)
        .await
        .expect("is added")
}

pub(crate) async fn quiet_session(store: &AnyStore, name: &str) -> SessionId {
    let settings = SessionSettings {
        auto_merge: false,
        ..SessionSettings::default()
    };
    store
        .create_session(&session(name), &settings, at(0))
        .await
        .expect("is made");
    session(name)
}

pub(crate) async fn enqueue(store: &AnyStore, session: &SessionId, now: Timestamp) -> Job {
    store
        .enqueue_merge(session, job_id(), AskedMerge::default(), now)
        .await
        .expect("is queued")
}

pub(crate) async fn claim(store: &AnyStore, now: Timestamp) -> Claim {
    store
        .claim_job("worker-1", LEASE, now)
        .await
        .expect("the store answers")
        .expect("a job is due")
}

pub(crate) async fn nothing_to_claim(store: &AnyStore, now: Timestamp) {
    assert_eq!(
        store
            .claim_job("worker-1", LEASE, now)
            .await
            .expect("the store answers"),
        None
    );
}

pub(crate) async fn job(store: &AnyStore, id: JobId) -> Job {
    store.get_job(id).await.expect("the job is there")
}

pub(crate) fn new_version(inputs: &[MapRecord]) -> NewVersion {
    NewVersion {
        anchor: robot("r1"),
        inputs: inputs
            .iter()
            .map(|map| VersionInput {
                robot: map.robot.clone(),
                map: map.id,
                digest: map.map.digest,
            })
            .collect(),
        result: ResultText::parse(r#"{"anchor":"r1","x":0.10}"#.to_owned()).expect("JSON"),
        grid: BlobKey::of(b"grid"),
        png: BlobKey::of(b"png"),
        overlay: BlobKey::of(b"overlay"),
        digest: Digest::of_bytes(b"fused"),
        restored_from: None,
        reanchors: false,
        timings: Vec::new(),
    }
}

pub(crate) fn error(code: &str) -> JobError {
    JobError::new(code, "because")
}

pub(crate) fn is_lost<T: std::fmt::Debug>(answer: Result<T, StoreError>, lease: &Lease) {
    match answer {
        Err(StoreError::LeaseLost(job)) => assert_eq!(job, lease.job),
        other => panic!("the lease is lost, but the answer was {other:?}"),
    }
}

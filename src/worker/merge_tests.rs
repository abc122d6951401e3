//! The story of a merge, from pushed maps to a version, with the real pipeline.

use std::num::NonZeroUsize;

use tempfile::TempDir;
use tokio_util::sync::CancellationToken;

use super::*;
use crate::api::{Basis, PairOutcome, Timings};
use crate::clock::{Clock, Ids, SystemClock, SystemIds};
use crate::geometry::{Angle, Pose2};
use crate::grid::{Lattice, LogOdds, OccupancyGrid};
use crate::model::{JobId, JobState, MapId, NewMap, SessionId, SessionSettings, Version, VersionSelector};
use crate::registration::MethodName;
use crate::store::{AddMap, Page, QueueLimits, SqliteStore};
use crate::worker::{Ran, Worker, WorkerSettings};

struct Bench {
    store: Arc<SqliteStore>,
    blobs: Blobs,
    worker: Worker,
    session: SessionId,
    clock: Arc<dyn Clock>,
    folder: TempDir,
}

impl Bench {
    async fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let store = SqliteStore::open(folder.path(), QueueLimits::default())
            .await
            .expect("opens");
        let store = Arc::new(store);
        let blobs = Blobs::open_folder(&folder.path().join("blobs")).expect("opens");
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let worker = worker(&store, &blobs, &clock);
        Self {
            store,
            blobs,
            worker,
            session: SessionId::parse("ward").expect("a name"),
            clock,
            folder,
        }
    }

    async fn push(&self, robot: &str, grid: &OccupancyGrid) -> MapRecord {
        let blob = self.blobs.put(encode_cells(grid).into()).await.expect("is kept");
        let add = AddMap {
            session: self.session.clone(),
            create_session: Some(SessionSettings::default()),
            robot: name(robot),
            id: MapId::new(SystemIds.next()),
            job: JobId::new(SystemIds.next()),
            map: NewMap::of(grid, blob),
            trace: None,
        };
        self.store
            .add_map_and_enqueue(add, self.clock.now())
            .await
            .expect("is added")
            .map
    }

    async fn ask(&self, request: MergeRequest) -> JobId {
        let id = JobId::new(SystemIds.next());
        self.store
            .enqueue_merge(&self.session, id, request.into(), self.clock.now())
            .await
            .expect("is queued")
            .id
    }

    async fn run_all(&self) {
        let stop = CancellationToken::new();
        while self.worker.run_one(&stop).await.expect("the store answers") == Ran::Job {}
    }

    async fn job(&self, id: JobId) -> Job {
        self.store.get_job(id).await.expect("is there")
    }

    /// Asks for a merge that fails for good, and says with which code.
    async fn failing(&self, robots: Option<&[&str]>) -> String {
        let robots = robots.map(|robots| robots.iter().map(|robot| name(robot)).collect());
        let request = MergeRequest {
            robots,
            ..MergeRequest::default()
        };
        let id = self.ask(request).await;
        self.run_all().await;
        let job = self.job(id).await;
        assert_eq!((job.state, job.attempt), (JobState::Failed, 1));
        job.error.expect("a reason").code
    }

    async fn latest(&self) -> Version {
        self.store
            .get_version(&self.session, VersionSelector::Latest)
            .await
            .expect("is there")
    }
}

fn worker(store: &Arc<SqliteStore>, blobs: &Blobs, clock: &Arc<dyn Clock>) -> Worker {
    let two = NonZeroUsize::new(2).expect("not zero");
    let merges = Merges {
        store: Arc::clone(store) as Arc<dyn Store>,
        blobs: blobs.clone(),
        compute: Compute::new(two, two).expect("threads"),
        memory: Memory::new(8),
        cells_max: 1 << 24,
    };
    let store = Arc::clone(store) as Arc<dyn Store>;
    Worker::new(store, Arc::new(merges), Arc::clone(clock), WorkerSettings::new("w1"))
}

fn name(robot: &str) -> RobotId {
    RobotId::parse(robot).expect("a name")
}

const RESOLUTION: f64 = 0.05;

/// Columns `from..to` of a floor of 20 m x 13 m, in the frame of a robot that holds their lower-left corner for `origin`.
fn part_of_floor(from: u32, to: u32, origin: Pose2) -> OccupancyGrid {
    // walls from corner to corner, in cells
    const WALLS: [[u32; 4]; 15] = [
        [10, 10, 390, 14],
        [10, 246, 390, 250],
        [10, 10, 14, 250],
        [386, 10, 390, 250],
        [10, 100, 60, 104],
        [84, 100, 190, 104],
        [214, 100, 330, 104],
        [10, 150, 120, 154],
        [144, 150, 300, 154],
        [324, 150, 390, 154],
        [96, 10, 100, 104],
        [230, 10, 234, 80],
        [170, 150, 174, 250],
        [280, 170, 284, 250],
        [320, 40, 326, 64],
    ];
    let lattice = Lattice::new(to - from, 260, RESOLUTION, origin).expect("valid");
    let mut grid = OccupancyGrid::unknown(lattice);
    for row in 0..260 {
        for column in from..to {
            let wall = WALLS
                .iter()
                .any(|&[x, y, right, top]| (x..right).contains(&column) && (y..top).contains(&row));
            let inside = (10..390).contains(&column) && (10..250).contains(&row);
            let cell = match (wall, inside) {
                (true, _) => LogOdds::OCCUPIED,
                (false, true) => LogOdds::FREE,
                (false, false) => LogOdds::UNKNOWN,
            };
            grid.cells_mut()[lattice.index(column - from, row)] = cell;
        }
    }
    grid
}

/// The left and the right part of the floor, and the pose of the right map's frame in the left one's.
fn two_maps() -> (OccupancyGrid, OccupancyGrid, Pose2) {
    let left = Pose2::new(-1.0, -2.0, Angle::ZERO);
    let right = Pose2::new(3.0, 1.0, Angle::from_degrees(-65.0));
    let corner_of_right = left * Pose2::new(100.0 * RESOLUTION, 0.0, Angle::ZERO);
    let truth = corner_of_right * right.inverse();
    (part_of_floor(0, 290, left), part_of_floor(100, 400, right), truth)
}

fn without_timings(version: &Version) -> MergeResult {
    let mut result: MergeResult = serde_json::from_str(version.result.as_str()).expect("a merge result");
    result.timings = Timings {
        total_seconds: 0.0,
        stages: Vec::new(),
    };
    result
}

#[tokio::test(flavor = "multi_thread")]
async fn two_pushed_maps_become_a_version_with_both_in_their_places() {
    let bench = Bench::new().await;
    let (left, right, truth) = two_maps();
    // the anchor is the first to push, not the first by name
    let anchor = bench.push("r2", &left).await;
    let other = bench.push("r1", &right).await;
    bench.run_all().await;

    let job = bench.job(other.job.expect("a job")).await;
    assert_eq!(job.state, JobState::Succeeded, "{:?}", job.error);
    let stages: Vec<&str> = job.timings.iter().map(|stage| stage.stage.as_str()).collect();
    assert_eq!((stages.first(), stages.last()), (Some(&"load"), Some(&"keep")));

    let version = bench.latest().await;
    assert_eq!(version.anchor, name("r2"));
    let inputs: Vec<_> = version
        .inputs
        .iter()
        .map(|input| (input.robot.as_str(), input.map))
        .collect();
    assert_eq!(inputs, [("r1", other.id), ("r2", anchor.id)]);
    let result = without_timings(&version);
    assert_eq!((result.placed(), result.anchor.as_str()), (2, "r2"));
    let pose = pose_of(&result, "r1");
    let error = truth.inverse() * pose;
    assert!(
        error.x().hypot(error.y()) < 0.1 && error.yaw().magnitude() < 0.01,
        "{error:?}"
    );

    let cells = bench.blobs.get(version.grid).await.expect("is kept");
    let fused = decode_cells(&cells).expect("reads back");
    assert_eq!(Digest::of_grid(&fused), version.digest);
    assert_eq!(bench.blobs.get(version.png).await.expect("is kept"), encode_png(&fused));
    assert!(
        bench
            .blobs
            .get(version.overlay)
            .await
            .expect("is kept")
            .starts_with(b"\x89PNG")
    );
}

fn pose_of(result: &MergeResult, name: &str) -> Pose2 {
    let map = result.maps.iter().find(|map| map.name == name).expect("told");
    let pose = map.pose.expect("placed");
    Pose2::new(pose.x, pose.y, Angle::from_radians(pose.yaw))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_remembered_merge_and_a_fresh_one_give_the_same_document_and_content() {
    let bench = Bench::new().await;
    let (left, right, _) = two_maps();
    bench.push("r1", &left).await;
    bench.push("r2", &right).await;
    bench.run_all().await;
    let first = bench.latest().await;
    for worker in [bench.worker.clone(), worker(&bench.store, &bench.blobs, &bench.clock)] {
        bench.ask(MergeRequest::default()).await;
        let ran = worker
            .run_one(&CancellationToken::new())
            .await
            .expect("the store answers");
        assert_eq!(ran, Ran::Job);
        let again = bench.latest().await;
        assert!(again.number > first.number);
        assert_eq!(without_timings(&again), without_timings(&first));
        assert_eq!(
            (again.grid, again.png, again.overlay),
            (first.grid, first.png, first.overlay)
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn no_method_publishes_a_robot_below_its_threshold_unless_it_is_asked_to() {
    let bench = Bench::new().await;
    // frames that nearly coincide: `hough-peaks` looks no farther
    let left = part_of_floor(0, 290, Pose2::new(-1.0, -2.0, Angle::ZERO));
    let mut right = part_of_floor(100, 400, Pose2::new(4.1, -1.9, Angle::from_degrees(3.0)));
    // the second part begins 100 cells of 0.05 m along the floor
    let of_floor = |x| Pose2::new(x, 0.0, Angle::ZERO);
    let truth =
        Pose2::new(-1.0, -2.0, Angle::ZERO) * of_floor(5.0) * Pose2::new(4.1, -1.9, Angle::from_degrees(3.0)).inverse();
    // a box that only one robot met: no pose makes all cells agree
    for row in 175..185 {
        for column in 30..40 {
            let index = right.lattice().index(column, row);
            right.cells_mut()[index] = LogOdds::OCCUPIED;
        }
    }
    bench.push("r1", &left).await;
    bench.push("r2", &right).await;
    bench.run_all().await;
    let (mut deciding_by_it, mut placed_when_asked) = (0, 0);
    for name in MethodName::ALL {
        let mut published = Vec::new();
        for accept_unverified in [false, true] {
            let parameters = serde_json::json!({"verification_threshold": 1.0, "accept_unverified": accept_unverified});
            let Ok(method) = MethodSpec::new(name, Some(parameters)) else {
                continue; // the default method has no such threshold
            };
            assert_eq!(
                method.build().required_verification().is_none(),
                accept_unverified,
                "{name}"
            );
            bench
                .ask(MergeRequest {
                    method: Some(method),
                    ..MergeRequest::default()
                })
                .await;
            bench.run_all().await;
            let result = without_timings(&bench.latest().await);
            assert_eq!(result.method.name(), name);
            published.push((result.pairs[0].clone(), result.placed()));
        }
        let [withheld, asked_for] = &published[..] else {
            continue;
        };
        deciding_by_it += 1;
        assert_eq!((withheld.0.outcome, withheld.1), (PairOutcome::Rejected, 1), "{name}");
        assert_eq!(asked_for.0.outcome, PairOutcome::Accepted, "{name}");
        // The weld still refuses what walls in free space speak against: methods that are asked for an answer at any price
        // lay this pair wrongly.
        let off = (asked_for.0.pose.and_then(crate::api::Pose::to_pose2)).map(|pose| {
            let between = truth.inverse() * pose;
            between.x().hypot(between.y())
        });
        let right = off.expect("accepted with a pose") < 0.5;
        assert_eq!(asked_for.1, if right { 2 } else { 1 }, "{name}: {off:?} m off");
        placed_when_asked += usize::from(right);
    }
    assert!(placed_when_asked > 0, "no method shows that asking makes a difference");
    assert_eq!(deciding_by_it, MethodName::ALL.len() - 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_merge_of_newer_maps_looks_first_where_the_version_before_placed_them() {
    let bench = Bench::new().await;
    let (left, right, truth) = two_maps();
    bench.push("r1", &left).await;
    bench.push("r2", &right).await;
    bench.run_all().await;
    let basis = |result: &MergeResult, name: &str| {
        let map = result.maps.iter().find(|map| map.name == name).expect("told");
        map.basis
    };
    assert_eq!(
        basis(&without_timings(&bench.latest().await), "r2"),
        Some(Basis::Registered)
    );

    let mut grown = right.clone();
    grown.cells_mut()[0] = LogOdds::FREE;
    bench.push("r2", &grown).await;
    bench.run_all().await;
    let result = without_timings(&bench.latest().await);
    assert_eq!(basis(&result, "r2"), Some(Basis::KnownPose));
    let error = truth.inverse() * pose_of(&result, "r2");
    assert!(
        error.x().hypot(error.y()) < 0.1 && error.yaw().magnitude() < 0.01,
        "{error:?}"
    );

    // another anchor: told in its frame
    let request = MergeRequest {
        anchor: Some(name("r2")),
        ..MergeRequest::default()
    };
    bench.push("r1", &grown_left(&left)).await;
    bench.run_all().await;
    bench.ask(request).await;
    bench.run_all().await;
    let error = truth * pose_of(&without_timings(&bench.latest().await), "r1");
    assert!(
        error.x().hypot(error.y()) < 0.1 && error.yaw().magnitude() < 0.01,
        "{error:?}"
    );

    // the very maps of the version before: looked for everywhere again
    bench.ask(MergeRequest::default()).await;
    bench.run_all().await;
    assert_eq!(
        basis(&without_timings(&bench.latest().await), "r1"),
        Some(Basis::Registered)
    );
}

fn grown_left(left: &OccupancyGrid) -> OccupancyGrid {
    let mut grown = left.clone();
    grown.cells_mut()[1] = LogOdds::FREE;
    grown
}

#[tokio::test(flavor = "multi_thread")]
async fn one_robot_alone_makes_a_version_of_its_map() {
    let bench = Bench::new().await;
    let (left, ..) = two_maps();
    bench.push("r1", &left).await;
    bench.run_all().await;
    assert_eq!(without_timings(&bench.latest().await).placed(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dry_run_answers_and_publishes_nothing() {
    let bench = Bench::new().await;
    let (left, ..) = two_maps();
    bench.push("r1", &left).await;
    bench.run_all().await;
    let request = MergeRequest {
        dry_run: true,
        ..MergeRequest::default()
    };
    let id = bench.ask(request).await;
    bench.run_all().await;
    let job = bench.job(id).await;
    assert_eq!((job.state, job.version), (JobState::Succeeded, None));
    assert!(job.result.expect("a result").as_str().contains("\"r1\""));
    let versions = bench
        .store
        .list_versions(&bench.session, &Page::first(9))
        .await
        .expect("a list");
    assert_eq!(versions.len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn merges_that_cannot_be_done_fail_at_once_and_say_why() {
    let bench = Bench::new().await;
    let settings = SessionSettings {
        auto_merge: false,
        ..SessionSettings::default()
    };
    bench
        .store
        .create_session(&bench.session, &settings, bench.clock.now())
        .await
        .expect("is made");
    assert_eq!(bench.failing(None).await, "no_maps");
    let (left, ..) = two_maps();
    let map = bench.push("r1", &left).await;
    assert_eq!(bench.failing(Some(&["r1", "r9"])).await, "robot_has_no_map");
    assert_eq!(bench.failing(Some(&[])).await, "anchor_left_out");
    let patch = serde_json::from_str(r#"{"anchor":"r7"}"#).expect("a patch");
    bench
        .store
        .patch_session(&bench.session, patch, bench.clock.now())
        .await
        .expect("is patched");
    assert_eq!(bench.failing(None).await, "anchor_has_no_map");
    let patch = serde_json::from_str(r#"{"anchor":"r1"}"#).expect("a patch");
    bench
        .store
        .patch_session(&bench.session, patch, bench.clock.now())
        .await
        .expect("is patched");
    let file = bench.folder.path().join("blobs").join(map.map.blob.to_string());
    std::fs::write(file, b"other bytes").expect("is changed");
    assert_eq!(bench.failing(None).await, "store_damaged");
}

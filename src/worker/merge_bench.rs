//! A worker with its store, and maps of one floor: what the tests of a merge stand on.

use std::num::NonZeroUsize;
use std::sync::Arc;

use tempfile::TempDir;
use tokio_util::sync::CancellationToken;

use super::Merges;
use crate::clock::{Clock, Ids, SystemClock, SystemIds};
use crate::codec::encode_cells;
use crate::compute::Compute;
use crate::geometry::{Angle, Pose2};
use crate::grid::{Lattice, LogOdds, OccupancyGrid};
use crate::model::{
    Job, JobId, JobState, MapId, MapRecord, MergeRequest, NewMap, RobotId, SessionId, SessionSettings, Version,
    VersionSelector,
};
use crate::store::{AddMap, Blobs, QueueLimits, SqliteStore, Store};
use crate::worker::{Memory, Ran, Worker, WorkerSettings};

pub(super) struct Bench {
    pub(super) store: Arc<SqliteStore>,
    pub(super) blobs: Blobs,
    pub(super) worker: Worker,
    pub(super) session: SessionId,
    pub(super) clock: Arc<dyn Clock>,
    pub(super) folder: TempDir,
}

impl Bench {
    pub(super) async fn new() -> Self {
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

    pub(super) async fn push(&self, robot: &str, grid: &OccupancyGrid) -> MapRecord {
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

    pub(super) async fn ask(&self, request: MergeRequest) -> JobId {
        let id = JobId::new(SystemIds.next());
        self.store
            .enqueue_merge(&self.session, id, request.into(), self.clock.now())
            .await
            .expect("is queued")
            .id
    }

    pub(super) async fn run_all(&self) {
        let stop = CancellationToken::new();
        while self.worker.run_one(&stop).await.expect("the store answers") == Ran::Job {}
    }

    pub(super) async fn job(&self, id: JobId) -> Job {
        self.store.get_job(id).await.expect("is there")
    }

    /// Asks for a merge that fails for good, and says with which code.
    pub(super) async fn failing(&self, robots: Option<&[&str]>) -> String {
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

    pub(super) async fn latest(&self) -> Version {
        self.store
            .get_version(&self.session, VersionSelector::Latest)
            .await
            .expect("is there")
    }
}

pub(super) fn worker(store: &Arc<SqliteStore>, blobs: &Blobs, clock: &Arc<dyn Clock>) -> Worker {
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

pub(super) fn name(robot: &str) -> RobotId {
    RobotId::parse(robot).expect("a name")
}

pub(super) const RESOLUTION: f64 = 0.05;

/// Columns `from..to` of a floor of 20 m x 13 m, in the frame of a robot that holds their lower-left corner for `origin`.
pub(super) fn part_of_floor(from: u32, to: u32, origin: Pose2) -> OccupancyGrid {
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
pub(super) fn two_maps() -> (OccupancyGrid, OccupancyGrid, Pose2) {
    let left = Pose2::new(-1.0, -2.0, Angle::ZERO);
    let right = Pose2::new(3.0, 1.0, Angle::from_degrees(-65.0));
    let corner_of_right = left * Pose2::new(100.0 * RESOLUTION, 0.0, Angle::ZERO);
    let truth = corner_of_right * right.inverse();
    (part_of_floor(0, 290, left), part_of_floor(100, 400, right), truth)
}

//! The life of a job in the hands of a worker, with scripted work.

use std::sync::atomic::{AtomicUsize, Ordering};

use async_trait::async_trait;
use tempfile::TempDir;

use super::*;
use crate::clock::{Ids, ManualClock, SystemIds};
use crate::model::{
    BlobKey, Digest, JobId, MergeRequest, ResultText, RobotId, SessionId, SessionSettings, Timestamp, VersionSelector,
};
use crate::registration::Control;
use crate::store::{NewVersion, QueueLimits, SqliteStore};

/// What the scripted work does.
#[derive(Debug, Clone, Copy)]
enum Script {
    Publish,
    Panic,
    FailForNow,
    FailForGood,
    WorkUntilStopped,
    NeverStop,
}

struct Scripted {
    script: Script,
    begun: AtomicUsize,
}

#[async_trait]
impl Work for Scripted {
    async fn run(&self, _: &Job, control: &RunControl, progress: &Progress) -> Result<Done, Failure> {
        progress.stage("scripted", 0.5);
        self.begun.fetch_add(1, Ordering::SeqCst);
        match self.script {
            Script::Publish => Ok(Done::Version(Box::new(version()))),
            Script::Panic => panic!("row 7 is no row"),
            Script::NeverStop => std::future::pending().await,
            Script::FailForNow => Err(Failure::ForNow(JobError::new("busy", "try again"))),
            Script::FailForGood => Err(Failure::for_good("bad", "never")),
            Script::WorkUntilStopped => loop {
                if let Some(stop) = control.should_stop() {
                    return Err(Failure::Stopped(stop));
                }
                tokio::time::sleep(Duration::from_millis(1)).await;
            },
        }
    }
}

fn version() -> NewVersion {
    NewVersion {
        anchor: RobotId::parse("r1").expect("a name"),
        inputs: Vec::new(),
        result: ResultText::parse("{}".to_owned()).expect("JSON"),
        grid: BlobKey::of(b"grid"),
        png: BlobKey::of(b"png"),
        overlay: BlobKey::of(b"overlay"),
        digest: Digest::of_bytes(b"fused"),
        restored_from: None,
        reanchors: false,
        timings: Vec::new(),
    }
}

struct Bench {
    store: Arc<SqliteStore>,
    clock: Arc<ManualClock>,
    work: Arc<Scripted>,
    worker: Worker,
    stop: CancellationToken,
    session: SessionId,
    _folder: TempDir,
}

const LEASE: Duration = Duration::from_secs(30);

impl Bench {
    async fn new(script: Script) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let store = SqliteStore::open(folder.path(), QueueLimits::default())
            .await
            .expect("opens");
        let store = Arc::new(store);
        let clock = Arc::new(ManualClock::new(Timestamp::UNIX_EPOCH));
        let work = Arc::new(Scripted {
            script,
            begun: AtomicUsize::new(0),
        });
        let settings = WorkerSettings {
            lease: LEASE,
            deadline: Duration::from_secs(100),
            // so that a test that needs it never ends in time
            poll: Duration::from_hours(1),
            ..WorkerSettings::new("w1")
        };
        let session = SessionId::parse("ward").expect("a name");
        let made = store
            .create_session(&session, &SessionSettings::default(), clock.now())
            .await;
        made.expect("is made");
        Self {
            worker: Worker::new(
                Arc::clone(&store) as Arc<dyn Store>,
                Arc::clone(&work) as Arc<dyn Work>,
                Arc::clone(&clock) as Arc<dyn Clock>,
                settings,
            ),
            store,
            clock,
            work,
            stop: CancellationToken::new(),
            session,
            _folder: folder,
        }
    }

    async fn enqueue(&self) -> JobId {
        let id = JobId::new(SystemIds.next());
        let request = MergeRequest::default();
        self.store
            .enqueue_merge(&self.session, id, request.into(), self.clock.now())
            .await
            .expect("is queued")
            .id
    }

    async fn job(&self, id: JobId) -> Job {
        self.store.get_job(id).await.expect("is there")
    }

    async fn run_one(&self) -> Ran {
        self.worker.run_one(&self.stop).await.expect("the store answers")
    }

    /// Runs one job, and `meanwhile` once the job is being done.
    async fn run_one_and(&self, meanwhile: impl Future<Output = ()>) {
        let begun = async {
            until(async || self.work.begun.load(Ordering::SeqCst) > 0).await;
            meanwhile.await;
        };
        let both = async { tokio::join!(self.run_one(), begun) };
        tokio::time::timeout(Duration::from_mins(1), both).await.expect("ends");
    }
}

/// Looks again and again until it is so.
async fn until(so: impl AsyncFn() -> bool) {
    let looked = async {
        while !so().await {
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    };
    tokio::time::timeout(Duration::from_mins(1), looked)
        .await
        .expect("comes true");
}

#[tokio::test]
async fn a_job_is_done_and_its_version_published() {
    let bench = Bench::new(Script::Publish).await;
    assert_eq!(bench.run_one().await, Ran::Empty);
    let id = bench.enqueue().await;
    assert_eq!(bench.run_one().await, Ran::Job);
    let job = bench.job(id).await;
    assert_eq!((job.state, job.version.map(u32::from)), (JobState::Succeeded, Some(1)));
}

#[tokio::test]
async fn a_panic_fails_its_attempt_and_nothing_else() {
    let bench = Bench::new(Script::Panic).await;
    let id = bench.enqueue().await;
    for _ in 0..3 {
        assert_eq!(bench.run_one().await, Ran::Job);
        bench.clock.advance(Duration::from_mins(1));
    }
    let job = bench.job(id).await;
    assert_eq!(job.state, JobState::Failed);
    let error = job.error.expect("a reason");
    assert_eq!(error.code, "panicked");
    assert!(error.message.contains("row 7 is no row"), "{}", error.message);
    assert_eq!(bench.run_one().await, Ran::Empty);
}

#[tokio::test]
async fn the_pause_before_another_attempt_doubles() {
    let bench = Bench::new(Script::FailForNow).await;
    let id = bench.enqueue().await;
    for pause in [1, 2] {
        bench.run_one().await;
        let job = bench.job(id).await;
        assert_eq!(
            (job.state, job.run_after),
            (JobState::Queued, bench.clock.now() + Duration::from_secs(pause))
        );
        assert_eq!(bench.run_one().await, Ran::Empty);
        bench.clock.advance(Duration::from_secs(pause));
    }
}

#[tokio::test]
async fn a_failure_for_good_is_not_tried_again() {
    let bench = Bench::new(Script::FailForGood).await;
    let id = bench.enqueue().await;
    bench.run_one().await;
    let job = bench.job(id).await;
    assert_eq!(
        (job.state, job.error),
        (JobState::Failed, Some(JobError::new("bad", "never")))
    );
}

#[tokio::test]
async fn a_cancelled_job_ends_at_once_though_its_next_renewal_is_far() {
    let bench = Bench::new(Script::WorkUntilStopped).await;
    let id = bench.enqueue().await;
    bench
        .run_one_and(async {
            bench.store.cancel_job(id, bench.clock.now()).await.expect("is asked");
        })
        .await;
    assert_eq!(bench.job(id).await.state, JobState::Cancelled);
}

#[tokio::test]
async fn a_worker_that_stops_gives_its_job_back_uncounted() {
    let bench = Bench::new(Script::WorkUntilStopped).await;
    let id = bench.enqueue().await;
    bench.run_one_and(async { bench.stop.cancel() }).await;
    let job = bench.job(id).await;
    assert_eq!((job.state, job.attempt), (JobState::Queued, 0));
}

#[tokio::test]
async fn a_job_past_its_deadline_fails_and_says_so() {
    let bench = Bench::new(Script::WorkUntilStopped).await;
    let id = bench.enqueue().await;
    bench
        .run_one_and(async { bench.clock.advance(Duration::from_secs(101)) })
        .await;
    let job = bench.job(id).await;
    assert_eq!(job.state, JobState::Failed);
    assert_eq!(job.error, Some(JobError::new("deadline", "not done within 100 s")));
}

#[tokio::test]
async fn a_worker_whose_job_was_taken_over_drops_its_work_and_writes_nothing() {
    let bench = Bench::new(Script::WorkUntilStopped).await;
    let id = bench.enqueue().await;
    bench
        .run_one_and(async {
            bench.clock.advance(LEASE);
            let taken = bench
                .store
                .claim_job("w2", LEASE, bench.clock.now())
                .await
                .expect("answers");
            let taken = taken.expect("the lease has expired");
            bench
                .store
                .publish_version(&taken.lease, version(), bench.clock.now())
                .await
                .expect("is published");
        })
        .await;
    let job = bench.job(id).await;
    assert_eq!((job.state, job.version.map(u32::from)), (JobState::Succeeded, Some(1)));
    let latest = bench
        .store
        .get_version(&bench.session, VersionSelector::Latest)
        .await
        .expect("is there");
    assert_eq!(latest.number.get(), 1);
}

#[tokio::test]
async fn a_session_that_is_deleted_meanwhile_ends_the_work() {
    let bench = Bench::new(Script::WorkUntilStopped).await;
    bench.enqueue().await;
    bench
        .run_one_and(async { bench.store.delete_session(&bench.session).await.expect("is deleted") })
        .await;
    assert_eq!(bench.run_one().await, Ran::Empty);
}

#[tokio::test]
async fn stage_and_progress_are_told_while_the_job_runs() {
    let bench = Bench::new(Script::WorkUntilStopped).await;
    let id = bench.enqueue().await;
    bench
        .run_one_and(async {
            until(async || bench.job(id).await.stage.as_deref() == Some("scripted")).await;
            assert!((bench.job(id).await.progress - 0.5).abs() < 1e-9);
            bench.stop.cancel();
        })
        .await;
}

#[tokio::test]
async fn an_idle_worker_wakes_at_once_and_stops_when_told() {
    let bench = Bench::new(Script::Publish).await;
    let running = bench.worker.run(bench.stop.clone());
    let story = async {
        for _ in 0..3 {
            let id = bench.enqueue().await;
            until(async || bench.job(id).await.state == JobState::Succeeded).await;
        }
        bench.stop.cancel();
    };
    let both = async { tokio::join!(running, story) };
    tokio::time::timeout(Duration::from_mins(1), both).await.expect("stops");
}

#[tokio::test]
async fn an_endless_job_that_does_not_hear_is_left_to_itself_and_the_next_one_runs() {
    let mut bench = Bench::new(Script::NeverStop).await;
    bench.worker.settings.deadline = Duration::from_millis(20);
    bench.worker.settings.stop_within = Duration::from_millis(20);
    let endless = bench.enqueue().await;
    assert_eq!(bench.run_one().await, Ran::Job);
    let job = bench.job(endless).await;
    assert_eq!(job.state, JobState::Failed);
    assert_eq!(job.error.map(|error| error.code).as_deref(), Some("deadline"));

    bench.worker.settings.deadline = Duration::from_secs(100);
    let next = bench.enqueue().await;
    let cancel = async {
        until(async || bench.work.begun.load(Ordering::SeqCst) == 2).await;
        let asked = bench.store.cancel_job(next, bench.clock.now()).await;
        asked.expect("is asked");
    };
    let (ran, ()) = tokio::join!(bench.run_one(), cancel);
    assert_eq!(ran, Ran::Job, "its session is free, and its lane");
    assert_eq!(bench.job(next).await.state, JobState::Cancelled);
}

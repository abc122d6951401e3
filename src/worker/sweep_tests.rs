use bytes::Bytes;
use tempfile::TempDir;

use super::*;
use crate::clock::{Ids, SystemClock, SystemIds};
use crate::grid::{Lattice, OccupancyGrid};
use crate::model::{JobId, MapId, NewMap, RobotId, SessionId, SessionSettings};
use crate::store::{AddMap, QueueLimits, SqliteStore, keep_blob};

struct House {
    sweeper: Sweeper,
    _folder: TempDir,
}

impl House {
    async fn new(grace: Duration) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let limits = QueueLimits {
            per_session: 1000,
            ..QueueLimits::default()
        };
        let store = SqliteStore::open(folder.path(), limits).await.expect("opens");
        let sweeper = Sweeper {
            store: Arc::new(store),
            blobs: Blobs::open_folder(&folder.path().join("blobs")).expect("opens"),
            clock: Arc::new(SystemClock::new()),
            keep_versions: None,
            keep_jobs: None,
            grace,
        };
        Self {
            sweeper,
            _folder: folder,
        }
    }

    async fn keep(&self, bytes: &'static str) -> BlobKey {
        let Sweeper {
            store, blobs, clock, ..
        } = &self.sweeper;
        let bytes = Bytes::from_static(bytes.as_bytes());
        keep_blob(&**store, blobs, bytes, clock.now()).await.expect("is kept")
    }

    async fn name(&self, session: &SessionId, blob: BlobKey) -> Result<(), StoreError> {
        let lattice = Lattice::new(2, 2, 0.05, crate::geometry::Pose2::IDENTITY).expect("valid");
        let add = AddMap {
            session: session.clone(),
            create_session: Some(SessionSettings::default()),
            robot: RobotId::parse("r1").expect("a name"),
            id: MapId::new(SystemIds.next()),
            job: JobId::new(SystemIds.next()),
            map: NewMap::of(&OccupancyGrid::unknown(lattice), blob),
            trace: None,
        };
        let added = self
            .sweeper
            .store
            .add_map_and_enqueue(add, self.sweeper.clock.now())
            .await;
        added.map(|_| ())
    }

    async fn is_kept(&self, blob: BlobKey) -> bool {
        self.sweeper.blobs.get(blob).await.is_ok()
    }
}

fn session(name: &str) -> SessionId {
    SessionId::parse(name).expect("a name")
}

#[tokio::test]
async fn bytes_go_when_no_record_names_them_and_their_grace_is_over() {
    let house = House::new(Duration::ZERO).await;
    let (named, unnamed) = (house.keep("named").await, house.keep("unnamed").await);
    house.name(&session("ward"), named).await.expect("is added");
    let patient = Sweeper {
        grace: Duration::from_hours(1),
        ..house.sweeper.clone()
    };
    assert_eq!(patient.sweep().await.expect("is swept"), Swept::default());
    let swept = house.sweeper.sweep().await.expect("is swept");
    assert_eq!((swept.blobs, swept.bytes), (1, 7));
    assert!(house.is_kept(named).await && !house.is_kept(unnamed).await);

    house
        .sweeper
        .store
        .delete_session(&session("ward"))
        .await
        .expect("is deleted");
    assert_eq!(house.sweeper.sweep().await.expect("is swept").blobs, 1);
    assert!(!house.is_kept(named).await, "a session's bytes go with it");
    assert_eq!(house.sweeper.sweep().await.expect("is swept"), Swept::default());
}

#[tokio::test]
async fn bytes_that_are_removed_between_their_upload_and_its_record_must_be_kept_again() {
    let house = House::new(Duration::ZERO).await;
    let blob = house.keep("cells").await;
    // the remover comes in between
    assert_eq!(house.sweeper.remove(&[blob]).await.expect("is removed"), [blob]);
    let refused = house.name(&session("ward"), blob).await;
    assert!(matches!(refused, Err(StoreError::BlobRemoved(refused)) if refused == blob));
    assert_eq!(house.keep("cells").await, blob);
    house.name(&session("ward"), blob).await.expect("is added");
    assert_eq!(
        house.sweeper.remove(&[blob]).await.expect("answers"),
        [],
        "a record names it"
    );
    assert!(house.is_kept(blob).await);
}

#[tokio::test]
async fn bytes_that_are_being_removed_cannot_be_kept_until_they_are_gone_or_their_remover_is_overdue() {
    let house = House::new(Duration::ZERO).await;
    let blob = house.keep("cells").await;
    let Sweeper { store, clock, .. } = &house.sweeper;
    let now = clock.now();
    assert_eq!(store.mark_unneeded(&[blob], now).await.expect("answers"), [blob]);
    let keep = async |now| keep_blob(&**store, &house.sweeper.blobs, Bytes::from_static(b"cells"), now).await;
    assert!(matches!(keep(now).await, Err(StoreError::BlobBusy(busy)) if busy == blob));
    assert!(
        house.name(&session("ward"), blob).await.is_err(),
        "nor can a record name them"
    );
    keep(now + MARK_HOLD).await.expect("the remover is overdue");
    house.name(&session("ward"), blob).await.expect("is added");
}

/// Many uploads of few contents, a removal of whatever no record names at that moment beside every second one, and
/// sessions that are deleted: each record that was acknowledged has its bytes.
#[tokio::test(flavor = "multi_thread", worker_threads = 4)]
async fn no_record_loses_its_bytes_to_a_sweeper_however_their_steps_interleave() {
    const CONTENTS: [&str; 3] = ["a", "b", "c"];
    const ROUNDS: usize = 24;
    let house = Arc::new(House::new(Duration::ZERO).await);
    // a sweeper without rest would let no upload through: each removal is set off by one
    let wanted = Arc::new(tokio::sync::Semaphore::new(0));
    let sweeping = {
        let (house, wanted) = (Arc::clone(&house), Arc::clone(&wanted));
        let keys = CONTENTS.map(|content| BlobKey::of(content.as_bytes()));
        tokio::spawn(async move {
            let mut removed = 0;
            while let Ok(permit) = wanted.acquire().await {
                permit.forget();
                removed += house.sweeper.remove(&keys).await.expect("answers").len();
            }
            removed
        })
    };
    let mut uploads = tokio::task::JoinSet::new();
    for (uploader, content) in CONTENTS.into_iter().cycle().take(6).enumerate() {
        let (house, wanted) = (Arc::clone(&house), Arc::clone(&wanted));
        uploads.spawn(async move {
            let Sweeper {
                store, blobs, clock, ..
            } = &house.sweeper;
            let (mut refused, mut acknowledged) = (0, 0);
            for round in 0..ROUNDS {
                let id = session(&format!("s{uploader}-{round}"));
                // now before the bytes are kept, now between them and their record
                if round % 4 == 1 {
                    wanted.add_permits(1);
                }
                let bytes = Bytes::from_static(content.as_bytes());
                let kept = keep_blob(&**store, blobs, bytes, clock.now()).await;
                if round % 4 == 3 {
                    wanted.add_permits(1);
                    tokio::task::yield_now().await;
                }
                let named = match kept {
                    Ok(blob) => house.name(&id, blob).await,
                    Err(error) => Err(error),
                };
                match named {
                    Ok(()) => {
                        acknowledged += 1;
                        let blob = BlobKey::of(content.as_bytes());
                        assert!(house.is_kept(blob).await, "an acknowledged record has its bytes");
                        store.delete_session(&id).await.expect("is deleted");
                    }
                    Err(StoreError::BlobBusy(_) | StoreError::BlobRemoved(_)) => refused += 1,
                    Err(error) => panic!("{error}"),
                }
            }
            (refused, acknowledged)
        });
    }
    let counts = uploads.join_all().await;
    wanted.close();
    let removed = sweeping.await.expect("no panic");
    let acknowledged: usize = counts.iter().map(|(_, acknowledged)| acknowledged).sum();
    assert!(
        removed > 0 && acknowledged > 0,
        "they never met: {removed} removed, {counts:?}"
    );
}

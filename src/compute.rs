//! Where everything that takes time is computed: a bounded number of blocking threads, one rayon pool for all, and the
//! wish to stop.
//!
//! Imports `registration` and `clock`.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::clock::Clock;
use crate::registration::{Control, Stop};

#[cfg(feature = "server")]
pub use pool::{Compute, ComputeError};

/// The control of one computation: a deadline and a flag that anybody may raise. Clones share the flag.
#[derive(Clone)]
pub struct RunControl {
    clock: Arc<dyn Clock>,
    deadline: Option<Duration>,
    cancelled: Arc<AtomicBool>,
}

impl RunControl {
    /// A computation that may take `allowed` from now on; any time, if none is said.
    #[must_use]
    pub fn start(clock: Arc<dyn Clock>, allowed: Option<Duration>) -> Self {
        let deadline = allowed.and_then(|allowed| clock.monotonic().checked_add(allowed));
        Self {
            clock,
            deadline,
            cancelled: Arc::default(),
        }
    }

    /// Asks the computation to end.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// What time it is, for records.
    #[must_use]
    pub fn wall_clock(&self) -> jiff::Timestamp {
        self.clock.now()
    }

    /// Asks the computation to end when the answer is dropped: when nobody waits for it any more.
    #[must_use]
    pub fn cancel_on_drop(&self) -> CancelOnDrop {
        CancelOnDrop(self.clone())
    }
}

/// See [`RunControl::cancel_on_drop`].
pub struct CancelOnDrop(RunControl);

impl Drop for CancelOnDrop {
    fn drop(&mut self) {
        self.0.cancel();
    }
}

impl Control for RunControl {
    fn now(&self) -> Duration {
        self.clock.monotonic()
    }

    fn should_stop(&self) -> Option<Stop> {
        if self.cancelled.load(Ordering::Relaxed) {
            return Some(Stop::Cancelled);
        }
        (self.deadline? <= self.clock.monotonic()).then_some(Stop::Deadline)
    }
}

#[cfg(feature = "server")]
mod pool {
    use std::any::Any;
    use std::num::NonZeroUsize;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::Arc;

    use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
    use tokio::sync::Semaphore;
    use tokio::task::spawn_blocking;

    /// Runs computations away from the threads that serve requests: at most so many at a time, each on a blocking thread
    /// that enters the one rayon pool. Clones share both.
    #[derive(Clone)]
    pub struct Compute {
        pool: Arc<ThreadPool>,
        places: Arc<Semaphore>,
    }

    /// A computation that came to no end of its own.
    #[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
    #[error("the computation panicked: {0}")]
    pub struct ComputeError(pub String);

    impl Compute {
        /// A pool of `threads` threads, which `at_once` computations share.
        ///
        /// # Errors
        /// When the machine does not give the threads.
        pub fn new(threads: NonZeroUsize, at_once: NonZeroUsize) -> Result<Self, ThreadPoolBuildError> {
            let pool = ThreadPoolBuilder::new()
                .num_threads(threads.get())
                .thread_name(|index| format!("compute-{index}"))
                .start_handler(|_| yield_to_requests())
                .build()?;
            Ok(Self {
                pool: Arc::new(pool),
                places: Arc::new(Semaphore::new(at_once.get().min(Semaphore::MAX_PERMITS))),
            })
        }

        /// Runs `work` when there is a place for it. It runs to its end even if nobody waits for it any more: let it look
        /// at a [`super::RunControl`].
        ///
        /// # Errors
        /// [`ComputeError`] when it panics, which harms nobody else.
        ///
        /// # Panics
        /// Never: the places are never closed and a panic of the work is caught.
        pub async fn run<T: Send + 'static>(
            &self,
            work: impl FnOnce() -> T + Send + 'static,
        ) -> Result<T, ComputeError> {
            let place = Arc::clone(&self.places)
                .acquire_owned()
                .await
                .expect("invariant: never closed");
            let pool = Arc::clone(&self.pool);
            let done = spawn_blocking(move || {
                let _place = place;
                // what the work has half done is dropped with it: nobody sees it
                catch_unwind(AssertUnwindSafe(|| pool.install(work)))
            });
            match done.await {
                Ok(Ok(value)) => Ok(value),
                Ok(Err(panic)) => Err(ComputeError::of(&*panic)),
                Err(error) => Err(ComputeError(error.to_string())),
            }
        }
    }

    /// Lets the threads that serve requests go first when there are more threads than processors: a merge takes a little
    /// longer, and a probe does not wait for it. Linux counts niceness by the thread; elsewhere it is the process's.
    fn yield_to_requests() {
        #[cfg(target_os = "linux")]
        let _ = rustix::process::nice(NICENESS); // without it all is slower, and nothing wrong
    }

    /// Of -20 to 19; 10 gives a tenth of the time of a thread at 0.
    #[cfg(target_os = "linux")]
    const NICENESS: i32 = 10;

    impl ComputeError {
        /// The error of a caught panic.
        #[must_use]
        pub fn of(panic: &(dyn Any + Send)) -> Self {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
            Self(text.unwrap_or("without a message").to_owned())
        }
    }

    #[cfg(test)]
    mod tests {
        use std::sync::atomic::{AtomicUsize, Ordering};

        use super::*;

        fn of(threads: usize, at_once: usize) -> Compute {
            let number = |number| NonZeroUsize::new(number).expect("not zero");
            Compute::new(number(threads), number(at_once)).expect("threads")
        }

        #[tokio::test]
        async fn work_runs_in_the_pool_and_answers() {
            assert_eq!(of(3, 1).run(rayon::current_num_threads).await, Ok(3));
        }

        #[tokio::test]
        async fn a_panic_is_an_answer_and_the_next_work_runs() {
            let compute = of(1, 1);
            let broken: Result<(), _> = compute.run(|| panic!("cell {} is lost", 7)).await;
            assert_eq!(broken, Err(ComputeError("cell 7 is lost".to_owned())));
            assert_eq!(compute.run(|| 1).await, Ok(1));
        }

        #[tokio::test(flavor = "multi_thread")]
        async fn no_more_works_run_at_one_time_than_there_are_places() {
            static RUNNING: AtomicUsize = AtomicUsize::new(0);
            let compute = of(4, 2);
            let works = (0..16).map(|_| {
                compute.run(|| {
                    let now = RUNNING.fetch_add(1, Ordering::SeqCst) + 1;
                    std::thread::yield_now();
                    RUNNING.fetch_sub(1, Ordering::SeqCst);
                    now
                })
            });
            for most in futures_util::future::join_all(works).await {
                assert!(most.expect("no panic") <= 2);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::ManualClock;

    #[test]
    fn a_control_stops_at_its_deadline_not_before() {
        let clock = Arc::new(ManualClock::new(jiff::Timestamp::UNIX_EPOCH));
        let control = RunControl::start(Arc::clone(&clock) as Arc<dyn Clock>, Some(Duration::from_secs(10)));
        clock.advance(Duration::from_secs(9));
        assert_eq!((control.now(), control.should_stop()), (Duration::from_secs(9), None));
        clock.advance(Duration::from_secs(1));
        assert_eq!(control.should_stop(), Some(Stop::Deadline));
        let unhurried = RunControl::start(clock, None);
        assert_eq!(unhurried.should_stop(), None);
    }

    #[test]
    fn whoever_holds_a_clone_can_cancel_and_so_can_giving_up_the_wait() {
        let clock = Arc::new(ManualClock::new(jiff::Timestamp::UNIX_EPOCH));
        let control = RunControl::start(clock, None);
        let waiting = control.cancel_on_drop();
        assert_eq!(control.clone().should_stop(), None);
        drop(waiting);
        assert_eq!(control.should_stop(), Some(Stop::Cancelled));
    }
}

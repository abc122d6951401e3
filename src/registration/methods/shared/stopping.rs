//! For the tests of methods: a control that stops a registration at any of the moments at which it looks.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use crate::grid::OccupancyGrid;
use crate::registration::{Control, Method, Reason, Registration, Stop, register};

/// Counts the looks of the method, tells the time by them, and stops it at one of them and ever after.
struct StopsAt {
    looks: AtomicUsize,
    at: usize,
    stop: Stop,
}

impl Control for StopsAt {
    fn now(&self) -> Duration {
        Duration::from_secs(self.looks.load(Ordering::SeqCst) as u64)
    }

    fn should_stop(&self) -> Option<Stop> {
        (self.looks.fetch_add(1, Ordering::SeqCst) >= self.at).then_some(self.stop)
    }
}

/// Asserts that the method, whose stages have these names, can be stopped before each of them, between any two of them and
/// inside, and that it runs to the end when it is not. Returns how often it looks.
pub(crate) fn assert_stops_wherever_it_looks(
    method: &dyn Method,
    (fixed, moving): (&OccupancyGrid, &OccupancyGrid),
    names: &[&str],
) -> usize {
    let run = |at, stop| {
        let looks = AtomicUsize::new(0);
        let control = StopsAt { looks, at, stop };
        let answer = register(method, fixed, moving, &control);
        (answer, control.looks.into_inner())
    };
    let ran = |answer: &Registration| -> Vec<&str> { answer.stages().iter().map(|stage| stage.stage).collect() };
    let (whole, looks) = run(usize::MAX, Stop::Cancelled);
    assert_eq!(ran(&whole), names);
    assert!(looks > names.len(), "it looks before the first stage and after each");
    let mut ended_after = vec![false; names.len() + 1];
    // every look of a short run, and a sample of a long one's
    for at in (0..looks).step_by(looks.div_ceil(16)).chain([looks - 1]) {
        for (stop, reason) in [(Stop::Deadline, Reason::Deadline), (Stop::Cancelled, Reason::Cancelled)] {
            let (answer, _) = run(at, stop);
            assert!(
                names.starts_with(&ran(&answer)),
                "stopped at look {at}: {:?}",
                ran(&answer)
            );
            ended_after[ran(&answer).len()] = true;
            let Registration::Rejected(rejection) = answer else {
                panic!("stopped at look {at} of {looks}, and accepted")
            };
            assert_eq!(rejection.reason, reason, "at look {at}");
            assert!(rejection.candidates.is_empty());
        }
    }
    assert!(ended_after[0] && ended_after[names.len()], "{ended_after:?}");
    looks
}

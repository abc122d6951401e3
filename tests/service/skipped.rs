//! What this machine cannot test, said aloud.

use std::collections::BTreeSet;
use std::io::Write as _;
use std::sync::Mutex;

/// Once for each, and past the capture of the test harness, which hides what tests that pass have said.
pub(crate) fn skipped(what: &'static str, package: &'static str) {
    static TOLD: Mutex<BTreeSet<&str>> = Mutex::new(BTreeSet::new());
    if TOLD.lock().expect("no panic").insert(what) {
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED: {what}: this machine lacks the package {package} (tests/packages.sh installs it)"
        );
    }
}

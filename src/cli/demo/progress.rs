//! What a person sees while the demo runs: a bar for each robot and a line for the merge. On anything but a terminal
//! there are only the lines that stay.

use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};

use super::team::Robot;
use crate::api;
use crate::cli::Failure;
use crate::cli::terminal::say;

/// The bars of a running demo.
pub(super) struct Progress {
    all: MultiProgress,
    robots: Vec<ProgressBar>,
    merge: ProgressBar,
}

impl Progress {
    /// Bars for these robots, each with so many maps to push.
    pub(super) fn new(robots: &[Robot], pushes: usize) -> Self {
        let all = MultiProgress::new();
        let bar = |robot: &Robot| {
            let bar = all.add(ProgressBar::new(pushes as u64));
            bar.set_style(style("{prefix:>6} [{bar:16}] {pos} of {len} maps  {msg}"));
            bar.set_prefix(robot.name.to_string());
            bar
        };
        let robots = robots.iter().map(bar).collect();
        let merge = all.add(ProgressBar::new_spinner());
        merge.set_style(style("{spinner:>6} {msg}"));
        merge.enable_steady_tick(Duration::from_millis(100));
        Self { all, robots, merge }
    }

    /// A robot has pushed a map.
    pub(super) fn pushed(&self, index: usize, robot: &Robot, push: usize) {
        let snapshot = robot.snapshot(push);
        let (driven, area) = (snapshot.driven, snapshot.grid.known_area());
        self.robots[index].set_message(format!("{driven:.0} m driven, {area:.0} m2 known"));
        self.robots[index].inc(1);
    }

    /// A merge has come so far.
    pub(super) fn merging(&self, job: &api::Job) {
        let stage = job.stage.as_deref().unwrap_or("waiting for a worker");
        self.merge
            .set_message(format!("merging: {stage}, {:.0} %", 100.0 * job.progress));
    }

    /// A line that stays.
    pub(super) fn say(&self, line: &str) -> Result<(), Failure> {
        self.all.suspend(|| say(line))
    }

    /// Takes the bars away.
    pub(super) fn end(&self) {
        self.merge.finish_and_clear();
        for bar in &self.robots {
            bar.finish_and_clear();
        }
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template)
        .expect("invariant: the templates are understood")
        .progress_chars("=> ")
}

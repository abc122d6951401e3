//! Points at which a test may have the process end as `kill -9` ends it, or stand still as `SIGSTOP` stops it: right
//! between two steps whose order the promises rest on.
//!
//! Imports nothing of the crate. Debug builds only, which is what tests run: a release build has neither the points nor
//! the means to arm them.

use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicU32, Ordering};

/// A point between two steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Point {
    /// The blob of a map is kept; no row tells of it.
    AfterBlob,
    /// The transaction that adds a map has written everything but its commit.
    BeforeCommit,
    /// A map is committed; nobody has been told.
    AfterCommit,
    /// A change that its caller has named is committed; its answer is not kept.
    BeforeAnswer,
    /// A worker has loaded the maps of a job and is about to weld them.
    MidMerge,
    /// What a merge made is kept as blobs; the version is not written.
    BeforePublish,
    /// The transaction that publishes a version has written everything but its commit.
    BeforePublishCommit,
    /// A version is committed; nobody has been told.
    AfterPublish,
}

impl Point {
    /// All of them, in the order of a map's life.
    pub const ALL: [Self; 8] = [
        Self::AfterBlob,
        Self::BeforeCommit,
        Self::AfterCommit,
        Self::BeforeAnswer,
        Self::MidMerge,
        Self::BeforePublish,
        Self::BeforePublishCommit,
        Self::AfterPublish,
    ];

    /// As an order names it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::AfterBlob => "after_blob",
            Self::BeforeCommit => "before_commit",
            Self::AfterCommit => "after_commit",
            Self::BeforeAnswer => "before_answer",
            Self::MidMerge => "mid_merge",
            Self::BeforePublish => "before_publish",
            Self::BeforePublishCommit => "before_publish_commit",
            Self::AfterPublish => "after_publish",
        }
    }
}

/// What happens at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// The process ends at once; nothing is flushed, dropped or told.
    Kill,
    /// The process stands still until it is sent `SIGCONT`.
    Stop,
}

/// An order: what happens, where, and at which time that the point is reached. Written `POINT:kill` or `POINT:stop`, with
/// `:N` behind it for the Nth time instead of the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Order {
    /// Where.
    pub point: Point,
    /// What.
    pub action: Action,
    /// The first time is 1.
    pub time: u32,
}

impl FromStr for Order {
    type Err = BadOrder;

    fn from_str(text: &str) -> Result<Self, BadOrder> {
        let bad = || BadOrder(text.to_owned());
        let mut parts = text.split(':');
        let name = parts.next().unwrap_or_default();
        let point = Point::ALL
            .into_iter()
            .find(|point| point.as_str() == name)
            .ok_or_else(bad)?;
        let action = match parts.next() {
            Some("kill") => Action::Kill,
            Some("stop") => Action::Stop,
            _ => return Err(bad()),
        };
        let time = parts.next().map_or(Ok(1), str::parse).map_err(|_| bad())?;
        if time == 0 || parts.next().is_some() {
            return Err(bad());
        }
        Ok(Self { point, action, time })
    }
}

/// Text that is no order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadOrder(String);

impl fmt::Display for BadOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let points = Point::ALL.map(Point::as_str).join(", ");
        write!(
            f,
            "{:?} is no order for a failpoint; write POINT:kill or POINT:stop, with :N for the Nth time; points are {points}",
            self.0
        )
    }
}

impl std::error::Error for BadOrder {}

/// The order that holds, as its point's index above all times: 0 is none.
static POINT: AtomicU32 = AtomicU32::new(0);
/// How often the point has to be reached until it is time.
static LEFT: AtomicU32 = AtomicU32::new(0);
/// Whether to stop instead of to end.
static STOPS: AtomicU32 = AtomicU32::new(0);

/// Has this process follow an order. A release build does not: it says so.
///
/// # Errors
/// In a release build.
pub fn arm(order: Order) -> Result<(), NotBuiltIn> {
    if !cfg!(debug_assertions) {
        return Err(NotBuiltIn);
    }
    STOPS.store(u32::from(order.action == Action::Stop), Ordering::SeqCst);
    LEFT.store(order.time, Ordering::SeqCst);
    POINT.store(order.point as u32 + 1, Ordering::SeqCst);
    Ok(())
}

/// A release build was given an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a release build has no failpoints")]
pub struct NotBuiltIn;

/// Tells that the process has come to this point.
#[inline]
pub fn reach(point: Point) {
    if cfg!(debug_assertions) && POINT.load(Ordering::Relaxed) == point as u32 + 1 {
        act();
    }
}

#[cold]
fn act() {
    let left = LEFT.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |left| left.checked_sub(1));
    if left != Ok(1) {
        return;
    }
    if STOPS.load(Ordering::SeqCst) == 0 {
        std::process::abort();
    }
    // the signal comes from outside: to send one ourselves would take unsafe code
    let us = std::process::id().to_string();
    let told = std::process::Command::new("kill").args(["-STOP", &us]).status();
    assert!(
        told.is_ok_and(|status| status.success()),
        "kill -STOP {us} did not work"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_is_read_as_it_is_written() {
        for point in Point::ALL {
            let order = format!("{}:kill", point.as_str()).parse::<Order>();
            assert_eq!(
                order,
                Ok(Order {
                    point,
                    action: Action::Kill,
                    time: 1
                })
            );
        }
        let order = "mid_merge:stop:3".parse::<Order>();
        assert_eq!(
            order,
            Ok(Order {
                point: Point::MidMerge,
                action: Action::Stop,
                time: 3
            })
        );
        for bad in [
            "",
            "mid_merge",
            "mid_merge:burn",
            "nowhere:kill",
            "mid_merge:kill:0",
            "mid_merge:kill:1:2",
        ] {
            assert!(bad.parse::<Order>().is_err(), "{bad:?}");
        }
    }
}

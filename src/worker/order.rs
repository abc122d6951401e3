//! What a merge is about: which maps of which robots, in whose frame, by which method, and what operators say.

use std::collections::BTreeMap;

use super::steering::Steered;
use super::work::Failure;
use crate::geometry::Pose2;
use crate::model::{Constraint, Job, MapRecord, MergeRequest, MethodSpec, RobotId, Session};

/// What is to be merged, and how.
#[derive(Debug)]
pub(super) struct Order {
    /// One a robot, by robot.
    pub(super) maps: Vec<MapRecord>,
    /// Index of the anchor among them.
    pub(super) anchor: usize,
    pub(super) method: MethodSpec,
    pub(super) resolution: Option<f64>,
    /// What operators say about them.
    pub(super) steered: Steered,
}

impl Order {
    pub(super) fn new(session: &Session, newest: Vec<MapRecord>, request: &MergeRequest) -> Result<Self, Failure> {
        let settings = &session.settings;
        let Some(anchor) = request.anchor.as_ref().or(settings.anchor.as_ref()) else {
            return Err(Failure::for_good(
                "no_maps",
                format!("session {} has no map yet", session.id),
            ));
        };
        let has_map = |robot: &RobotId| newest.iter().any(|map| map.robot == *robot);
        if !has_map(anchor) {
            let message = format!(
                "the anchor, robot {anchor}, has no map yet; the session's frame is the frame of its map: push one, or \
                 make another robot the anchor"
            );
            return Err(Failure::for_good("anchor_has_no_map", message));
        }
        if let Some(robots) = &request.robots {
            if let Some(unknown) = robots.iter().find(|robot| !has_map(robot)) {
                return Err(Failure::for_good(
                    "robot_has_no_map",
                    format!("robot {unknown} has no map yet"),
                ));
            }
            if !robots.contains(anchor) {
                let message = format!("robots leaves out the anchor, robot {anchor}; the result is told in its frame");
                return Err(Failure::for_good("anchor_left_out", message));
            }
        }
        let wanted = |map: &MapRecord| request.robots.as_ref().is_none_or(|robots| robots.contains(&map.robot));
        let maps: Vec<MapRecord> = newest.into_iter().filter(wanted).collect();
        let anchor = maps.iter().position(|map| map.robot == *anchor);
        Ok(Self {
            anchor: anchor.expect("invariant: the anchor has a map and is wanted"),
            maps,
            method: request.method.as_ref().unwrap_or(&settings.method).clone(),
            resolution: settings.resolution.map(f64::from),
            steered: Steered::default(),
        })
    }

    /// Takes in what operators say. `earlier` is where the version before placed maps, in the frame of this anchor.
    pub(super) fn steer(
        &mut self,
        job: &Job,
        standing: Vec<Constraint>,
        earlier: &BTreeMap<RobotId, Pose2>,
    ) -> Result<(), Failure> {
        let robots = self.robots();
        self.steered = Steered::new(job, standing, &robots[self.anchor], &robots, earlier)?;
        Ok(())
    }

    pub(super) fn anchor(&self) -> &RobotId {
        &self.maps[self.anchor].robot
    }

    pub(super) fn robots(&self) -> Vec<RobotId> {
        self.maps.iter().map(|map| map.robot.clone()).collect()
    }
}

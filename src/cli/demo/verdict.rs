//! Whether the service found what the simulation knows.

use super::team::Robot;
use crate::api::MergeResult;
use crate::cli::placements::plain_table;
use crate::fusion::Moments;
use crate::geometry::Pose2;

/// A robot whose map lies this near to the truth, over its walls, is where it should be: two cells.
const NEAR_M: f64 = 0.1;

/// One robot's place beside its true one.
struct Finding<'a> {
    robot: &'a Robot,
    truth: Pose2,
    found: Option<Found>,
}

struct Found {
    pose: Pose2,
    verification_index: Option<f64>,
    /// How far the map's walls are from where they should be, RMS.
    error_m: f64,
    error_degrees: f64,
}

/// The findings about all robots.
pub(super) struct Verdict<'a> {
    findings: Vec<Finding<'a>>,
}

impl<'a> Verdict<'a> {
    /// Compares a result with the truth; the first robot is the anchor.
    pub(super) fn of(robots: &'a [Robot], result: &MergeResult) -> Self {
        let finding = |robot: &'a Robot| {
            let truth = robot.pose_in(&robots[0]);
            let placement = result.maps.iter().find(|map| map.name == robot.name.as_str());
            let placed = placement.and_then(|map| Some((map.pose?.to_pose2()?, map.verification_index)));
            Finding {
                robot,
                truth,
                found: placed.map(|(pose, verification_index)| Found {
                    pose,
                    verification_index,
                    error_m: Moments::of(&robot.last().grid).distance(pose, truth),
                    error_degrees: (pose.yaw() - truth.yaw()).degrees().abs(),
                }),
            }
        };
        Self {
            findings: robots.iter().map(finding).collect(),
        }
    }

    /// For each robot where it is, where it was found, and how far that is off.
    pub(super) fn table(&self) -> String {
        let header = [
            "robot",
            "placed",
            "true x, y, yaw",
            "found x, y, yaw",
            "V",
            "off [cm]",
            "off [deg]",
            "",
        ];
        let mut table = plain_table(&header);
        for Finding { robot, truth, found } in &self.findings {
            let name = robot.name.to_string();
            let truth = shown(*truth);
            table.add_row(match found {
                Some(found) => [
                    name,
                    "yes".to_owned(),
                    truth,
                    shown(found.pose),
                    found.verification_index.map_or_else(String::new, |v| format!("{v:.3}")),
                    format!("{:.1}", 100.0 * found.error_m),
                    format!("{:.2}", found.error_degrees),
                    String::new(),
                ],
                None => [
                    name,
                    "no".to_owned(),
                    truth,
                    String::new(),
                    String::new(),
                    String::new(),
                    String::new(),
                    String::new(),
                ],
            });
        }
        table.trim_fmt()
    }

    /// What is wrong, one sentence a robot; empty when all is right.
    pub(super) fn complaints(&self) -> Vec<String> {
        let complaint = |finding: &Finding<'_>| match &finding.found {
            None => Some(format!("{} was not placed", finding.robot.name)),
            Some(found) if found.error_m > NEAR_M => {
                let (name, error) = (&finding.robot.name, 100.0 * found.error_m);
                Some(format!(
                    "{name} is {error:.0} cm off, which is more than {:.0} cm",
                    100.0 * NEAR_M
                ))
            }
            Some(_) => None,
        };
        self.findings.iter().filter_map(complaint).collect()
    }
}

fn shown(pose: Pose2) -> String {
    format!("{:.2} m, {:.2} m, {:.1} deg", pose.x(), pose.y(), pose.yaw().degrees())
}

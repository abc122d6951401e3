//! A group of maps as one body: its walls once each, and what its maps say of a point together.
//!
//! **Method.** Maps of a group overlap, and a wall that five of them saw is one wall. The wall points of each map
//! (`sketch`) are kept unless an earlier map of the group has a wall there. A point of another body is matched where at
//! least as many maps of the group see a wall as see free space, and violated where more see nothing but free space.
//!
//! **Cost.** A look is one lookup for each wall point in each map of the other group that may be there.

use super::maps::Maps;
use super::sketch::{Around, Wall, WallAgreement, tally};
use crate::geometry::Pose2;

/// See the module.
pub(super) struct Body {
    members: Vec<(usize, Pose2)>,
    walls: Vec<Wall>,
}

impl Body {
    /// Of maps and where they lie in the group's frame.
    pub(super) fn new(maps: &Maps<'_>, members: Vec<(usize, Pose2)>) -> Self {
        let mut walls = Vec::new();
        for (count, &(map, pose)) in members.iter().enumerate() {
            let earlier = &members[..count];
            let new = maps.sketched(map).1.walls().iter().map(|wall| wall.moved(pose));
            walls.extend(new.filter(|wall| votes(maps, earlier, wall)[1] == 0));
        }
        Self { members, walls }
    }

    /// How the walls of two bodies agree under a pose.
    pub(super) fn agreement(&self, maps: &Maps<'_>, other: &Self, pose_self_other: Pose2) -> WallAgreement {
        let there = self.look(maps, other, pose_self_other);
        let back = other.look(maps, self, pose_self_other.inverse());
        there.mean(back)
    }

    /// The walls of `other` looked up in this body.
    fn look(&self, maps: &Maps<'_>, other: &Self, pose_self_other: Pose2) -> WallAgreement {
        tally(other.walls.iter().map(|wall| {
            let wall = wall.moved(pose_self_other);
            let [free, occupied] = votes(maps, &self.members, &wall);
            let around = match (free, occupied) {
                (0, 0) => Around::Doubt,
                (free, occupied) if occupied >= free => Around::Wall,
                _ => Around::Free,
            };
            (wall, around)
        }))
    }
}

/// How many maps see nothing but free space around a wall point of the group's frame, and how many a wall.
fn votes(maps: &Maps<'_>, members: &[(usize, Pose2)], wall: &Wall) -> [u32; 2] {
    let mut votes = [0; 2];
    for &(map, place) in members {
        let point = place.inverse().apply(wall.point);
        match maps.sketched(map).1.around(maps.sketched(map).0, point) {
            Around::Doubt => {}
            Around::Free => votes[0] += 1,
            Around::Wall => votes[1] += 1,
        }
    }
    votes
}

//! All rules of a merge together: what they say about each map in the anchor's frame, and whether they can hold at once.

use std::collections::BTreeMap;

use super::{Apart, Constraint, Fixed, Guess, RobotId, Rule};
use crate::geometry::Pose2;

/// What the rules of a merge come to. Poses are told in the anchor's map frame unless a field says otherwise.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Steering {
    /// Maps whose poses operators have fixed, directly or by way of others; the anchor is none of them.
    pub fixed: BTreeMap<RobotId, Pose2>,
    /// Maps that are fixed to each other, but not to the anchor.
    pub ties: Vec<Tie>,
    /// Where maps lie about, and how far off that may be, in metres.
    pub guesses: BTreeMap<RobotId, (Pose2, f64)>,
    /// Maps that must not be merged.
    pub apart: Vec<[RobotId; 2]>,
    /// What became of each rule, in the order given.
    pub effects: Vec<Effect>,
}

/// Two maps that an operator has fixed to each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Tie {
    /// The robot in whose map frame the pose is told.
    pub fixed: RobotId,
    /// The robot whose map's pose is told.
    pub moving: RobotId,
    /// Pose of the moving map's frame in the fixed map's frame.
    pub pose_fixed_moving: Pose2,
}

/// What became of a rule.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Effect {
    /// The merge obeyed it.
    Applied,
    /// It did not matter to this merge, and why.
    NotApplied(String),
}

/// Rules that cannot hold at once.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Clash {
    /// Two ways of fixed poses lead from one map to the other.
    #[error(
        "robot {0} is fixed relative to robot {1} already, directly or by way of others; remove that constraint first"
    )]
    FixedTwice(RobotId, RobotId),
    /// Two guesses about one pair of maps.
    #[error("there is a guess about robots {0} and {1} already; remove that constraint first")]
    GuessedTwice(RobotId, RobotId),
    /// Maps are fixed to each other that must not be merged.
    #[error(
        "robots {0} and {1} are kept apart by one constraint and fixed to each other by others; remove one of them"
    )]
    FixedAndApart(RobotId, RobotId),
}

impl Steering {
    /// What the rules say about the maps of `robots`, of which the anchor is one. `earlier` is where the version before
    /// placed maps: guesses relative to a map that is not fixed are told from there.
    ///
    /// # Errors
    /// [`Clash`] when the rules cannot hold at once.
    pub fn of(
        rules: &[&Rule],
        anchor: &RobotId,
        robots: &[RobotId],
        earlier: &BTreeMap<RobotId, Pose2>,
    ) -> Result<Self, Clash> {
        let absent = |rule: &Rule| rule.robots().into_iter().find(|robot| !robots.contains(robot)).cloned();
        let present: Vec<&Rule> = rules.iter().copied().filter(|rule| absent(rule).is_none()).collect();
        Self::check(&present)?;
        let mut steering = Self::default();
        steering.follow_fixed(&present, anchor);
        steering.follow_guesses(&present, anchor, earlier);
        for rule in &present {
            if let Rule::Apart(Apart { robots }) = rule {
                steering.apart.push(robots.clone());
            }
        }
        steering.effects = rules
            .iter()
            .map(|rule| match absent(rule) {
                Some(robot) => Effect::NotApplied(format!("robot {robot} has no map in this merge")),
                None => steering.effect(rule, anchor),
            })
            .collect();
        Ok(steering)
    }

    /// Whether rules can hold at once, whatever maps there are.
    ///
    /// # Errors
    /// The first [`Clash`] in their order.
    pub fn check(rules: &[&Rule]) -> Result<(), Clash> {
        let mut groups: Vec<Vec<&RobotId>> = Vec::new();
        for (index, rule) in rules.iter().enumerate() {
            let [base, robot] = rule.robots();
            match rule {
                Rule::Fixed(_) => {
                    let of = |robot: &RobotId| groups.iter().position(|group| group.contains(&robot));
                    match (of(base), of(robot)) {
                        (Some(a), Some(b)) if a == b => return Err(Clash::FixedTwice(robot.clone(), base.clone())),
                        (Some(a), Some(b)) => {
                            let moved = groups.swap_remove(a.max(b));
                            groups[a.min(b)].extend(moved);
                        }
                        (Some(group), None) => groups[group].push(robot),
                        (None, Some(group)) => groups[group].push(base),
                        (None, None) => groups.push(vec![base, robot]),
                    }
                }
                Rule::Guess(_) => {
                    let before = rules[..index].iter().filter(|rule| matches!(rule, Rule::Guess(_)));
                    if before.clone().any(|other| rule.is_about_the_robots_of(other)) {
                        return Err(Clash::GuessedTwice(robot.clone(), base.clone()));
                    }
                }
                Rule::Apart(_) => {}
            }
        }
        let joined = |[a, b]: [&RobotId; 2]| groups.iter().any(|group| group.contains(&a) && group.contains(&b));
        match rules
            .iter()
            .find(|rule| matches!(rule, Rule::Apart(_)) && joined(rule.robots()))
        {
            None => Ok(()),
            Some(rule) => {
                let [a, b] = rule.robots().map(RobotId::clone);
                Err(Clash::FixedAndApart(a, b))
            }
        }
    }

    /// Poses by way of fixed poses, from the anchor on; what no way leads to is tied.
    fn follow_fixed(&mut self, rules: &[&Rule], anchor: &RobotId) {
        let ties: Vec<Tie> = rules
            .iter()
            .filter_map(|rule| match rule {
                Rule::Fixed(Fixed {
                    robot,
                    relative_to,
                    pose,
                    ..
                }) => Some(Tie {
                    fixed: relative_to.clone(),
                    moving: robot.clone(),
                    pose_fixed_moving: pose_of(*pose),
                }),
                _ => None,
            })
            .collect();
        let edges: Vec<Way> = ties
            .iter()
            .map(|tie| (&tie.fixed, &tie.moving, tie.pose_fixed_moving))
            .collect();
        let mut poses = BTreeMap::from([(anchor.clone(), Pose2::IDENTITY)]);
        follow(&mut poses, &edges);
        self.ties = ties
            .iter()
            .filter(|tie| !poses.contains_key(&tie.fixed))
            .cloned()
            .collect();
        poses.remove(anchor);
        self.fixed = poses;
    }

    /// Guesses told in the anchor's frame, as far as their bases are known there.
    fn follow_guesses(&mut self, rules: &[&Rule], anchor: &RobotId, earlier: &BTreeMap<RobotId, Pose2>) {
        let guesses: Vec<&Guess> = rules
            .iter()
            .filter_map(|rule| match rule {
                Rule::Guess(guess) => Some(guess),
                _ => None,
            })
            .collect();
        let mut known = self.fixed.clone();
        known.insert(anchor.clone(), Pose2::IDENTITY);
        // what rules say first; where the version before placed a base, only for what they leave open
        for more in [&BTreeMap::new(), earlier] {
            let is_told_of = |robot: &RobotId| guesses.iter().any(|guess| guess.robot == *robot);
            let bases = more.iter().filter(|(robot, _)| !is_told_of(robot));
            for (robot, pose) in bases {
                known.entry(robot.clone()).or_insert(*pose);
            }
            while let Some((robot, pose, reach)) = guesses.iter().find_map(|guess| told(guess, &known)) {
                known.insert(robot.clone(), pose);
                self.guesses.insert(robot, (pose, reach));
            }
        }
    }

    fn effect(&self, rule: &Rule, anchor: &RobotId) -> Effect {
        let Rule::Guess(guess) = rule else {
            return Effect::Applied;
        };
        let set = |robot: &RobotId| robot == anchor || self.fixed.contains_key(robot);
        if set(&guess.robot) && set(&guess.relative_to) {
            let robot = &guess.robot;
            return Effect::NotApplied(format!("where robot {robot} lies is known: it is the anchor, or fixed"));
        }
        let uses = |robot: &RobotId| self.guesses.contains_key(robot) || set(robot);
        if uses(&guess.robot) && (uses(&guess.relative_to) || self.guesses.contains_key(&guess.robot)) {
            Effect::Applied
        } else {
            let base = &guess.relative_to;
            Effect::NotApplied(format!("where robot {base} lies in the anchor's frame is not known"))
        }
    }
}

/// The constraints that are in force beside the rules of one merge, and those that these rules stand in for: a rule of a
/// merge goes before constraints about the same two robots.
#[must_use]
pub fn beside(rules: &[Rule], standing: Vec<Constraint>) -> (Vec<Constraint>, Vec<Constraint>) {
    let replaced = |constraint: &Constraint| rules.iter().any(|rule| rule.is_about_the_robots_of(&constraint.rule));
    let (replaced, in_force) = standing.into_iter().partition(replaced);
    (in_force, replaced)
}

type Way<'a> = (&'a RobotId, &'a RobotId, Pose2);

fn pose_of(told: super::Pose) -> Pose2 {
    Rule::pose(told).expect("invariant: the numbers of rules were checked")
}

fn follow(poses: &mut BTreeMap<RobotId, Pose2>, ways: &[Way<'_>]) {
    loop {
        let next = ways
            .iter()
            .find_map(|&(a, b, pose_a_b)| match (poses.get(a), poses.get(b)) {
                (Some(&pose_a), None) => Some((b.clone(), pose_a * pose_a_b)),
                (None, Some(&pose_b)) => Some((a.clone(), pose_b * pose_a_b.inverse())),
                _ => None,
            });
        match next {
            Some((robot, pose)) => poses.insert(robot, pose),
            None => return,
        };
    }
}

/// The robot that a guess tells something new about.
fn told(guess: &Guess, known: &BTreeMap<RobotId, Pose2>) -> Option<(RobotId, Pose2, f64)> {
    let pose_base_robot = pose_of(guess.pose);
    match (known.get(&guess.relative_to), known.get(&guess.robot)) {
        (Some(&base), None) => Some((guess.robot.clone(), base * pose_base_robot, guess.reach_m)),
        (None, Some(&robot)) => {
            let base = robot * pose_base_robot.inverse();
            Some((guess.relative_to.clone(), base, guess.reach_m))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Angle;
    use crate::model::Pose;

    fn robot(name: &str) -> RobotId {
        RobotId::parse(name).expect("a name")
    }

    fn robots(names: &[&str]) -> Vec<RobotId> {
        names.iter().map(|name| robot(name)).collect()
    }

    fn at(x: f64) -> Pose2 {
        Pose2::new(x, 0.0, Angle::ZERO)
    }

    fn fixed(robot_name: &str, base: &str, x: f64) -> Rule {
        Rule::Fixed(Fixed {
            robot: robot(robot_name),
            relative_to: robot(base),
            pose: Pose::from(at(x)),
            accepted: None,
        })
    }

    fn guess(robot_name: &str, base: &str, x: f64) -> Rule {
        Rule::Guess(Guess {
            robot: robot(robot_name),
            relative_to: robot(base),
            pose: Pose::from(at(x)),
            reach_m: 2.0,
        })
    }

    fn apart(a: &str, b: &str) -> Rule {
        Rule::Apart(Apart {
            robots: [robot(a), robot(b)],
        })
    }

    fn steer(rules: &[Rule], names: &[&str], earlier: &[(&str, f64)]) -> Steering {
        let earlier = earlier.iter().map(|(name, x)| (robot(name), at(*x))).collect();
        let rules: Vec<&Rule> = rules.iter().collect();
        Steering::of(&rules, &robot("a"), &robots(names), &earlier).expect("no clash")
    }

    fn clash(rules: &[Rule]) -> Option<Clash> {
        Steering::check(&rules.iter().collect::<Vec<_>>()).err()
    }

    #[test]
    fn fixed_poses_reach_from_the_anchor_over_others_in_both_directions() {
        let rules = [fixed("c", "b", 2.0), fixed("a", "b", -1.0), fixed("e", "d", 1.0)];
        let steering = steer(&rules, &["a", "b", "c", "d", "e"], &[]);
        assert_eq!(steering.fixed[&robot("b")], at(1.0));
        assert_eq!(steering.fixed[&robot("c")], at(3.0));
        assert_eq!(steering.ties.len(), 1, "d and e hang together, but not with the anchor");
        assert_eq!(steering.ties[0].moving, robot("e"));
        assert!(steering.effects.iter().all(|effect| *effect == Effect::Applied));
    }

    #[test]
    fn a_guess_is_told_from_a_fixed_map_an_earlier_place_or_not_at_all() {
        let rules = [
            fixed("b", "a", 1.0),
            guess("c", "b", 5.0),
            guess("e", "d", 1.0),
            guess("g", "f", 1.0),
            guess("b", "a", 3.0),
        ];
        let steering = steer(
            &rules,
            &["a", "b", "c", "d", "e", "f", "g"],
            &[("d", 10.0), ("e", 99.0)],
        );
        assert_eq!(steering.guesses[&robot("c")], (at(6.0), 2.0));
        assert_eq!(
            steering.guesses[&robot("e")],
            (at(11.0), 2.0),
            "the rule, not the earlier place"
        );
        assert_eq!(steering.guesses.len(), 2);
        let applied: Vec<bool> = steering
            .effects
            .iter()
            .map(|effect| *effect == Effect::Applied)
            .collect();
        assert_eq!(applied, [true, true, true, false, false]);
    }

    #[test]
    fn a_rule_about_a_robot_without_a_map_does_not_apply_and_says_so() {
        let steering = steer(&[apart("a", "z"), apart("a", "b")], &["a", "b"], &[]);
        assert_eq!(steering.apart, [[robot("a"), robot("b")]]);
        assert!(matches!(&steering.effects[0], Effect::NotApplied(why) if why.contains("robot z")));
    }

    #[test]
    fn rules_that_cannot_hold_at_once_are_a_clash() {
        let (a, b, c) = (robot("a"), robot("b"), robot("c"));
        assert_eq!(
            clash(&[fixed("b", "a", 1.0), fixed("c", "b", 1.0), apart("b", "d")]),
            None
        );
        assert_eq!(
            clash(&[fixed("b", "a", 1.0), fixed("c", "b", 1.0), fixed("c", "a", 2.0)]),
            Some(Clash::FixedTwice(c.clone(), a.clone()))
        );
        assert_eq!(
            clash(&[apart("c", "a"), fixed("b", "a", 1.0), fixed("c", "b", 1.0)]),
            Some(Clash::FixedAndApart(c, a.clone()))
        );
        assert_eq!(
            clash(&[guess("b", "a", 1.0), guess("a", "b", 1.0)]),
            Some(Clash::GuessedTwice(a, b))
        );
    }
}

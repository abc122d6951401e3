//! What `mapweld merge` is told about how maps lie.

use std::str::FromStr;

use super::Failure;
use crate::fusion::{Prior, WeldInput};
use crate::geometry::Pose2;
use crate::model::Rule;

/// What the caller knows of how the maps lie. Maps are named by the stems of their files' names.
#[derive(Debug, Default, clap::Args)]
pub(super) struct MergeRules {
    /// Where about a map lies in the anchor's frame: x and y in metres, yaw in radians, and how far off that may be in
    /// metres (default 2). Looked at first, and decides between places that the maps alone cannot tell apart.
    #[arg(long, value_name = "NAME=X,Y,YAW[,REACH]", allow_hyphen_values = true)]
    guess: Vec<NamedGuess>,
    /// Where a map lies in the anchor's frame, whatever the maps say: x and y in metres, yaw in radians.
    #[arg(long, value_name = "NAME=X,Y,YAW", allow_hyphen_values = true)]
    fixed: Vec<NamedPose>,
    /// Two maps that must not be merged, directly or by way of others.
    #[arg(long, value_name = "NAME,NAME")]
    apart: Vec<NamedPair>,
}

#[derive(Debug, Clone, PartialEq)]
struct NamedGuess {
    name: String,
    pose: Pose2,
    reach_m: f64,
}

#[derive(Debug, Clone, PartialEq)]
struct NamedPose {
    name: String,
    pose: Pose2,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct NamedPair([String; 2]);

impl MergeRules {
    /// Puts what is known of poses on the maps.
    pub(super) fn put_priors(&self, names: &[String], anchor: usize, inputs: &mut [WeldInput]) -> Result<(), Failure> {
        let guesses = self.guess.iter().map(|guess| {
            let prior = Prior::Guess {
                pose_anchor_map: guess.pose,
                reach_m: guess.reach_m,
            };
            ("--guess", &guess.name, prior)
        });
        let fixed = self.fixed.iter();
        let fixed = fixed.map(|fixed| ("--fixed", &fixed.name, Prior::Fixed(fixed.pose)));
        for (option, name, prior) in guesses.chain(fixed) {
            let map = named(option, name, names)?;
            if map == anchor {
                let message = format!("{option} names {name:?}; it must be another map than the anchor");
                return Err(Failure::bad_input(message));
            }
            if inputs[map].prior.replace(prior).is_some() {
                let message =
                    format!("{option} names {name:?}, of which another option tells the place; one is allowed");
                return Err(Failure::bad_input(message));
            }
        }
        Ok(())
    }

    /// The pairs that must not be merged, by their maps' places among the names.
    pub(super) fn forbidden(&self, names: &[String]) -> Result<Vec<[usize; 2]>, Failure> {
        let pair = |NamedPair([a, b]): &NamedPair| Ok([named("--apart", a, names)?, named("--apart", b, names)?]);
        self.apart.iter().map(pair).collect()
    }
}

fn named(option: &str, name: &str, names: &[String]) -> Result<usize, Failure> {
    names.iter().position(|other| other == name).ok_or_else(|| {
        Failure::bad_input(format!(
            "{option} names {name:?}; it must be one of the maps: {}",
            names.join(", ")
        ))
    })
}

impl FromStr for NamedGuess {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let form = "NAME=X,Y,YAW or NAME=X,Y,YAW,REACH";
        let (name, numbers) = numbers(text, form)?;
        let (pose, reach_m) = match numbers[..] {
            [x, y, yaw] => (pose(x, y, yaw)?, Rule::REACH_DEFAULT_M),
            [x, y, yaw, reach] => (pose(x, y, yaw)?, reach),
            _ => return Err(format!("must be {form}")),
        };
        if !(reach_m > 0.0 && reach_m <= Rule::REACH_MAX_M) {
            let max = Rule::REACH_MAX_M;
            return Err(format!(
                "the reach is {reach_m}; it must be above 0 and at most {max} metres"
            ));
        }
        Ok(Self { name, pose, reach_m })
    }
}

impl FromStr for NamedPose {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let form = "NAME=X,Y,YAW";
        let (name, numbers) = numbers(text, form)?;
        match numbers[..] {
            [x, y, yaw] => Ok(Self {
                name,
                pose: pose(x, y, yaw)?,
            }),
            _ => Err(format!("must be {form}")),
        }
    }
}

impl FromStr for NamedPair {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(',') {
            Some((a, b)) if a != b && !a.is_empty() && !b.is_empty() => Ok(Self([a.to_owned(), b.to_owned()])),
            _ => Err("must be the names of two different maps: NAME,NAME".to_owned()),
        }
    }
}

fn numbers(text: &str, form: &str) -> Result<(String, Vec<f64>), String> {
    let (name, numbers) = text.rsplit_once('=').ok_or_else(|| format!("must be {form}"))?;
    let number = |number: &str| {
        let parsed = number.trim().parse::<f64>();
        parsed.map_err(|_| format!("{number:?} is no number; it must be {form}"))
    };
    Ok((
        name.to_owned(),
        numbers.split(',').map(number).collect::<Result<_, _>>()?,
    ))
}

fn pose(x: f64, y: f64, yaw: f64) -> Result<Pose2, String> {
    let pose = crate::model::Pose { x, y, yaw };
    Rule::pose(pose).map_err(|invalid| invalid.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_told_in_metres_and_radians_with_a_reach_or_without() {
        let guess: NamedGuess = "b=1.5,-2,0.5".parse().expect("a guess");
        assert_eq!((guess.name.as_str(), guess.reach_m), ("b", 2.0));
        assert!((guess.pose.y() + 2.0).abs() < 1e-12);
        assert_eq!("b=1,2,0,0.5".parse::<NamedGuess>().expect("a guess").reach_m, 0.5);
        for bad in [
            "b",
            "b=1,2",
            "b=1,2,x",
            "b=1,2,90",
            "b=1,2,0,0",
            "b=1,2,0,101",
            "b=1e7,0,0",
        ] {
            assert!(bad.parse::<NamedGuess>().is_err(), "{bad}");
        }
        assert!("b=1,2,0,1".parse::<NamedPose>().is_err());
        assert!("a,a".parse::<NamedPair>().is_err() && "a".parse::<NamedPair>().is_err());
    }
}

//! What both sweeps share: one cut of the cluttered world, registered by several methods, each judged by the whole world.

use super::answer::{Answer, answer};
use super::figure::{PALETTE, Rgb};
use super::frames::redrawn;
use super::numbers::share;
use super::outcome::Claim;
use super::picture::Laid;
use super::superiority::{self, Score, better_than, median_error_m};
use super::worlds::similarity;
use crate::geometry::{Angle, Pose2};
use crate::grid::OccupancyGrid;
use crate::registration::methods::HoughPeaksParams;
use crate::registration::methods::hough_peaks::HoughPeaks;
use crate::registration::{Control, Method, MethodName, MethodSpec};
use crate::simulation::Random;
use std::sync::Arc;

/// A method of the sweeps.
pub(super) struct Contestant {
    /// What it is called in figures and tables.
    pub(super) name: &'static str,
    method: Arc<dyn Method>,
    /// Whether the figures and the claims about the paper's own method show it; the tables show all.
    drawn: bool,
    /// It is asked about the first so many worlds: some methods take fifty times as long as the others.
    worlds_max: u64,
}

/// The methods of the sweeps.
pub(super) type Methods = [Contestant];

/// Every method: the paper's own first, the default engine last.
pub(super) fn contestants() -> Vec<Contestant> {
    let default_of = |name: MethodName| MethodSpec::default_of(name).build();
    let literal = HoughPeaks::new(HoughPeaksParams::literal()).expect("invariant: the printed values are in range");
    let drawn = |name, method| Contestant {
        name,
        method,
        drawn: true,
        worlds_max: u64::MAX,
    };
    let rivals = MethodName::ALL.into_iter().filter_map(|name| match name {
        MethodName::Hough | MethodName::HoughPeaks => None,
        MethodName::HoughSpectrum | MethodName::FourierHough | MethodName::Ransac => Some((name, u64::MAX)),
        MethodName::RandomWalk | MethodName::MapSegmentation => Some((name, 5)),
    });
    let mut all = vec![
        drawn("hough-peaks", default_of(MethodName::HoughPeaks)),
        drawn("hough-peaks, as printed", Arc::new(literal)),
    ];
    all.extend(rivals.map(|(name, worlds_max)| Contestant {
        name: name.as_str(),
        method: default_of(name),
        drawn: false,
        worlds_max,
    }));
    all.push(drawn("hough (default)", default_of(MethodName::Hough)));
    all
}

/// The methods that the figures show: the index of each, its name and its colour.
pub(super) fn drawn(methods: &Methods) -> impl Iterator<Item = (usize, &'static str, Rgb)> {
    let shown = methods.iter().enumerate().filter(|(_, method)| method.drawn);
    shown.zip(PALETTE).map(|((k, method), color)| (k, method.name, color))
}

/// What `of` tells of each method that the figures show.
pub(super) fn told(methods: &Methods, of: &dyn Fn(usize) -> String) -> String {
    let each = drawn(methods).map(|(k, name, _)| format!("{name}: {}", of(k)));
    each.collect::<Vec<_>>().join("; ")
}

/// Whether the last method, the default engine, is the best at each place. `places` has the words for a place, and what
/// each method did there.
pub(super) fn superiority<'a>(
    methods: &Methods,
    places: impl Iterator<Item = (String, Vec<Vec<&'a Judged>>)>,
) -> Claim {
    let (mut beaten, mut comparisons) = (Vec::new(), 0);
    for (place, judged) in places {
        let scores: Vec<Score> = methods
            .iter()
            .zip(&judged)
            .map(|(method, of)| Score {
                method: method.name.to_owned(),
                decisions: share(of, |judged| judged.answer.decides_well(true)),
                error_m: median_error_m(of.iter().map(|judged| &judged.answer)),
            })
            .collect();
        if let Some((ours, others)) = scores.split_last() {
            beaten.extend(better_than(ours, others, &place));
            comparisons += 2 * others.len();
        }
    }
    superiority::claim(&beaten, comparisons, "")
}

/// Both parts of a cut as they lie in the world, for a picture.
pub(super) fn halves<'a>(left: &'a OccupancyGrid, right: &'a OccupancyGrid) -> [Laid<'a>; 2] {
    [("map 1", left, PALETTE[1]), ("map 2", right, PALETTE[0])].map(|(name, map, color)| Laid {
        name,
        map,
        pose: Pose2::IDENTITY,
        color,
    })
}

/// Two maps of one world, the second in a frame turned anyhow and moved by at most 20 cells.
pub(super) struct Cut {
    pub(super) fixed: OccupancyGrid,
    pub(super) moving: OccupancyGrid,
    pub(super) truth: Pose2,
}

impl Cut {
    /// The second part is drawn anew on cells along its frame.
    pub(super) fn new([fixed, moving]: [OccupancyGrid; 2], random: &mut Random) -> Self {
        let truth = Pose2::new(
            random.uniform(-1.0, 1.0),
            random.uniform(-1.0, 1.0),
            Angle::from_radians(random.uniform(-std::f64::consts::PI, std::f64::consts::PI)),
        );
        Self {
            moving: redrawn(&moving, truth.inverse()),
            fixed,
            truth,
        }
    }

    /// Registers the two by each of the methods that are asked about this world.
    pub(super) fn judged(
        &self,
        methods: &Methods,
        number: u64,
        world: &OccupancyGrid,
        control: &dyn Control,
    ) -> Vec<Option<Judged>> {
        let asked = |method: &Contestant| number < method.worlds_max;
        let judged = methods
            .iter()
            .map(|method| asked(method).then(|| self.judged_by(&*method.method, world, control)));
        judged.collect()
    }

    /// Registers the two and compares the merged map with the whole world (in the fixed map's frame). The best pose counts
    /// also where the method itself would refuse to merge, as the paper's method always has an answer; without any pose
    /// the fixed map stands alone.
    fn judged_by(&self, method: &dyn Method, world: &OccupancyGrid, control: &dyn Control) -> Judged {
        let answer = answer(method, &self.fixed, &self.moving, Some(self.truth), control);
        let mut maps = vec![(&self.fixed, Pose2::IDENTITY)];
        maps.extend(answer.pose.map(|pose| (&self.moving, pose)));
        Judged {
            similarity: similarity(world, &maps),
            answer,
        }
    }
}

/// An answer, and how similar the merged map is to the world.
pub(super) struct Judged {
    pub(super) similarity: f64,
    pub(super) answer: Answer,
}

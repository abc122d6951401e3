//! Colours that people with any colour vision can tell apart.

use super::super::picture::Rgb;

pub(super) const PAPER: Rgb = [255; 3];
pub(super) const INK: Rgb = [26; 3];
/// The lighter half of the pattern that marks contradictions.
const HAZARD: Rgb = [255, 212, 0];

/// Six hues of Okabe and Ito, and two of Paul Tol's "muted" for the two that vanish on white paper (yellow) or mean
/// something else here (black).
const HUES: [Rgb; 8] = [
    [0, 114, 178],   // blue
    [230, 159, 0],   // orange
    [0, 158, 115],   // bluish green
    [213, 94, 0],    // vermilion
    [204, 121, 167], // reddish purple
    [86, 180, 233],  // sky blue
    [136, 34, 85],   // wine
    [153, 153, 51],  // olive
];

/// How one robot is drawn: eight hues, then the same ones darker, and each eight with another hatching of the free
/// space, so that 32 robots differ. A number on the map tells those apart that colour does not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Look {
    pub(super) wall: Rgb,
    hatching: u8,
    /// Pixels for a unit of the hatching.
    unit: u32,
}

impl Look {
    pub(super) fn of(robot: usize, unit: u32) -> Self {
        let hue = HUES[robot % HUES.len()];
        let round = robot / HUES.len() % 4;
        Self {
            wall: if round % 2 == 1 { mix(hue, INK, 0.45) } else { hue },
            hatching: [0, 1, 2, 3][round],
            unit,
        }
    }

    /// The colour of free space at a pixel of the picture.
    pub(super) fn free(self, x: u32, y: u32) -> Rgb {
        let (x, y) = (x / self.unit, y / self.unit);
        let hatched = match self.hatching {
            0 => false,
            1 => (x + y) % 9 < 2,
            2 => (x + 9 - y % 9) % 9 < 2,
            _ => x % 6 < 2 && y % 6 < 2,
        };
        mix(PAPER, self.wall, if hatched { 0.6 } else { 0.25 })
    }

    /// Black or white, whichever reads better on the wall colour.
    pub(super) fn text(self) -> Rgb {
        let [r, g, b] = self.wall.map(u32::from);
        if 299 * r + 587 * g + 114 * b > 140_000 {
            INK
        } else {
            PAPER
        }
    }
}

/// Checks of black and yellow: no robot looks like that.
pub(super) fn hazard(x: u32, y: u32) -> Rgb {
    if (x / 3 + y / 3).is_multiple_of(2) { INK } else { HAZARD }
}

/// `share` of `b`, the rest `a`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between two bytes, rounded"
)]
pub(super) fn mix(a: Rgb, b: Rgb, share: f32) -> Rgb {
    std::array::from_fn(|i| (f32::from(a[i]) + (f32::from(b[i]) - f32::from(a[i])) * share).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thirty_two_robots_look_different() {
        let looks: Vec<_> = (0..32).map(|robot| Look::of(robot, 1)).collect();
        for (i, a) in looks.iter().enumerate() {
            assert!(looks[..i].iter().all(|b| a != b), "robot {i}");
        }
    }

    /// What people without the red, or without the green, cones see (Vienot, Brettel, Mollon 1999), roughly.
    fn dichromat([r, g, b]: Rgb, red: bool) -> [f64; 3] {
        let linear = |v: u8| (f64::from(v) / 255.0).powf(2.2);
        let (r, g, b) = (linear(r), linear(g), linear(b));
        let mixed = if red {
            0.112 * r + 0.888 * g
        } else {
            0.293 * r + 0.707 * g
        };
        let bent = if red { 0.004 * (r - g) } else { -0.022 * (r - g) };
        [mixed, mixed, b + bent].map(|v| v.max(0.0).powf(1.0 / 2.2) * 255.0)
    }

    #[test]
    fn the_first_eight_colours_differ_for_red_and_green_blind_people() {
        for (i, &a) in HUES.iter().enumerate() {
            for &b in &HUES[..i] {
                for red in [true, false] {
                    let (a, b) = (dichromat(a, red), dichromat(b, red));
                    let distance = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
                    assert!(distance > 18.0, "{a:?} and {b:?} differ by {distance:.0}");
                }
            }
        }
    }
}

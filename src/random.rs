//! Seeded random numbers: the only source of chance in a simulation, and in the registration methods that draw lots.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A stream of random numbers that is a function of its seed and its name alone.
#[derive(Debug, Clone)]
pub struct Random {
    generator: Pcg64Mcg,
}

impl Random {
    /// The stream called `name` of this seed. Streams of different names are independent, so what one part of a
    /// simulation draws never shifts what another part sees.
    #[must_use]
    pub fn new(seed: u64, name: &[u64]) -> Self {
        let mixed = name.iter().fold(mix(seed), |state, part| {
            mix(state ^ mix(part.wrapping_add(0x9E37_79B9_7F4A_7C15)))
        });
        Self {
            generator: Pcg64Mcg::seed_from_u64(mixed),
        }
    }

    /// A number in [0, 1).
    #[expect(clippy::cast_precision_loss, reason = "53 bits are what an f64 holds")]
    pub fn unit(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number in [low, high).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A normal deviate of mean 0 (Box and Muller).
    pub fn normal(&mut self, sigma: f64) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        sigma * radius * (std::f64::consts::TAU * self.unit()).cos()
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// A whole number in [0, count); 0 when the count is 0.
    #[expect(clippy::cast_possible_truncation, reason = "below the count, which is a usize")]
    pub fn below(&mut self, count: usize) -> usize {
        // the upper half of a 128-bit product: unbiased to 2^-64 per item
        ((u128::from(self.generator.next_u64()) * count as u128) >> 64) as usize
    }

    /// A whole number in [low, high].
    pub fn between(&mut self, low: usize, high: usize) -> usize {
        low + self.below(high - low + 1)
    }

    /// One of the items.
    ///
    /// # Panics
    /// When there is none.
    pub fn pick<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.below(items.len())]
    }

    /// Puts the items in any order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            items.swap(last, self.below(last + 1));
        }
    }
}

/// The finaliser of `SplitMix64`.
fn mix(state: u64) -> u64 {
    let state = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let state = (state ^ (state >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    state ^ (state >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_and_name_give_the_same_stream_and_others_another() {
        let draw = |seed, name: &[u64]| {
            let mut random = Random::new(seed, name);
            [random.unit(), random.normal(1.0), random.uniform(-1.0, 1.0)].map(f64::to_bits)
        };
        assert_eq!(draw(7, &[1, 2]), draw(7, &[1, 2]));
        assert_ne!(draw(7, &[1, 2]), draw(7, &[2, 1]));
        assert_ne!(draw(7, &[1, 2]), draw(8, &[1, 2]));
    }

    #[test]
    fn draws_have_the_moments_they_claim() {
        let mut random = Random::new(1, &[]);
        let count = 20_000;
        let normal: Vec<f64> = (0..count).map(|_| random.normal(2.0)).collect();
        let mean = normal.iter().sum::<f64>() / f64::from(count);
        let variance = normal.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(count);
        assert!(mean.abs() < 0.06 && (variance - 4.0).abs() < 0.2, "{mean} {variance}");
        let mut seen = [0; 5];
        for _ in 0..count {
            seen[random.below(5)] += 1;
        }
        assert!(seen.iter().all(|&n| (3_700..4_300).contains(&n)), "{seen:?}");
        assert_eq!(random.below(0), 0);
        let mut items: Vec<u32> = (0..20).collect();
        random.shuffle(&mut items);
        assert!(items.windows(2).any(|pair| pair[0] > pair[1]));
        items.sort_unstable();
        assert_eq!(items, (0..20).collect::<Vec<_>>());
    }
}

//! Every reader of strangers' bytes, given mutations of good inputs: it takes or refuses, and never panics. What it takes
//! can be kept and read back.
//!
//! The short form of `tests/fuzz.sh`, which is guided by coverage and runs as long as it is told; the same code reads.

#![expect(clippy::print_stderr, reason = "the figure is told")]

use mapweld::random::Random;

#[path = "../fuzz/src/readers.rs"]
#[expect(unreachable_pub, reason = "public in the package of the fuzz targets")]
mod readers;
#[path = "../fuzz/src/seeds.rs"]
#[expect(unreachable_pub, reason = "public in the package of the fuzz targets")]
mod seeds;

/// Mutations of each input.
const MUTATIONS: u64 = 3000;

/// One to eight changes: a byte, a bit, a run left out, a run repeated, a number where a digit is, the end cut off.
fn mutated(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..random.between(1, 8) {
        if bytes.is_empty() {
            break;
        }
        let at = random.below(bytes.len());
        let end = (at + random.between(1, 16)).min(bytes.len());
        match random.below(6) {
            0 => bytes[at] = u8::try_from(random.below(256)).expect("a byte"),
            1 => bytes[at] ^= 1 << random.below(8),
            2 => drop(bytes.drain(at..end)),
            3 => {
                let run = bytes[at..end].to_vec();
                bytes.splice(at..at, run);
            }
            4 => {
                let digits = ["0", "-1", "65536", "4294967296", "1e308", "nan", "\"", "[["];
                let digit = bytes[at..]
                    .iter()
                    .position(u8::is_ascii_digit)
                    .map_or(at, |further| at + further);
                bytes.splice(digit..=digit, digits[random.below(digits.len())].bytes());
            }
            _ => bytes.truncate(at),
        }
    }
    bytes
}

#[test]
fn mutated_inputs_are_taken_or_refused_and_nothing_panics() {
    let mut read = 0;
    for (number, (target, name, bytes)) in (0..).zip(seeds::seeds()) {
        let reader = match target {
            "yaml" => readers::yaml,
            "png" | "pgm" => readers::picture,
            "occupancy_grid" => readers::occupancy_grid,
            _ => continue, // whole uploads are read by the server: `tests/service/http/bombs.rs`
        };
        reader(&bytes);
        for mutation in 0..MUTATIONS {
            let input = mutated(&bytes, &mut Random::new(mutation, &[number]));
            let told = std::panic::catch_unwind(|| reader(&input));
            assert!(told.is_ok(), "{target} {name}, mutation {mutation}: {input:?}");
            read += 1;
        }
    }
    eprintln!("readers: {read} mutated inputs, none panicked");
}

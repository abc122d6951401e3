//! What the methods of the paper's Table 3 have in common: Hough images and their peaks, correlations, the comparison of two
//! maps under a pose, and the rule by which a pose is accepted (eq. 34).
//!
//! May import what the room `registration` may: `geometry`, `grid`, and the room's own types. Nothing of a method.

#[cfg(test)]
pub(crate) mod contract;
pub(crate) mod correlation;
pub(crate) mod hough_image;
pub(crate) mod magnitudes;
pub(crate) mod map;
pub(crate) mod peaks;
pub(crate) mod plane;
pub(crate) mod search;
pub(crate) mod spectrum;
#[cfg(test)]
pub(crate) mod stopping;
pub(crate) mod verification;
#[cfg(test)]
pub(crate) mod world;

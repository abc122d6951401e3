//! Table 3 as the paper prints it.

use crate::experiments::numbers::mean;
use crate::experiments::outcome::Cell;
use crate::registration::MethodName;
/// Table 3 of the paper: method, seconds, V in percent, for its four experiments; `None` where it says "fails".
#[expect(clippy::type_complexity, reason = "a table, column by column")]
pub(super) const TABLE_3: [(&str, [Option<f64>; 4], [Option<f64>; 4]); 6] = [
    (
        "hough-peaks",
        some([14.0, 12.0, 11.0, 13.0]),
        some([94.0, 92.0, 92.0, 94.0]),
    ),
    (
        "map-segmentation",
        some([105.0, 68.0, 83.0, 106.0]),
        some([95.0, 91.0, 92.0, 94.0]),
    ),
    (
        "random-walk",
        some([168.0, 140.0, 150.0, 152.0]),
        some([93.0, 90.0, 88.0, 92.0]),
    ),
    (
        "hough-spectrum",
        [Some(16.0), Some(16.0), None, Some(17.0)],
        [Some(92.0), Some(89.0), None, Some(90.0)],
    ),
    (
        "fourier-hough",
        [Some(19.0), Some(17.0), None, Some(16.0)],
        [Some(88.0), Some(89.0), None, Some(87.0)],
    ),
    ("ransac", some([11.0, 8.0, 8.0, 10.0]), some([77.0, 81.0, 83.0, 80.0])),
];

const fn some([a, b, c, d]: [f64; 4]) -> [Option<f64>; 4] {
    [Some(a), Some(b), Some(c), Some(d)]
}

/// Time ratio to hough-peaks and V in table 3 of the paper.
pub(super) fn printed(name: MethodName, experiment: usize) -> (Cell, Cell) {
    let row = TABLE_3.iter().find(|(method, ..)| *method == name.as_str());
    let Some((_, seconds, v)) = row.filter(|_| experiment < 4) else {
        return (Cell::Nothing, Cell::Nothing);
    };
    let fails = || Cell::from("fails");
    let peaks = TABLE_3[0].1[experiment].unwrap_or(f64::NAN);
    (
        seconds[experiment].map_or_else(fails, |s| Cell::from(s / peaks)),
        v[experiment].map_or_else(fails, Cell::from),
    )
}

/// The mean over the paper's experiments of a method's time over that of hough-peaks; `None` for a method that it does not
/// have.
pub(super) fn printed_ratio(name: MethodName) -> Option<f64> {
    let (_, seconds, _) = TABLE_3.iter().find(|(method, ..)| *method == name.as_str())?;
    let peaks = TABLE_3[0].1;
    let ratios: Vec<f64> = seconds
        .iter()
        .zip(peaks)
        .filter_map(|(seconds, of_peaks)| Some((*seconds)? / of_peaks?))
        .collect();
    Some(mean(&ratios))
}

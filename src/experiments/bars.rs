//! Charts of bars: a row for each name, in it a bar for each of what is compared.

use super::figure::{Axis, Mark, Panel, Rgb, Series};
use super::numbers::{index, real};

/// Bars of one colour: what they are (empty for no legend), and a value for each row.
pub(super) struct Bars {
    pub(super) label: &'static str,
    pub(super) color: Rgb,
    pub(super) values: Vec<f64>,
}

/// A panel of these rows. `label` names what the bars tell, with its unit.
pub(super) fn bar_panel(title: &str, label: &str, names: &[String], groups: Vec<Bars>) -> Panel {
    let values = groups.iter().flat_map(|group| group.values.iter().copied());
    let most = values.filter(|value| value.is_finite()).fold(0.0, f64::max);
    // room for the number behind the longest bar
    let x = Axis::new(label, 0.0, 1.15 * if most > 0.0 { most } else { 1.0 });
    let high = 0.76 / real(groups.len().max(1));
    let first = 0.38 - high / 2.0;
    let mut panel = Panel::new(title, x, Axis::of_rows(names));
    for (k, group) in groups.into_iter().enumerate() {
        let up = first - real(k) * high;
        let points = group
            .values
            .iter()
            .enumerate()
            .map(|(row, value)| [*value, up - real(row)]);
        let mark = Mark::Bar(index(100.0 * high) - 2);
        panel = panel.with(Series::new(group.label, group.color, mark, points.collect()));
    }
    panel
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_of_a_row_stand_below_each_other_within_it() {
        let bars = |values| Bars {
            label: "",
            color: [0; 3],
            values,
        };
        let names = ["a".to_owned(), "b".to_owned()];
        let panel = bar_panel(
            "t",
            "pairs",
            &names,
            vec![bars(vec![4.0, 2.0]), bars(vec![f64::NAN, 3.0])],
        );
        let at = |series: usize, row: usize| panel.series[series].points[row][1];
        assert!(0.5 > at(0, 0) && at(0, 0) > at(1, 0) && at(1, 0) > -0.5);
        assert!(-0.5 > at(0, 1) && at(0, 1) > at(1, 1) && at(1, 1) > -1.5);
        assert!(panel.x.high > 4.0 && panel.x.high < 6.0 && panel.y.low < -1.5);
    }
}

//! What was placed where, for people.

use comfy_table::{CellAlignment, Table, presets};

use crate::api::{MapPlacement, MergeResult, PlacementStatus, Pose};
use crate::geometry::Angle;

/// A table of all maps of a merge.
#[must_use]
pub fn table(result: &MergeResult) -> String {
    let mut table = plain_table(&["map", "placed", "x [m]", "y [m]", "yaw [deg]", "V", "overlap", "why"]);
    for map in &result.maps {
        let [x, y, yaw] = match map.pose {
            Some(pose) => [
                format!("{:.3}", pose.x),
                format!("{:.3}", pose.y),
                format!("{:.2}", degrees(pose)),
            ],
            None => ["", "", ""].map(str::to_owned),
        };
        let placed = if map.status == PlacementStatus::Placed {
            "yes"
        } else {
            "no"
        };
        let share = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:.3}"));
        let (v, overlap) = (share(map.verification_index), share(map.overlap));
        table.add_row([
            map.name.clone(),
            placed.to_owned(),
            x,
            y,
            yaw,
            v,
            overlap,
            why(map, &result.anchor),
        ]);
    }
    table.trim_fmt()
}

/// A table without borders whose numbers, which are all columns but the first two and the last, stand on the right.
#[must_use]
pub fn plain_table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header(header.iter().copied());
    for (index, column) in table.column_iter_mut().enumerate() {
        if index >= 2 && index + 1 < header.len() {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

/// One map in one sentence.
#[must_use]
pub fn sentence(map: &MapPlacement) -> String {
    let Some(pose) = map.pose else {
        return format!("{} is not placed: {}", map.name, why(map, ""));
    };
    let Pose { x, y, .. } = pose;
    let supported = match map.supporting_pairs.len() {
        0 => String::new(),
        1 => ", supported by 1 pair".to_owned(),
        pairs => format!(", supported by {pairs} pairs"),
    };
    format!(
        "{} is placed at x {x:.3} m, y {y:.3} m, yaw {:.2} deg{supported}",
        map.name,
        degrees(pose)
    )
}

/// The maps that have their place.
pub fn placed(result: &MergeResult) -> impl Iterator<Item = &MapPlacement> {
    result.maps.iter().filter(|map| map.status == PlacementStatus::Placed)
}

/// Whether every map has its place.
#[must_use]
pub fn all_placed(result: &MergeResult) -> bool {
    placed(result).count() == result.maps.len()
}

fn why(map: &MapPlacement, anchor: &str) -> String {
    match &map.reason {
        Some(reason) => reason.message.clone(),
        None if map.name == anchor => "the anchor: the fused map is in its frame".to_owned(),
        None if map.supporting_pairs.len() == 1 => "1 pair supports it".to_owned(),
        None => format!("{} pairs support it", map.supporting_pairs.len()),
    }
}

fn degrees(pose: Pose) -> f64 {
    Angle::from_radians(pose.yaw).degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(name: &str, placement: &str) -> MapPlacement {
        let digest = "0".repeat(64);
        let text = format!(
            r#"{{"name":"{name}","digest":"{digest}","covariance":null,"runner_up":null,"supporting_pairs":[0],{placement}}}"#
        );
        serde_json::from_str(&text).expect("a placement")
    }

    #[test]
    fn a_placed_map_is_told_in_metres_and_degrees() {
        let pose = r#""status":"placed","pose":{"x":1.5,"y":-2,"yaw":1.5707963267948966},"verification_index":0.9,"overlap":0.5,"reason":null"#;
        assert_eq!(
            sentence(&map("ada", pose)),
            "ada is placed at x 1.500 m, y -2.000 m, yaw 90.00 deg, supported by 1 pair"
        );
    }

    #[test]
    fn a_map_that_is_not_placed_is_told_with_its_reason() {
        let reason = r#""status":"not_placed","pose":null,"verification_index":null,"overlap":null,"reason":{"code":"no_overlap","message":"too little in common"}"#;
        assert_eq!(sentence(&map("bob", reason)), "bob is not placed: too little in common");
    }

    #[test]
    fn numbers_stand_on_the_right_and_no_line_ends_in_spaces() {
        let mut table = plain_table(&["map", "placed", "x", "why"]);
        table
            .add_row(["a", "yes", "1.5", ""])
            .add_row(["b", "no", "-10.5", "far"]);
        let text = table.trim_fmt();
        assert!(text.contains("  1.5\n") && text.contains("-10.5  far"), "{text}");
        assert!(text.lines().all(|line| line.trim_end() == line), "{text}");
    }
}

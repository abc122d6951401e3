//! The work of a one-shot merge: decode, weld, tell.

use std::sync::Arc;

use tokio::sync::OwnedSemaphorePermit;

use super::error::{ApiError, ApiResult};
use super::extract::Part;
use super::state::AppState;
use crate::api::{FieldError, MergeResult, ProblemCode, Welded};
use crate::codec::{CodecError, Limits, MapYaml, decode_map};
use crate::fusion::{FuseError, WeldError, WeldInput, WeldOptions, distinct_names, weld};
use crate::grid::OccupancyGrid;
use crate::model::{Digest, MethodSpec};
use crate::registration::{Control, Stop};

/// The parts of a merge, sorted out.
#[derive(Debug, Default)]
pub(super) struct MapParts {
    /// YAML files.
    pub(super) maps: Vec<Part>,
    /// Pictures.
    pub(super) images: Vec<Part>,
}

/// What is to be merged, and how.
pub(super) struct Order {
    pub(super) parts: MapParts,
    pub(super) method: MethodSpec,
    pub(super) anchor: Option<String>,
    pub(super) resolution: Option<f64>,
    pub(super) limits: Limits,
}

impl Order {
    fn anchor(&self, inputs: &[WeldInput]) -> ApiResult<usize> {
        let Some(anchor) = &self.anchor else { return Ok(0) };
        inputs.iter().position(|input| input.name == *anchor).ok_or_else(|| {
            let names: Vec<&str> = inputs.iter().map(|input| input.name.as_str()).collect();
            ApiError::invalid("anchor", anchor, &format!("one of the maps: {}", names.join(", ")))
        })
    }
}

/// What came out.
pub(super) struct Done {
    pub(super) result: MergeResult,
    pub(super) fused: OccupancyGrid,
}

/// Merges; `place` is given back when the maps are decoded.
pub(super) async fn run(state: &AppState, order: Order, place: OwnedSemaphorePermit) -> ApiResult<Done> {
    let control = state.run_control();
    // When the caller hangs up this future is dropped, and the work with it.
    let _cancelled_when_dropped = control.cancel_on_drop();
    state
        .compute(move || {
            let inputs = decode(&order.parts, &order.limits)?;
            drop(place);
            merge(&order, &inputs, &control)
        })
        .await
}

fn merge(order: &Order, inputs: &[WeldInput], control: &dyn Control) -> ApiResult<Done> {
    let began = control.now();
    let mut options = WeldOptions::new(order.method.build());
    options.anchor = order.anchor(inputs)?;
    options.fuse.resolution = order.resolution;
    options.fuse.cells_max = order.limits.cells;
    let welded = weld(inputs, &options, control).map_err(|error| refusal(&error))?;
    let took = control.now().saturating_sub(began);
    let names: Vec<String> = inputs.iter().map(|input| input.name.clone()).collect();
    let digests: Vec<Digest> = inputs.iter().map(|input| Digest::of_grid(&input.grid)).collect();
    let result = MergeResult::of(
        &welded,
        &Welded {
            names: &names,
            digests: &digests,
            anchor: options.anchor,
            method: &order.method,
        },
        took,
    );
    Ok(Done {
        result,
        fused: welded.fused.grid,
    })
}

fn refusal(error: &WeldError) -> ApiError {
    let text = error.to_string();
    match error {
        WeldError::Fuse(FuseError::TooManyCells { limit, .. }) => {
            let limit = format!("at most {limit} cells");
            ApiError::new(ProblemCode::MapTooLarge, text).field(FieldError::missing("resolution", limit))
        }
        WeldError::Fuse(FuseError::Lattice(_)) => {
            ApiError::new(ProblemCode::InvalidRequest, text.clone()).field(FieldError::missing("resolution", text))
        }
        WeldError::Fuse(FuseError::Memory { .. }) | WeldError::Stopped(Stop::Deadline) => {
            ApiError::new(ProblemCode::Overloaded, text)
        }
        WeldError::Stopped(Stop::Cancelled) => ApiError::new(ProblemCode::ShuttingDown, text),
        WeldError::NoMaps
        | WeldError::NoSuchMap { .. }
        | WeldError::FixedAndForbidden(..)
        | WeldError::AnchorFixedElsewhere(_) => ApiError::internal(text),
    }
}

/// The maps, named as the command names them.
fn decode(parts: &MapParts, limits: &Limits) -> ApiResult<Vec<WeldInput>> {
    let mut free: Vec<&Part> = parts.images.iter().collect();
    let names = distinct_names(parts.maps.iter().enumerate().map(|(index, part)| stem(part, index)));
    let mut inputs = Vec::with_capacity(parts.maps.len());
    for (part, name) in parts.maps.iter().zip(names) {
        let field = format!("map {name:?}");
        let yaml = MapYaml::parse(&part.bytes, limits).map_err(|error| ApiError::bad_map(&field, &error))?;
        let image = take_image(&mut free, &yaml.image, parts).ok_or_else(|| no_image(&field, &yaml.image, parts))?;
        let map = decode_map(&part.bytes, &image.bytes, limits)
            .map_err(|error: CodecError| ApiError::bad_map(&field, &error))?;
        inputs.push(WeldInput::new(name, Arc::new(map.grid)));
    }
    match free.first() {
        None => Ok(inputs),
        Some(left) => {
            let name = left.file_name.as_deref().unwrap_or("without a file name");
            Err(super::upload::odd_part(name, "a picture that one of the maps names"))
        }
    }
}

/// The first free picture of this file name; folders do not count, as browsers and curl do not send them. Pictures
/// without file names, as some programs send them, are taken in their order.
fn take_image<'a>(free: &mut Vec<&'a Part>, image: &str, parts: &MapParts) -> Option<&'a Part> {
    let unnamed = parts.images.iter().all(|part| part.file_name.is_none());
    let wanted = last_segment(image);
    let at = free
        .iter()
        .position(|part| unnamed || part.file_name.as_deref().map(last_segment) == Some(wanted))?;
    Some(free.remove(at))
}

fn no_image(field: &str, image: &str, parts: &MapParts) -> ApiError {
    let names: Vec<&str> = parts
        .images
        .iter()
        .filter_map(|part| part.file_name.as_deref())
        .collect();
    let sent = if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    };
    ApiError::new(
        ProblemCode::MalformedMultipart,
        format!("{field} names the picture {image:?}, but no part image of this file name is left; sent are: {sent}"),
    )
    .field(FieldError::new(
        "image",
        sent,
        format!("a part with the file name {:?}", last_segment(image)),
    ))
}

fn last_segment(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

/// What the command calls the file: its name without folders and ending.
fn stem(part: &Part, index: usize) -> String {
    let name = part.file_name.as_deref().map(last_segment).unwrap_or_default();
    match name.rsplit_once('.') {
        Some((stem, _)) if !stem.is_empty() => stem.to_owned(),
        _ if !name.is_empty() => name.to_owned(),
        _ => format!("map-{}", index + 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytes::Bytes;

    fn part(name: &str, file_name: Option<&str>, content: &str) -> Part {
        Part {
            name: name.to_owned(),
            file_name: file_name.map(str::to_owned),
            bytes: Bytes::from(content.to_owned()),
        }
    }

    fn yaml(file: &str, image: &str) -> Part {
        let content = format!("{{image: {image}, resolution: 0.05, origin: [0, 0, 0]}}");
        part("map", Some(file), &content)
    }

    fn picture(file: Option<&str>, columns: u32) -> Part {
        let pixels = "0 ".repeat(columns as usize);
        part("image", file, &format!("P2 {columns} 1 255 {pixels}"))
    }

    fn widths(maps: Vec<Part>, images: Vec<Part>) -> ApiResult<Vec<(String, u32)>> {
        let inputs = decode(&MapParts { maps, images }, &Limits::default())?;
        Ok(inputs
            .into_iter()
            .map(|input| (input.name, input.grid.lattice().width()))
            .collect())
    }

    #[test]
    fn each_map_takes_the_picture_that_it_names_in_whatever_order() {
        let maps = vec![yaml("a.yaml", "a.pgm"), yaml("b.yaml", "sub/b.pgm")];
        let images = vec![picture(Some("b.pgm"), 2), picture(Some("a.pgm"), 1)];
        let found = widths(maps, images).expect("both");
        assert_eq!(found, [("a".to_owned(), 1), ("b".to_owned(), 2)]);
    }

    #[test]
    fn maps_and_pictures_of_one_name_are_taken_in_their_order() {
        let maps = vec![yaml("map.yaml", "map.pgm"), yaml("map.yaml", "map.pgm")];
        let images = vec![picture(Some("map.pgm"), 1), picture(Some("map.pgm"), 2)];
        let found = widths(maps, images).expect("both");
        assert_eq!(found, [("map".to_owned(), 1), ("map-2".to_owned(), 2)]);
    }

    #[test]
    fn pictures_that_nobody_names_or_nobody_sends_are_told() {
        let maps = || vec![yaml("a.yaml", "a.pgm"), yaml("b.yaml", "b.pgm")];
        let missing = widths(maps(), vec![picture(Some("a.pgm"), 1), picture(Some("c.pgm"), 1)]);
        let missing = missing.expect_err("no b.pgm").to_string();
        assert!(missing.contains("b.pgm") && missing.contains("c.pgm"), "{missing}");
        let images = ["a.pgm", "b.pgm", "c.pgm"].map(|name| picture(Some(name), 1));
        let left = widths(maps(), images.to_vec()).expect_err("c.pgm is left").to_string();
        assert!(left.contains("c.pgm"), "{left}");
    }
}

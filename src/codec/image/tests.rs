use ::png::BitDepth;
use proptest::prelude::*;

use super::*;
use crate::codec::{MapMode, Warning, decode_map, encode_yaml};
use crate::geometry::{Angle, Pose2};
use crate::grid::LogOdds;

fn meta() -> MapMeta {
    MapMeta::new(0.05, Pose2::IDENTITY).expect("valid")
}

fn decode(picture: &[u8], meta: &MapMeta) -> Decoded {
    decode_image(picture, meta, &Limits::default()).expect("a good picture")
}

fn refusal(picture: &[u8]) -> String {
    decode_image(picture, &meta(), &Limits::default())
        .expect_err("a bad picture")
        .to_string()
}

/// One row of pixels as PNG.
fn png_of(width: u32, color: ColorType, depth: BitDepth, samples: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, width, 1);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if color == ColorType::Indexed {
        encoder.set_palette(vec![0, 0, 0, 254, 254, 254, 205, 205, 205]);
    }
    let mut header = encoder.write_header().expect("a header");
    header.write_image_data(samples).expect("a picture");
    header.finish().expect("an end");
    bytes
}

/// After a change of the header's fields.
fn mend_header_checksum(png: &mut [u8]) {
    let mut crc = !0_u32;
    for &byte in &png[12..29] {
        crc = (0..8).fold(crc ^ u32::from(byte), |c, _| (c >> 1) ^ (0xedb8_8320 * (c & 1)));
    }
    png[29..33].copy_from_slice(&(!crc).to_be_bytes());
}

fn states(grid: &OccupancyGrid) -> Vec<CellState> {
    grid.cells().iter().map(|cell| cell.state()).collect()
}

use CellState::{Free, Occupied, Unknown};

#[test]
fn the_first_row_of_a_picture_is_the_highest_row_of_the_grid() {
    let yaml = b"image: a.pgm\nresolution: 0.5\norigin: [10, 20, 1.5707963267948966]\nnegate: 0\n\
                 occupied_thresh: 0.65\nfree_thresh: 0.196\n";
    let picture = b"P2\n# CREATOR: by hand\n3 2\n255\n0 254 205\n254 254 0\n";
    let map = decode_map(yaml, picture, &Limits::default()).expect("a good map");
    assert_eq!(states(&map.grid), [Free, Free, Occupied, Occupied, Free, Unknown]);
    assert_eq!(map.grid.at(0, 1).state(), Occupied, "the upper left pixel");
    // the corner of the lower left pixel is the origin; its columns run along +y as the yaw says
    let [x, y] = map.grid.lattice().cell_center(2, 0);
    assert!((x - 9.75).abs() < 1e-9 && (y - 21.25).abs() < 1e-9);
}

#[test]
fn grey_205_is_unknown_at_0_196_and_free_with_a_warning_at_0_25() {
    let picture = b"P2 4 1 255 0 254 205 205";
    let map = decode(picture, &meta());
    assert_eq!(states(&map.grid), [Occupied, Free, Unknown, Unknown]);
    assert!(map.warnings.is_empty());
    let old = meta().with_thresholds(0.25, 0.65).expect("valid");
    let map = decode(picture, &old);
    assert_eq!(states(&map.grid), [Occupied, Free, Free, Free]);
    assert_eq!(
        map.warnings,
        [Warning::UnknownReadsFree {
            cells: 2,
            free_thresh: 0.25
        }]
    );
    assert!(decode(b"P2 1 1 255 254", &old).warnings.is_empty());
}

#[test]
fn negate_swaps_black_and_white_but_not_the_thresholds() {
    let map = decode(b"P2 4 1 255 0 255 50 49", &meta().with_negate(true));
    assert_eq!(states(&map.grid), [Free, Occupied, Unknown, Free]);
}

#[test]
fn scale_rises_in_a_line_between_the_thresholds() {
    let scale = meta()
        .with_thresholds(0.2, 0.6)
        .expect("valid")
        .with_mode(MapMode::Scale);
    // occupancies 0, 0.2, 0.4, 0.6, 1
    let map = decode(b"P2 5 1 10 10 8 6 4 0", &scale);
    let percent = |cell: &LogOdds| (cell.probability().expect("known") * 100.0).round();
    assert_eq!(
        map.grid.cells().iter().map(percent).collect::<Vec<_>>(),
        [0.0, 0.0, 50.0, 100.0, 100.0]
    );
}

#[test]
fn raw_grey_values_are_percents_and_above_100_unknown() {
    let map = decode(b"P2 5 1 255 0 100 101 255 40", &meta().with_mode(MapMode::Raw));
    assert_eq!(states(&map.grid), [Free, Occupied, Unknown, Unknown, Unknown]);
    let forty = map.grid.at(4, 0).probability().expect("40 % is known");
    assert!((forty - 0.4).abs() < 0.005);
    assert_eq!(map.grid.at(2, 0), LogOdds::UNKNOWN);
}

#[test]
fn every_kind_of_png_and_pgm_reads_the_same() {
    let wide = |samples: &[u8]| samples.iter().flat_map(|&s| [s, s]).collect::<Vec<u8>>();
    let rgb = [0, 0, 0, 254, 254, 254, 205, 205, 205];
    let rgba = [0, 0, 0, 255, 254, 254, 254, 255, 205, 205, 205, 255];
    let pictures = [
        ("L8", png_of(3, ColorType::Grayscale, BitDepth::Eight, &[0, 254, 205])),
        (
            "L16",
            png_of(3, ColorType::Grayscale, BitDepth::Sixteen, &wide(&[0, 254, 205])),
        ),
        ("RGB8", png_of(3, ColorType::Rgb, BitDepth::Eight, &rgb)),
        ("RGB16", png_of(3, ColorType::Rgb, BitDepth::Sixteen, &wide(&rgb))),
        ("RGBA8", png_of(3, ColorType::Rgba, BitDepth::Eight, &rgba)),
        ("RGBA16", png_of(3, ColorType::Rgba, BitDepth::Sixteen, &wide(&rgba))),
        (
            "LA8",
            png_of(
                3,
                ColorType::GrayscaleAlpha,
                BitDepth::Eight,
                &[0, 255, 254, 255, 205, 255],
            ),
        ),
        ("palette", png_of(3, ColorType::Indexed, BitDepth::Two, &[0b0001_1000])),
        ("P2", b"P2 3 1 255 0 254 205".to_vec()),
        ("P2 of 51", b"P2 3 1 51 0 51 41".to_vec()),
        ("P2 of 65535", b"P2 3 1 65535 0 65278 52685".to_vec()),
        ("P5", b"P5\n# a comment\n3 1\n255\n\x00\xfe\xcd".to_vec()),
        ("P5 of 51", b"P5 3 1 51\n\x00\x33\x29".to_vec()),
        ("P5 of 65535", b"P5 3 1 65535\n\x00\x00\xfe\xfe\xcd\xcd".to_vec()),
    ];
    for (name, picture) in pictures {
        let map = decode(&picture, &meta());
        assert_eq!(states(&map.grid), [Occupied, Free, Unknown], "{name}");
    }
}

#[test]
fn pixels_that_something_shines_through_are_unknown_in_every_mode() {
    let picture = png_of(3, ColorType::GrayscaleAlpha, BitDepth::Eight, &[0, 254, 0, 255, 0, 0]);
    for mode in [MapMode::Trinary, MapMode::Scale, MapMode::Raw] {
        let map = decode(&picture, &meta().with_mode(mode));
        assert_eq!(map.grid.at(0, 0), LogOdds::UNKNOWN, "{mode:?}");
        assert!(map.grid.at(1, 0).is_known(), "{mode:?}");
        assert_eq!(map.grid.at(2, 0), LogOdds::UNKNOWN, "{mode:?}");
    }
}

#[test]
fn opaque_pixels_that_map_server_would_read_differently_are_told() {
    // with alpha averaged in, 205 is (3 * 205 + 255) / 4 = 217.5: free
    let picture = png_of(2, ColorType::GrayscaleAlpha, BitDepth::Eight, &[205, 255, 0, 255]);
    let map = decode(&picture, &meta());
    assert_eq!(map.warnings, [Warning::AlphaNotAveraged { cells: 1 }]);
}

#[test]
fn interlaced_png_read_as_others() {
    // 1 x 1, grey 8 bits, Adam7
    let mut picture = png_of(1, ColorType::Grayscale, BitDepth::Eight, &[254]);
    picture[28] = 1;
    mend_header_checksum(&mut picture);
    assert_eq!(states(&decode(&picture, &meta()).grid), [Free]);
}

#[test]
fn pictures_that_lie_are_refused_before_memory_is_taken() {
    let limit = "is over the limit of 67108864 cells";
    assert!(refusal(b"P5 2147483648 2147483648 255\n").contains(limit));
    assert!(refusal(b"P5 99999999999 1 255\n").contains("PGM"));
    assert!(refusal(b"P5 8000 8000 255\nxx").contains("the file has 19 bytes, at least 64000000 are needed"));
    assert!(refusal(b"P2 8000 8000 255\n0 0").contains("cut short"));
    assert!(refusal(b"P2 2 1 255 0").contains("PGM"));
    assert!(refusal(b"P2 2 1 255 0 x").contains("PGM"));
    assert!(refusal(b"P2 2 1 255 0 256").contains("PGM"));
    assert!(refusal(b"P2 1 1 0 0").contains("PGM"));
    assert!(refusal(b"P5 1 1 70000\n\x01\x01").contains("PGM"));
    assert!(refusal(b"P5 0 1 255\n").contains("has no cell"));
    assert!(refusal(b"P5").contains("PGM"));
    assert!(refusal(b"GIF89a...").contains("unknown picture format"));
    assert!(refusal(b"").contains("unknown picture format"));

    // the header of a 30000 x 30000 picture, whose data would come
    let lattice = Lattice::new(1, 1, 0.05, Pose2::IDENTITY).expect("valid");
    let mut bomb = encode_png(&OccupancyGrid::unknown(lattice));
    bomb[16..20].copy_from_slice(&30_000_u32.to_be_bytes());
    bomb[20..24].copy_from_slice(&30_000_u32.to_be_bytes());
    mend_header_checksum(&mut bomb);
    assert_eq!(refusal(&bomb), format!("a map of 30000 x 30000 cells {limit}"));
}

#[test]
fn bytes_over_the_limit_are_refused() {
    let limits = Limits {
        bytes: 10,
        ..Limits::default()
    };
    let error = decode_image(b"P2 1 1 255 0", &meta(), &limits).expect_err("12 bytes");
    assert_eq!(error.to_string(), "picture of 12 bytes is over the limit of 10 bytes");
    assert!(error.is_over_limit());
}

fn any_grid() -> impl Strategy<Value = OccupancyGrid> {
    (1_u32..40, 1_u32..40).prop_flat_map(|(width, height)| {
        let cell = prop_oneof![Just(LogOdds::UNKNOWN), (-9.0..9.0_f64).prop_map(LogOdds::from_value)];
        proptest::collection::vec(cell, (width * height) as usize).prop_map(move |cells| {
            let origin = Pose2::new(-3.25, 7.5, Angle::from_degrees(30.0));
            let lattice = Lattice::new(width, height, 0.05, origin).expect("valid");
            OccupancyGrid::new(lattice, cells).expect("as many cells")
        })
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read_back_with_the_same_states(grid in any_grid()) {
        let yaml = encode_yaml(grid.lattice(), "map.png");
        for picture in [encode_png(&grid), encode_pgm(&grid)] {
            let back = decode_map(yaml.as_bytes(), &picture, &Limits::default()).expect("our own map");
            prop_assert_eq!(back.grid.lattice(), grid.lattice());
            prop_assert_eq!(states(&back.grid), states(&grid));
            prop_assert!(back.warnings.is_empty());
        }
    }

    #[test]
    fn no_bytes_make_the_reader_panic(magic in 0..4_usize, noise in proptest::collection::vec(any::<u8>(), 0..200)) {
        let magic: &[u8] = [&b"\x89PNG\r\n\x1a\n"[..], b"P5 3 4 255\n", b"P2 3 4 ", b""][magic];
        let _ = decode_image(&[magic, &noise].concat(), &meta(), &Limits::default());
    }

    #[test]
    fn broken_and_cut_files_never_panic(grid in any_grid(), at in any::<prop::sample::Index>(), byte in any::<u8>(),
                                        png in any::<bool>()) {
        let mut picture = if png { encode_png(&grid) } else { encode_pgm(&grid) };
        let at = at.index(picture.len());
        picture[at] = byte;
        let _ = decode_image(&picture, &meta(), &Limits::default());
        picture.truncate(at);
        prop_assert!(decode_image(&picture, &meta(), &Limits::default()).is_err() || png);
    }
}

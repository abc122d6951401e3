//! PNG pictures. The first byte picks how grey values are read.
#![no_main]

use libfuzzer_sys::fuzz_target;
use mapweld::codec::{MapMeta, MapMode, decode_image};
use mapweld::geometry::Pose2;
use mapweld_fuzz::{limits, must_be_kept};

fuzz_target!(|bytes: &[u8]| {
    let Some((&pick, picture)) = bytes.split_first() else {
        return;
    };
    let mode = [MapMode::Trinary, MapMode::Scale, MapMode::Raw][usize::from(pick % 3)];
    let meta = MapMeta::new(0.05, Pose2::IDENTITY).expect("a resolution within its range");
    let meta = meta.with_mode(mode).with_negate(pick & 0x80 != 0);
    if let Ok(decoded) = decode_image(picture, &meta, &limits()) {
        must_be_kept(&decoded);
    }
});

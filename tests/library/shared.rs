//! The folder of real maps beside the checkout, which is not part of the project.

use std::path::{Path, PathBuf};

/// A file or folder of the real maps; nothing, loudly, when they are not there.
#[expect(clippy::print_stderr, reason = "a skipped test says so")]
pub(crate) fn shared_maps(test: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let maps = std::env::var_os("MAPWELD_SHARED")
        .map_or_else(beside, PathBuf::from)
        .join("maps");
    if maps.is_dir() {
        return Some(maps);
    }
    eprintln!(
        "SKIPPED {test}: no real maps at {} (set MAPWELD_SHARED)",
        maps.display()
    );
    None
}

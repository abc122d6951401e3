//! The command as people run it, and folders with maps for it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use mapweld::codec::{encode_png, encode_yaml};
use mapweld::grid::OccupancyGrid;

/// Runs the command to its end.
pub(crate) fn mapweld(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_mapweld"))
        .args(arguments)
        .output()
        .expect("the command runs")
}

/// A temporary folder.
pub(crate) struct Folder(tempfile::TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn text(&self, name: &str) -> String {
        text(&self.path(name))
    }

    /// Writes a map's two files, and gives the YAML's path. The picture comes first, as map savers do it.
    pub(crate) fn map(&self, name: &str, grid: &OccupancyGrid) -> String {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("it is made");
        let image = path.with_extension("png");
        std::fs::write(&image, encode_png(grid)).expect("it is written");
        let image = text(Path::new(image.file_name().expect("a name")));
        std::fs::write(&path, encode_yaml(grid.lattice(), &image)).expect("it is written");
        text(&path)
    }
}

fn text(path: &Path) -> String {
    path.to_str().expect("a readable path").to_owned()
}

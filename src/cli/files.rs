//! Maps and results as files.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use super::{BadInput, Failure};
use crate::codec::{self, Decoded, Limits, MapYaml};

/// The two files of one map as they lie on the disk, not decoded yet.
#[derive(Debug, Clone)]
pub struct MapFiles {
    /// The YAML file's path.
    pub path: PathBuf,
    /// Its content.
    pub yaml: Vec<u8>,
    /// The picture's path: what the YAML names, relative to the YAML's folder.
    pub image_path: PathBuf,
    /// The picture's content.
    pub image: Vec<u8>,
}

impl MapFiles {
    /// Reads a YAML file and the picture that it names.
    ///
    /// # Errors
    /// [`Failure::BadInput`] when either cannot be read, is over the limits, or the YAML is none of a map.
    pub fn read(path: &Path, limits: &Limits) -> Result<Self, Failure> {
        let yaml = read(path, limits.yaml_bytes)?;
        let parsed = MapYaml::parse(&yaml, limits).bad_input(|| path.display().to_string())?;
        let image_path = path.parent().unwrap_or(Path::new("")).join(&parsed.image);
        let image = read(&image_path, limits.bytes)
            .map_err(|failure| failure.while_doing(format!("{}: image", path.display())))?;
        Ok(Self {
            path: path.to_path_buf(),
            yaml,
            image_path,
            image,
        })
    }

    /// The map in them.
    ///
    /// # Errors
    /// [`Failure::BadInput`] when the picture is none, or over the limits.
    pub fn decode(&self, limits: &Limits) -> Result<Decoded, Failure> {
        codec::decode_map(&self.yaml, &self.image, limits).bad_input(|| self.path.display().to_string())
    }

    /// The YAML file's name without folders and ending: what a map is called by.
    #[must_use]
    pub fn stem(&self) -> String {
        text(self.path.file_stem())
    }
}

/// The last part of a path as text.
#[must_use]
pub fn file_name(path: &Path) -> String {
    text(path.file_name())
}

/// Makes a folder, and those above it, unless it is there.
///
/// # Errors
/// [`Failure::BadInput`] when it cannot be made: its name was the caller's choice.
pub fn make_folder(folder: &Path) -> Result<(), Failure> {
    fs::create_dir_all(folder).bad_input(|| format!("cannot make the folder {}", folder.display()))
}

/// Writes a file into a folder.
///
/// # Errors
/// When it cannot be written.
pub fn write(folder: &Path, name: &str, content: &[u8]) -> Result<(), Failure> {
    let path = folder.join(name);
    fs::write(&path, content).map_err(|error| {
        let what = format!("cannot write {}", path.display());
        Failure::Internal(anyhow::Error::new(error).context(what))
    })
}

fn read(path: &Path, limit: u64) -> Result<Vec<u8>, Failure> {
    let cannot = || format!("cannot read {}", path.display());
    let bytes = fs::metadata(path).bad_input(cannot)?.len();
    if bytes > limit {
        let message = format!("{} has {bytes} bytes; the limit is {limit} bytes", path.display());
        return Err(Failure::bad_input(message));
    }
    fs::read(path).bad_input(cannot)
}

fn text(name: Option<&OsStr>) -> String {
    name.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    const YAML: &str = "image: sub/m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n";

    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::create_dir(folder.path().join("sub")).expect("a folder in it");
        fs::write(folder.path().join("first floor.yaml"), YAML).expect("a YAML file");
        fs::write(folder.path().join("sub/m.pgm"), "P2 2 1 255 0 254").expect("a picture");
        folder
    }

    fn message(failure: &Failure) -> String {
        match failure {
            Failure::BadInput(error) => format!("{error:#}"),
            other => panic!("{other:?} is not the caller's mistake"),
        }
    }

    #[test]
    fn the_picture_is_looked_for_beside_the_yaml() {
        let folder = folder();
        let files =
            MapFiles::read(&folder.path().join("first floor.yaml"), &Limits::default()).expect("both are there");
        assert_eq!(files.stem(), "first floor");
        let grid = files.decode(&Limits::default()).expect("it is a map").grid;
        assert_eq!((grid.state_counts().occupied, grid.state_counts().free), (1, 1));
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let folder = folder();
        let read = |name: &str| MapFiles::read(&folder.path().join(name), &Limits::default());
        let error = message(&read("none.yaml").expect_err("there is none"));
        assert!(error.contains("none.yaml") && error.contains("No such file"), "{error}");
        fs::remove_file(folder.path().join("sub/m.pgm")).expect("it goes");
        let error = message(&read("first floor.yaml").expect_err("the picture is gone"));
        assert!(
            error.contains("first floor.yaml: image") && error.contains("m.pgm"),
            "{error}"
        );
    }

    #[test]
    fn a_file_over_the_limit_is_not_read() {
        let folder = folder();
        let limits = Limits {
            bytes: 10,
            ..Limits::default()
        };
        let read = MapFiles::read(&folder.path().join("first floor.yaml"), &limits);
        let error = message(&read.expect_err("16 bytes are too many"));
        assert!(error.ends_with("m.pgm has 16 bytes; the limit is 10 bytes"), "{error}");
    }
}

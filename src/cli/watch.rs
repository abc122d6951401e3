//! Notices that a map saver has written a map anew.
//!
//! Looks at the files again and again rather than asking the system for events: events do not cross network and shared
//! folders, which is where robots keep their maps, and a map is two files that no saver writes in one step, so that
//! every event would have to be followed by looking anyway.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::Failure;
use super::files::MapFiles;
use crate::codec::{Limits, MapYaml};

/// The two files of one map, looked at from time to time.
#[derive(Debug)]
pub(super) struct Watch {
    path: PathBuf,
    limits: Limits,
    /// What the last look saw.
    seen: Option<Stamp>,
    /// What was handed out or found broken last: not looked into again.
    settled: Option<Stamp>,
}

/// What a look found.
#[derive(Debug)]
pub(super) enum Look {
    /// Nothing that was not there before, or files that are still being written.
    Nothing,
    /// A map that is new, complete and readable.
    New(MapFiles),
    /// New files that have come to rest and are no map.
    Broken(Failure),
}

/// What changes when either file is written.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Stamp {
    yaml: Vec<u8>,
    yaml_written: Option<SystemTime>,
    image: PathBuf,
    image_written: Option<SystemTime>,
    image_bytes: Option<u64>,
}

impl Watch {
    /// Watches the map of this YAML file, which need not be there yet.
    #[must_use]
    pub(super) fn new(path: &Path, limits: Limits) -> Self {
        Self {
            path: path.to_path_buf(),
            limits,
            seen: None,
            settled: None,
        }
    }

    /// Looks at the files. They are taken when two looks in a row see the same, when the second reads a whole map from
    /// them, and when they are still the same after that.
    pub(super) fn look(&mut self) -> Look {
        let now = self.stamp();
        let at_rest = now.is_some() && now == self.seen;
        self.seen.clone_from(&now);
        if !at_rest || now == self.settled {
            return Look::Nothing;
        }
        let read = MapFiles::read(&self.path, &self.limits).and_then(|files| files.decode(&self.limits).map(|_| files));
        if self.stamp() != now {
            return Look::Nothing;
        }
        self.settled = now;
        match read {
            Ok(files) => Look::New(files),
            Err(failure) => Look::Broken(failure),
        }
    }

    /// `None` while there is no YAML file.
    fn stamp(&self) -> Option<Stamp> {
        let written = |path: &Path| fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
        let yaml_bytes = fs::metadata(&self.path).ok()?.len();
        let yaml = if yaml_bytes > self.limits.yaml_bytes {
            Vec::new()
        } else {
            fs::read(&self.path).ok()?
        };
        let image = match MapYaml::parse(&yaml, &self.limits) {
            Ok(parsed) => self.path.parent().unwrap_or(Path::new("")).join(parsed.image),
            Err(_) => PathBuf::new(),
        };
        Some(Stamp {
            yaml,
            yaml_written: written(&self.path),
            image_written: written(&image),
            image_bytes: fs::metadata(&image).ok().map(|metadata| metadata.len()),
            image,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Saver {
        folder: tempfile::TempDir,
        writes: u64,
    }

    impl Saver {
        fn new() -> (Self, Watch) {
            let folder = tempfile::tempdir().expect("a temporary folder");
            let watch = Watch::new(&folder.path().join("m.yaml"), Limits::default());
            (Self { folder, writes: 0 }, watch)
        }

        /// Writes a file with a time of its own, as clocks go on between the writes of a real saver.
        fn write(&mut self, name: &str, content: &str) {
            let path = self.folder.path().join(name);
            fs::write(&path, content).expect("it is written");
            self.writes += 1;
            let time = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(self.writes);
            fs::File::options()
                .write(true)
                .open(&path)
                .and_then(|file| file.set_modified(time))
                .expect("it has a time");
        }

        fn yaml(&mut self) {
            self.write("m.yaml", "image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n");
        }
    }

    fn is_new(look: &Look) -> bool {
        matches!(look, Look::New(_))
    }

    #[test]
    fn a_map_is_taken_once_when_both_files_have_come_to_rest() {
        let (mut saver, mut watch) = Saver::new();
        assert!(matches!(watch.look(), Look::Nothing), "there is no file yet");
        saver.write("m.pgm", "P2 2 1 255 0 254");
        saver.yaml();
        assert!(matches!(watch.look(), Look::Nothing), "seen for the first time");
        let Look::New(files) = watch.look() else {
            panic!("the files are at rest")
        };
        assert_eq!(files.image, b"P2 2 1 255 0 254");
        assert!(matches!(watch.look(), Look::Nothing), "it was taken");
        saver.write("m.pgm", "P2 2 1 255 0 0");
        assert!(matches!(watch.look(), Look::Nothing), "changed just now");
        assert!(is_new(&watch.look()), "the picture alone has changed");
    }

    #[test]
    fn a_map_that_is_still_growing_is_not_taken() {
        let (mut saver, mut watch) = Saver::new();
        saver.yaml();
        for content in ["P2 2 ", "P2 2 1 255", "P2 2 1 255 0", "P2 2 1 255 0 254"] {
            saver.write("m.pgm", content);
            assert!(matches!(watch.look(), Look::Nothing), "{content:?}");
        }
        assert!(is_new(&watch.look()));
    }

    #[test]
    fn a_broken_map_is_told_once_and_taken_when_it_is_mended() {
        let (mut saver, mut watch) = Saver::new();
        saver.yaml();
        saver.write("m.pgm", "P2 2 1 255 0");
        let looks = [watch.look(), watch.look(), watch.look()];
        assert!(
            matches!(looks, [Look::Nothing, Look::Broken(_), Look::Nothing]),
            "{looks:?}"
        );
        saver.write("m.pgm", "P2 2 1 255 0 254");
        assert!(matches!(watch.look(), Look::Nothing));
        assert!(is_new(&watch.look()));
    }
}

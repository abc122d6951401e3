//! What a robot keeps on its disk while the server is out of reach: the newest map of each robot.
//!
//! One file a robot, replaced in one step, so that a robot which loses power keeps the old map or the new one, never
//! half of either. Older maps are dropped on purpose: a merge takes each robot's newest map alone.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::upload::{FilePart, Upload};
use crate::model::{RobotId, SessionId};

/// The ending of a kept map. Session and robot names hold no dots, so `SESSION.ROBOT.spooled` is taken apart safely.
const ENDING: &str = "spooled";

/// A folder of maps that wait for the server.
#[derive(Debug, Clone)]
pub struct Spool {
    folder: PathBuf,
}

/// Whose map it is, and where it goes.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Recipient {
    /// The session.
    pub session: SessionId,
    /// The robot.
    pub robot: RobotId,
}

/// Why a spool could not keep or give back a map.
#[derive(Debug, thiserror::Error)]
pub enum SpoolError {
    /// The folder or a file in it could not be used.
    #[error("spool: cannot {doing} {}: {source}", path.display())]
    Io {
        /// What was being done.
        doing: &'static str,
        /// To which file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// A file that this program did not write, or that was cut short.
    #[error("spool: {} is not a kept map: {detail}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        detail: String,
    },
}

/// The first line of a kept map; the two contents follow it, one after the other.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    map_name: String,
    map_bytes: usize,
    image_name: String,
    image_bytes: usize,
}

impl Spool {
    /// Opens a folder, and makes it when there is none.
    ///
    /// # Errors
    /// When the folder cannot be made.
    pub fn open(folder: impl Into<PathBuf>) -> Result<Self, SpoolError> {
        let folder = folder.into();
        fs::create_dir_all(&folder).map_err(io_error("make", &folder))?;
        Ok(Self { folder })
    }

    /// Keeps a map until [`Spool::forget`], in place of an older one of the same robot. On the disk when it returns.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn keep(&self, to: &Recipient, upload: &Upload) -> Result<(), SpoolError> {
        let path = self.path(to);
        let part = path.with_extension("part");
        let write = || -> io::Result<()> {
            let mut file = File::create(&part)?;
            let header = Header {
                map_name: upload.map.name.clone(),
                map_bytes: upload.map.content.len(),
                image_name: upload.image.name.clone(),
                image_bytes: upload.image.content.len(),
            };
            serde_json::to_writer(&mut file, &header)?;
            file.write_all(b"\n")?;
            file.write_all(&upload.map.content)?;
            file.write_all(&upload.image.content)?;
            file.sync_all()?;
            fs::rename(&part, &path)?;
            File::open(&self.folder)?.sync_all()
        };
        write().map_err(io_error("write", &path))
    }

    /// Whose maps wait, in the order of their names.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn waiting(&self) -> Result<Vec<Recipient>, SpoolError> {
        let mut waiting = Vec::new();
        for entry in fs::read_dir(&self.folder).map_err(io_error("list", &self.folder))? {
            let entry = entry.map_err(io_error("list", &self.folder))?;
            let name = entry.file_name();
            let parts: Vec<&str> = name.to_str().unwrap_or_default().split('.').collect();
            if let [session, robot, ENDING] = parts[..]
                && let (Ok(session), Ok(robot)) = (session.parse(), robot.parse())
            {
                waiting.push(Recipient { session, robot });
            }
        }
        waiting.sort();
        Ok(waiting)
    }

    /// The map that waits for this recipient, if any.
    ///
    /// # Errors
    /// When the file cannot be read, or was not written by [`Spool::keep`].
    pub fn get(&self, to: &Recipient) -> Result<Option<Upload>, SpoolError> {
        let path = self.path(to);
        let content = match fs::read(&path) {
            Ok(content) => content,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(io_error("read", &path)(error)),
        };
        decode(content)
            .map(Some)
            .map_err(|detail| SpoolError::Damaged { path, detail })
    }

    /// Drops the map of this recipient after the server acknowledged `sent`, unless a newer one has taken its place.
    ///
    /// # Errors
    /// When the file cannot be read or removed.
    pub fn forget(&self, to: &Recipient, sent: &Upload) -> Result<(), SpoolError> {
        if self.get(to)?.is_some_and(|kept| kept.digest() == sent.digest()) {
            let path = self.path(to);
            fs::remove_file(&path).map_err(io_error("remove", &path))?;
        }
        Ok(())
    }

    fn path(&self, to: &Recipient) -> PathBuf {
        self.folder.join(format!("{}.{}.{ENDING}", to.session, to.robot))
    }
}

fn decode(content: Vec<u8>) -> Result<Upload, String> {
    let content = bytes::Bytes::from(content);
    let line = content
        .iter()
        .position(|byte| *byte == b'\n')
        .ok_or("it has no first line")?;
    let header: Header = serde_json::from_slice(&content[..line]).map_err(|error| error.to_string())?;
    let body = content.slice(line + 1..);
    if header.map_bytes.checked_add(header.image_bytes) != Some(body.len()) {
        return Err(format!(
            "it holds {} bytes after its first line, which tells of {} + {}",
            body.len(),
            header.map_bytes,
            header.image_bytes
        ));
    }
    Ok(Upload {
        map: FilePart::new(header.map_name, body.slice(..header.map_bytes)),
        image: FilePart::new(header.image_name, body.slice(header.map_bytes..)),
    })
}

fn io_error(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> SpoolError {
    let path = path.to_path_buf();
    move |source| SpoolError::Io { doing, path, source }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recipient(robot: &str) -> Recipient {
        Recipient {
            session: "night-shift".parse().expect("a session name"),
            robot: robot.parse().expect("a robot name"),
        }
    }

    fn upload(pixels: &'static str) -> Upload {
        Upload {
            map: FilePart::new("m.yaml", "image: m.png\n"),
            image: FilePart::new("m.png", pixels),
        }
    }

    fn spool() -> (tempfile::TempDir, Spool) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let spool = Spool::open(folder.path().join("spool")).expect("the spool opens");
        (folder, spool)
    }

    #[test]
    fn a_kept_map_comes_back_as_it_was_also_to_another_process() {
        let (folder, spool) = spool();
        spool.keep(&recipient("ada"), &upload("one\ntwo")).expect("it is kept");
        let reopened = Spool::open(folder.path().join("spool")).expect("the spool opens");
        assert_eq!(reopened.waiting().expect("it lists"), [recipient("ada")]);
        assert_eq!(
            reopened.get(&recipient("ada")).expect("it reads"),
            Some(upload("one\ntwo"))
        );
        assert_eq!(reopened.get(&recipient("bob")).expect("it reads"), None);
    }

    #[test]
    fn the_newest_map_of_a_robot_takes_the_place_of_the_older() {
        let (_folder, spool) = spool();
        for (robot, pixels) in [("bob", "old"), ("ada", "other"), ("bob", "new")] {
            spool.keep(&recipient(robot), &upload(pixels)).expect("it is kept");
        }
        assert_eq!(spool.waiting().expect("it lists"), [recipient("ada"), recipient("bob")]);
        assert_eq!(spool.get(&recipient("bob")).expect("it reads"), Some(upload("new")));
    }

    #[test]
    fn only_the_map_that_was_sent_is_forgotten() {
        let (_folder, spool) = spool();
        spool.keep(&recipient("ada"), &upload("new")).expect("it is kept");
        spool
            .forget(&recipient("ada"), &upload("old"))
            .expect("nothing to forget");
        assert_eq!(spool.get(&recipient("ada")).expect("it reads"), Some(upload("new")));
        spool
            .forget(&recipient("ada"), &upload("new"))
            .expect("it is forgotten");
        assert_eq!(spool.waiting().expect("it lists"), []);
    }

    #[test]
    fn a_file_cut_short_is_reported_not_sent() {
        let (folder, spool) = spool();
        spool.keep(&recipient("ada"), &upload("pixels")).expect("it is kept");
        let path = folder.path().join("spool/night-shift.ada.spooled");
        let whole = fs::read(&path).expect("the kept file");
        for length in 0..whole.len() {
            fs::write(&path, &whole[..length]).expect("it is cut");
            assert!(
                matches!(spool.get(&recipient("ada")), Err(SpoolError::Damaged { .. })),
                "cut to {length}"
            );
        }
    }

    #[test]
    fn files_of_others_in_the_folder_are_left_alone() {
        let (folder, spool) = spool();
        for name in ["notes.txt", "a.b.part", "UPPER.bob.spooled", "a.b.c.spooled"] {
            fs::write(folder.path().join("spool").join(name), "x").expect("a file of somebody else");
        }
        assert_eq!(spool.waiting().expect("it lists"), []);
    }
}

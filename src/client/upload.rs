//! A map as it lies on a robot's disk, on its way to the server.

use bytes::Bytes;
use sha2::{Digest, Sha256};

/// The two files of one map, exactly as a map saver wrote them: the server decodes them, the robot does not.
///
/// Cheap to clone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Upload {
    /// The YAML file.
    pub map: FilePart,
    /// The image file that the YAML names.
    pub image: FilePart,
}

/// One file of an upload.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FilePart {
    /// Its name without folders.
    pub name: String,
    /// Its content.
    pub content: Bytes,
}

impl FilePart {
    /// A file by its name without folders and its content.
    pub fn new(name: impl Into<String>, content: impl Into<Bytes>) -> Self {
        Self {
            name: name.into(),
            content: content.into(),
        }
    }
}

impl Upload {
    /// Equal for equal files: tells a watcher whether there is anything new to send.
    #[must_use]
    pub fn digest(&self) -> [u8; 32] {
        let mut hash = Sha256::new();
        for part in [&self.map, &self.image] {
            for bytes in [part.name.as_bytes(), &part.content] {
                hash.update((bytes.len() as u64).to_le_bytes());
                hash.update(bytes);
            }
        }
        hash.finalize().into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digest_tells_apart_what_differs_in_any_part() {
        let of = |a: &'static str, b: &'static str, c: &'static str, d: &'static str| {
            let upload = Upload {
                map: FilePart::new(a, b),
                image: FilePart::new(c, d),
            };
            upload.digest()
        };
        let digest = of("m.yaml", "image: m.png", "m.png", "pixels");
        assert_eq!(digest, of("m.yaml", "image: m.png", "m.png", "pixels"));
        assert_ne!(digest, of("m.yaml", "image: m.pn", "gm.png", "pixels"));
        assert_ne!(digest, of("m.yaml", "image: m.png", "m.png", "pixel"));
        assert_ne!(digest, of("n.yaml", "image: m.png", "m.png", "pixels"));
    }
}

//! What the codec is willing to take in.

use super::CodecError;
use crate::grid::Lattice;

/// The most that a decoder takes in; each limit is checked before the memory for it is taken.
///
/// | field | default | why |
/// |---|---|---|
/// | `bytes` | 128 MiB | holds a 16-bit PGM with the default number of cells |
/// | `cells` | 64 Mi | a map of 8192 x 8192 cells, 128 MiB once decoded |
/// | `yaml_bytes` | 64 KiB | real map files have some hundred bytes |
/// | `yaml_depth` | 8 | real map files nest one list in one mapping |
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of one encoded picture or message.
    pub bytes: u64,
    /// Cells (pixels) of one map.
    pub cells: u64,
    /// Bytes of a YAML file.
    pub yaml_bytes: u64,
    /// Levels of nesting in a YAML file.
    pub yaml_depth: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            bytes: 128 << 20,
            cells: 64 << 20,
            yaml_bytes: 64 << 10,
            yaml_depth: 8,
        }
    }
}

impl Limits {
    pub(super) fn check_bytes(&self, what: &'static str, bytes: &[u8]) -> Result<(), CodecError> {
        within(what, bytes, self.bytes)
    }

    pub(super) fn check_yaml(&self, bytes: &[u8]) -> Result<(), CodecError> {
        within("YAML", bytes, self.yaml_bytes)
    }

    /// Refuses pictures without a cell and those with more cells than are allowed.
    pub(super) fn check_cells(&self, width: u32, height: u32) -> Result<usize, CodecError> {
        if width == 0 || height == 0 {
            return Err(crate::grid::LatticeError::Empty { width, height }.into());
        }
        let limit = self.cells.min(Lattice::CELLS_MAX);
        let cells = u64::from(width) * u64::from(height);
        match usize::try_from(cells) {
            Ok(count) if cells <= limit => Ok(count),
            _ => Err(CodecError::TooManyCells { width, height, limit }),
        }
    }
}

fn within(what: &'static str, bytes: &[u8], limit: u64) -> Result<(), CodecError> {
    let bytes = bytes.len() as u64;
    if bytes > limit {
        return Err(CodecError::TooManyBytes { what, bytes, limit });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_cells_as_the_limit_are_taken_and_one_more_is_refused() {
        let limits = Limits {
            cells: 12,
            ..Limits::default()
        };
        assert_eq!(limits.check_cells(4, 3).ok(), Some(12));
        let error = limits.check_cells(13, 1).expect_err("13 cells");
        assert_eq!(error.to_string(), "a map of 13 x 1 cells is over the limit of 12 cells");
        assert!(limits.check_cells(0, 3).is_err());
        assert!(limits.check_cells(u32::MAX, u32::MAX).is_err());
    }
}

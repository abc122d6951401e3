//! Why bytes are no map.

use std::collections::TryReserveError;
use std::fmt::Display;

use crate::grid::LatticeError;

/// What is wrong with the bytes that were to be a map: always the caller's.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CodecError {
    /// More encoded bytes than allowed.
    #[error("{what} of {bytes} bytes is over the limit of {limit} bytes")]
    TooManyBytes {
        /// Which file.
        what: &'static str,
        /// Its size.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// More cells than allowed.
    #[error("a map of {width} x {height} cells is over the limit of {limit} cells")]
    TooManyCells {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// The limit.
        limit: u64,
    },
    /// The machine has not the memory for a map of this size.
    #[error("no memory for a map of {cells} cells: {reason}")]
    NoMemory {
        /// Cells asked for.
        cells: usize,
        /// What the allocator said.
        reason: TryReserveError,
    },
    /// Neither PNG nor PGM.
    #[error("unknown picture format: the file starts with {start}; PNG and PGM (P5, P2) are read")]
    UnknownFormat {
        /// The first bytes, printable.
        start: String,
    },
    /// A picture that breaks its format.
    #[error("bad {format} picture: {reason}")]
    BadPicture {
        /// `PNG` or `PGM`.
        format: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// No YAML, or of the wrong shape.
    #[error("bad map YAML: {0}")]
    BadYaml(String),
    /// No JSON, or of the wrong shape.
    #[error("bad occupancy grid JSON: {0}")]
    BadJson(String),
    /// A field that has to be there.
    #[error("{field} is missing; it must be {expected}")]
    Missing {
        /// Its name.
        field: &'static str,
        /// What it should hold.
        expected: &'static str,
    },
    /// A field with a value out of its range.
    #[error("{field} is {value}; it must be {expected}")]
    BadField {
        /// Its name.
        field: &'static str,
        /// The value found.
        value: String,
        /// The limit.
        expected: String,
    },
    /// A cell of a message with a value that means nothing.
    #[error("data[{index}] is {value}; it must be {expected}")]
    BadCell {
        /// Which cell.
        index: usize,
        /// Its value.
        value: i8,
        /// The values that mean something.
        expected: &'static str,
    },
    /// Size, resolution or origin make no lattice.
    #[error(transparent)]
    Lattice(#[from] LatticeError),
}

impl CodecError {
    /// Whether the bytes might be a good map, but are too many or too large: a larger limit would let them in.
    #[must_use]
    pub fn is_over_limit(&self) -> bool {
        matches!(
            self,
            Self::TooManyBytes { .. } | Self::TooManyCells { .. } | Self::NoMemory { .. }
        )
    }

    pub(super) fn bad_field(field: &'static str, value: impl Display, expected: impl Into<String>) -> Self {
        Self::BadField {
            field,
            value: value.to_string(),
            expected: expected.into(),
        }
    }
}

/// Something that the reader followed by rule but that its author may not have meant.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Warning {
    /// The grey that map savers write for unknown lies below `free_thresh`.
    #[error(
        "{cells} cells of grey 205, the usual value for unknown, read as free because free_thresh is {free_thresh}; \
         if they mean unknown, set free_thresh to 0.196"
    )]
    UnknownReadsFree {
        /// How many.
        cells: usize,
        /// The file's threshold.
        free_thresh: f64,
    },
    /// ROS averages the alpha channel into the grey in trinary mode, which this reader does not.
    #[error(
        "{cells} opaque pixels are read by their colour alone; map_server, which averages the alpha channel into the \
         colour in trinary mode, would read them differently: save the picture without an alpha channel"
    )]
    AlphaNotAveraged {
        /// How many.
        cells: usize,
    },
}

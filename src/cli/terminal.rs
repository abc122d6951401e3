//! The only doors to standard output and standard error.

use std::io::{self, Write};

use super::Failure;

/// Prints a line for whoever asked: the result.
///
/// # Errors
/// [`Failure::NobodyListens`] when the reader has gone, which `println!` would answer with a panic.
pub fn say(line: &str) -> Result<(), Failure> {
    write_line(io::stdout().lock(), line)
}

/// Prints a line for the person at the terminal: what goes on, and what went wrong.
///
/// # Errors
/// [`Failure::NobodyListens`] when the reader has gone.
pub fn tell(line: &str) -> Result<(), Failure> {
    write_line(io::stderr().lock(), line)
}

fn write_line(mut to: impl Write, line: &str) -> Result<(), Failure> {
    match writeln!(to, "{line}").and_then(|()| to.flush()) {
        Ok(()) => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Err(Failure::NobodyListens),
        Err(error) => Err(Failure::Internal(anyhow::Error::new(error).context("cannot print"))),
    }
}

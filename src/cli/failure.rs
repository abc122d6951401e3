//! What ends a subcommand early, told once and readably.

use std::process::ExitCode;

use super::terminal;

/// Why a subcommand ended without doing its work.
#[derive(Debug)]
pub enum Failure {
    /// The caller's mistake: exit code 2.
    BadInput(anyhow::Error),
    /// Anything else: exit code 1.
    Internal(anyhow::Error),
    /// Nobody reads our output any more (`mapweld ... | head`): not worth a word.
    NobodyListens,
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Self::Internal(error)
    }
}

#[cfg(feature = "client")]
impl From<crate::client::ClientError> for Failure {
    fn from(error: crate::client::ClientError) -> Self {
        use crate::client::ClientError;
        let callers = match &error {
            ClientError::BadServer { .. } | ClientError::BadKey | ClientError::BadAuthority => true,
            ClientError::Refused { problem, .. } => problem.status < 500 && !error.is_transient(),
            _ => false,
        };
        if callers {
            Self::BadInput(error.into())
        } else {
            Self::Internal(error.into())
        }
    }
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::BadInput(error) | Self::Internal(error) => f.write_str(&chain(error)),
            Self::NobodyListens => f.write_str("nobody reads the output"),
        }
    }
}

impl Failure {
    /// A mistake of the caller that has no error below it.
    pub fn bad_input(message: impl std::fmt::Display + std::fmt::Debug + Send + Sync + 'static) -> Self {
        Self::BadInput(anyhow::Error::msg(message))
    }

    /// The same failure, with what was being done in front.
    #[must_use]
    pub fn while_doing(self, what: impl std::fmt::Display + Send + Sync + 'static) -> Self {
        match self {
            Self::BadInput(error) => Self::BadInput(error.context(what)),
            Self::Internal(error) => Self::Internal(error.context(what)),
            Self::NobodyListens => Self::NobodyListens,
        }
    }

    /// Prints the failure with all that caused it, and gives its exit code.
    #[must_use]
    pub fn report(&self) -> ExitCode {
        let code = match self {
            Self::BadInput(_) => 2,
            Self::Internal(_) => 1,
            Self::NobodyListens => return ExitCode::SUCCESS,
        };
        // Nothing is left to be done about a standard error that cannot be written.
        let _ = terminal::tell(&format!("error: {self}"));
        ExitCode::from(code)
    }
}

/// The error and its causes on one line, each said once: many errors already repeat their source in their own message.
fn chain(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain() {
        let message = cause.to_string();
        if text.is_empty() {
            text = message;
        } else if !text.ends_with(&message) {
            text.push_str(": ");
            text.push_str(&message);
        }
    }
    text
}

/// Marks an error as the caller's mistake, and says what was being done.
pub trait BadInput<T> {
    /// The value, or a [`Failure::BadInput`] that starts with `what`.
    ///
    /// # Errors
    /// When `self` is an error.
    fn bad_input<W>(self, what: impl FnOnce() -> W) -> Result<T, Failure>
    where
        W: std::fmt::Display + Send + Sync + 'static;
}

impl<T, E> BadInput<T> for Result<T, E>
where
    E: Into<anyhow::Error>,
{
    fn bad_input<W>(self, what: impl FnOnce() -> W) -> Result<T, Failure>
    where
        W: std::fmt::Display + Send + Sync + 'static,
    {
        self.map_err(|error| Failure::BadInput(error.into().context(what())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;

    #[test]
    fn every_cause_is_told_once() {
        let error = std::io::Error::other("the disk is full");
        let error = Err::<(), _>(error)
            .context("cannot write b: the disk is full")
            .context("cannot save a")
            .expect_err("made from an error");
        assert_eq!(chain(&error), "cannot save a: cannot write b: the disk is full");
    }

    #[test]
    fn a_bad_input_starts_with_what_was_being_done() {
        let parsed = "x".parse::<u8>().bad_input(|| "cannot read the number");
        let Err(Failure::BadInput(error)) = parsed else {
            panic!("x is not a number")
        };
        assert_eq!(chain(&error), "cannot read the number: invalid digit found in string");
    }
}

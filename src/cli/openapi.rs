//! `mapweld openapi`: the API's document.

use clap::Args;

use super::{Done, Failure, say};
use crate::http;

/// Print the OpenAPI 3.1 document of the HTTP API.
#[derive(Debug, Args)]
pub(super) struct OpenApi {}

impl OpenApi {
    #[expect(clippy::unused_self, reason = "every subcommand is run alike")]
    pub(super) fn run(self) -> Result<Done, Failure> {
        let document = http::openapi().to_pretty_json().map_err(anyhow::Error::from)?;
        say(&document)?;
        Ok(Done::Entirely)
    }
}

//! The service from outside: the contract of the stores, and servers that are spawned.
#![cfg(feature = "server")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests of promises about time look at the clock"
)]

mod blobs;
mod migrations;
mod postgres;
mod skipped;
mod store_contract;
mod store_postgres;
mod store_sqlite;

#[cfg(feature = "client")]
mod http;
#[cfg(feature = "client")]
mod survival;

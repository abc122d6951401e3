//! The service from outside: the contract of the stores, and servers that are spawned.
#![cfg(feature = "server")]

mod store_contract;
mod store_sqlite;

#[cfg(feature = "client")]
mod http;

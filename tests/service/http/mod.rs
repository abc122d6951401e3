//! Servers that are spawned as a process and driven over HTTP.

mod access;
mod bomb_corpus;
mod bombs;
mod command;
mod demo_command;
mod errors;
mod events;
mod integrity;
mod jobs;
mod keys_command;
mod lifecycle;
mod load;
mod measured;
mod merge_command;
mod named;
mod one_shot;
mod pages;
mod push_command;
pub(crate) mod rooms;
mod server;
mod steering;
mod tls;
mod traces;
mod upgrade;
mod upkeep;
mod uploads;
mod versions;

//! Servers that are spawned as a process and driven over HTTP.

mod errors;
mod events;
mod jobs;
mod lifecycle;
mod one_shot;
mod pages;
mod rooms;
mod server;
mod uploads;
mod versions;

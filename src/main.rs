//! The `mapweld` command.

fn main() {}

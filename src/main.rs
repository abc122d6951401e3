//! The `mapweld` command.

fn main() -> std::process::ExitCode {
    mapweld::cli::main()
}

//! The `host-sim` binary; everything is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    host_sim::cli::run()
}

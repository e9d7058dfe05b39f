//! Fuzz targets of what takes input from outside: frames, objects, serial lines, logs, files.
//!
//! A target executes any bytes and panics if an invariant does not hold. `tests/replay.rs` executes each on its seeds and
//! on a fixed number of changed ones, equal in every run. `tests/fuzz/run` searches new inputs with libFuzzer.

mod bytes;
pub mod mutation;
// Of the module that reads parameter files, whose crate takes minutes to build.
#[allow(dead_code, unfulfilled_lint_expectations)]
#[path = "../../../host-sim/tune/src/names.rs"]
mod names;
mod programs;
mod targets;
mod transfer;

/// A function that executes any input.
pub struct Target {
    /// Name, which is that of the folder of its seeds.
    pub name: &'static str,
    /// Executes an input. Panics if an invariant does not hold.
    pub run: fn(&[u8]),
    /// Longest input that is of use, bytes.
    pub longest: usize,
}

impl Target {
    /// Returns the target of this name.
    pub fn find(name: &str) -> Option<&'static Self> {
        TARGETS.iter().find(|target| target.name == name)
    }
}

/// All targets, ordered by name.
pub const TARGETS: &[Target] = &[
    Target { name: "candump", run: targets::candump::run, longest: 4096 },
    Target { name: "csv", run: targets::csv::run, longest: 4096 },
    Target { name: "driver", run: targets::driver::run, longest: 600 },
    Target { name: "dry_side", run: targets::dry_side::run, longest: 300 },
    Target { name: "package", run: targets::package::run, longest: 2500 },
    Target { name: "params", run: targets::params::run, longest: 3000 },
    Target { name: "program", run: targets::program::run, longest: 200 },
    Target { name: "program_flash", run: targets::program_flash::run, longest: 200 },
    Target { name: "record", run: targets::record::run, longest: 800 },
    Target { name: "scope", run: targets::scope::run, longest: 400 },
    Target { name: "sdo", run: targets::sdo::run, longest: 1800 },
    Target { name: "slcan", run: targets::slcan::run, longest: 600 },
];

//! Executes the target that the environment variable `FUZZ_TARGET` names, under libFuzzer.

#![no_main]

use fuzz::Target;
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static TARGET: LazyLock<&Target> = LazyLock::new(|| {
    let name = std::env::var("FUZZ_TARGET").unwrap_or_default();
    Target::find(&name).unwrap_or_else(|| panic!("FUZZ_TARGET={name}: no target"))
});

fuzz_target!(|data: &[u8]| (TARGET.run)(data));

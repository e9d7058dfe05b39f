//! Passes the linker script of cortex-m-rt and the memory map of the STM32G474 to the linker.
//!
//! A linker finds the workspace's `memory.x` first, which includes `map.x`: the map is written under both names.

use std::path::PathBuf;
use std::{env, fs};

const MAP: &str = "MEMORY { FLASH : ORIGIN = 0x08000000, LENGTH = 512K\n  RAM : ORIGIN = 0x20000000, LENGTH = 96K }\n";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    for name in ["memory.x", "map.x"] {
        fs::write(out.join(name), MAP).unwrap_or_else(|error| panic!("{name}: {error}"));
    }
    println!("cargo::rustc-link-search={}", out.display());
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=--nmagic");
}

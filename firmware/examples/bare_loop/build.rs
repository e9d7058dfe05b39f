//! Passes the linker script of cortex-m-rt and the memory map of the emulated board, mps2-an386, to the
//! linker.
//!
//! Your own board only needs a `memory.x` next to this file. The top of this workspace has its own
//! `memory.x`, which a linker finds first and which includes `map.x`, so the map is written under both
//! names.

use std::path::PathBuf;
use std::{env, fs};

const MAP: &str = "/* QEMU's mps2-an386, a Cortex-M4F. */\n\
    MEMORY { FLASH : ORIGIN = 0, LENGTH = 4M\n  RAM : ORIGIN = 0x20000000, LENGTH = 4M }\n\
    /* firmware/run recognises an image for the emulator by this symbol. */\nBOARD_QEMU = 1;\n";

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

//! Passes the linker script and the memory map of each image's board to the linker.
//!
//! A linker looks up `memory.x` in its working directory (the top of the workspace) before the search path. That file
//! includes `map.x`, so each image has a search path with the map of its board. A copy of `memory.x` serves builds from other
//! directories.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

/// Name of each image, and the folder of its board.
const IMAGES: [(&str, &str); 4] = [
    ("qemu-board", "qemu"),
    ("stm32f405-board", "stm32f405"),
    ("cost", "qemu"),
    ("footprint", "qemu"),
];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    copy(Path::new("../../memory.x"), &out.join("memory.x"));
    println!("cargo::rustc-link-search={}", out.display());
    for (image, board) in IMAGES {
        let map = Path::new("src/bin").join(board).join("memory.x");
        copy(&map, &out.join(board).join("map.x"));
        println!("cargo::rustc-link-arg-bin={image}=-L{}", out.join(board).display());
    }
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=--nmagic");
    // This script requires a logger, which the other images lack.
    if env::var_os("CARGO_FEATURE_QEMU").is_some() {
        println!("cargo::rustc-link-arg-bin=qemu-board=-Tdefmt.x");
    }
    if env::var_os("CARGO_FEATURE_C_REFERENCE").is_some() {
        build_c_reference(&out);
    }
}

fn copy(from: &Path, to: &Path) {
    println!("cargo::rerun-if-changed={}", from.display());
    let copied = to.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::copy(from, to));
    copied.unwrap_or_else(|error| panic!("{}: {error}", from.display()));
}

/// Compiles the C laws for the comparison table, with a C programmer's options for this core.
fn build_c_reference(out: &Path) {
    let (source, object) = ("../cost/reference.c", out.join("reference.o"));
    println!("cargo::rerun-if-changed={source}");
    let target = ["-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"];
    let compiler = "arm-none-eabi-gcc";
    let run = |command: &mut Command| {
        let output = command.output().unwrap_or_else(|error| {
            panic!("{compiler}: {error}; install the packages gcc-arm-none-eabi and libnewlib-arm-none-eabi")
        });
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{compiler} failed:\n{errors}");
        String::from_utf8_lossy(&output.stdout).trim().to_owned()
    };
    run(Command::new(compiler)
        .args(target)
        .args(["-O3", "-ffast-math", "-c", source, "-o"])
        .arg(&object));
    println!("cargo::rustc-link-arg-bin=cost={}", object.display());
    for library in ["libm.a", "libc.a", "libgcc.a"] {
        let path =
            run(Command::new(compiler).args(target).arg(format!("-print-file-name={library}")));
        println!("cargo::rustc-link-arg-bin=cost={path}");
    }
}

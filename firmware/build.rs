//! Hands the linker its script and the memory map of the board.
//!
//! All link arguments are here, so that nothing in the workspace says `-T` to a PC's linker.
//! cortex-m-rt's `link.x` includes `memory.x`, which a linker looks for in its working directory (the
//! top of the workspace) before the search path. So there is one `memory.x`, at the top, for both
//! boards, and a symbol chooses; the copy in `OUT_DIR` serves whoever builds from elsewhere.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=../memory.x");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let on = |feature: &str| env::var_os(format!("CARGO_FEATURE_{feature}")).is_some();
    let map =
        fs::read_to_string("../memory.x").expect("memory.x lies at the top of the repository");
    fs::write(out.join("memory.x"), map).expect("OUT_DIR is writable");
    match (on("BOARD_QEMU"), on("BOARD_STM32G474")) {
        (true, false) => println!("cargo::rustc-link-arg-bins=--defsym=BOARD_QEMU=1"),
        (false, true) => {}
        (false, false) => panic!("choose a board: feature board-stm32g474 or board-qemu"),
        (true, true) => panic!("one board an image: add --no-default-features to board-qemu"),
    }
    println!("cargo::rustc-link-search={}", out.display());
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=--nmagic");
    // The other binaries log nothing, and this script insists on a logger.
    println!("cargo::rustc-link-arg-bin=firmware=-Tdefmt.x");
    if on("C_REFERENCE") {
        build_c_reference(&out);
    }
}

/// Compiles the C laws the table is held against, as a C programmer would for this core.
fn build_c_reference(out: &Path) {
    let (source, object) = ("../tests/cost/reference.c", out.join("reference.o"));
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

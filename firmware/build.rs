//! Passes the linker script and the memory map of the board to the linker.
//!
//! All link arguments are here, so that a PC's linker never receives `-T`. cortex-m-rt's `link.x` includes
//! `memory.x`, which a linker looks up in its working directory (the top of the workspace) before the
//! search path. That file includes `board.x`. Each board has its map next to its source, in
//! `src/boards/NAME/` for the feature `board-NAME`; the selected one is copied to the search path. A copy
//! of `memory.x` there serves builds from other directories.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let on = |feature: &str| env::var_os(format!("CARGO_FEATURE_{feature}")).is_some();
    let map = format!("src/boards/{}/memory.x", board());
    println!("cargo::rerun-if-changed={map}");
    println!("cargo::rerun-if-changed=../memory.x");
    for (from, to) in [(map.as_str(), "board.x"), ("../memory.x", "memory.x")] {
        fs::copy(from, out.join(to)).unwrap_or_else(|error| panic!("{from}: {error}"));
    }
    println!("cargo::rustc-link-search={}", out.display());
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=--nmagic");
    // The other binaries log nothing, and this script requires a logger.
    if on("DEFMT") {
        println!("cargo::rustc-link-arg-bin=firmware=-Tdefmt.x");
    }
    if on("C_REFERENCE") {
        build_c_reference(&out);
    }
}

/// Returns the board that the features select.
fn board() -> String {
    let chosen = env::vars().filter_map(|(name, _)| {
        name.strip_prefix("CARGO_FEATURE_BOARD_").map(str::to_ascii_lowercase)
    });
    match chosen.collect::<Vec<_>>().as_slice() {
        [board] => board.clone(),
        [] => panic!("no board selected: enable feature board-stm32g474 or another board"),
        _ => panic!("several boards selected: add --no-default-features to select another one"),
    }
}

/// Compiles the C laws for the comparison table, with a C programmer's options for this core.
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

//! Passes the linker script and the memory map of the board to the linker.
//!
//! All link arguments are here, so that a PC's linker never receives `-T`. cortex-m-rt's `link.x` includes
//! `memory.x`, which a linker looks up in its working directory (the top of the workspace) before the
//! search path. That file includes `map.x`. Each board has its map next to its source, in
//! `src/boards/NAME/` for the feature `board-NAME`; the selected one is copied to the search path of the
//! images, and `boot.x` of the board to that of its boot program. An image of the STM32G474 also includes the
//! map of its slot; there is one image for each. A copy of `memory.x` there serves builds from other directories.

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
    let board = board();
    let sources = Path::new("src/boards").join(&board);
    for (from, to) in [
        (Path::new("../memory.x").to_owned(), "memory.x"),
        (sources.join("memory.x"), "slot_a/map.x"),
        (sources.join("slot_a.x"), "slot_a/slot.x"),
        (sources.join("memory.x"), "slot_b/map.x"),
        (sources.join("slot_b.x"), "slot_b/slot.x"),
        (sources.join("boot.x"), "boot/map.x"),
    ] {
        copy(&from, &out.join(to));
    }
    // The boot program has another map, so the search paths differ by binary.
    for (binary, map) in [
        ("firmware", "slot_a"),
        ("firmware-b", "slot_b"),
        ("boot", "boot"),
        ("cost", "slot_a"),
        ("footprint", "slot_a"),
    ] {
        println!("cargo::rustc-link-arg-bin={binary}=-L{}", out.join(map).display());
    }
    write_update_key(&out);
    println!("cargo::rustc-link-search={}", out.display());
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=--nmagic");
    // The other binaries log nothing, and this script requires a logger.
    if on("DEFMT") {
        println!("cargo::rustc-link-arg-bin=firmware=-Tdefmt.x");
        println!("cargo::rustc-link-arg-bin=firmware-b=-Tdefmt.x");
    }
    if on("C_REFERENCE") {
        build_c_reference(&out);
    }
}

/// Copies a map, if the board has it.
fn copy(from: &Path, to: &Path) {
    let Some(folder) = to.parent().filter(|_| from.exists()) else { return };
    println!("cargo::rerun-if-changed={}", from.display());
    fs::create_dir_all(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    fs::copy(from, to).unwrap_or_else(|error| panic!("{}: {error}", from.display()));
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

/// Writes the public key whose updates the image accepts: the file in `JOINT_UPDATE_KEY`, or the published test key.
fn write_update_key(out: &Path) {
    println!("cargo::rerun-if-env-changed=JOINT_UPDATE_KEY");
    let path = env::var("JOINT_UPDATE_KEY").unwrap_or_else(|_| "keys/test.pub".to_owned());
    println!("cargo::rerun-if-changed={path}");
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let digits = text.trim().strip_prefix("ed25519-public ").unwrap_or_default();
    let key: Vec<u8> = (0..digits.len() / 2)
        .filter_map(|at| u8::from_str_radix(digits.get(2 * at..2 * at + 2)?, 16).ok())
        .collect();
    assert!(
        key.len() == 32 && digits.len() == 64,
        "{path}: no public key of host-sim sign --new-key"
    );
    fs::write(out.join("update_key.rs"), format!("{key:?}")).expect("OUT_DIR can be written");
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

//! Passes the linker script and the memory map of the board to the linker.
//!
//! All link arguments are here, so that a PC's linker never receives `-T`. cortex-m-rt's `link.x` includes
//! `memory.x`, which a linker looks up in its working directory (the top of the workspace) before the
//! search path. That file includes `map.x`. The board has its map next to its source; it is copied to the search
//! path of the images, and `boot.x` of the board to that of its boot program. An image also includes the map of
//! its slot; there is one image for each. A copy of `memory.x` there serves builds from other directories.
//! Without the board's feature, only the library is built, for another board, which has its own maps.
//!
//! For a PC, it collects the texts of refusals.

#[path = "build/texts.rs"]
mod texts;

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(wiring, values(any()))");
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        texts::write(&["src", "../compensator-core/src"].map(PathBuf::from), &out);
        return;
    }
    if env::var_os("CARGO_FEATURE_BOARD_STM32G474").is_some() {
        select_wiring();
        link_stm32g474(&out);
    } else if env::var_os("CARGO_FEATURE_BOARD_B_G431B_ESC1").is_some() {
        copy(Path::new("../memory.x"), &out.join("memory.x"));
        copy(Path::new("src/boards/b_g431b_esc1/memory.x"), &out.join("map.x"));
        pass_common_arguments(&out);
        println!("cargo::rustc-link-arg-bin=firmware-esc1=-Tdefmt.x");
    }
}

/// Sets `wiring` to the NAME of the feature `wiring-NAME`, or to `standard`. Two of them, or one that pins.rs does not know, end
/// the build: otherwise the image would be that of another board.
fn select_wiring() {
    const PREFIX: &str = "CARGO_FEATURE_WIRING_";
    const PINS: &str = "src/boards/stm32g474/pins.rs";
    let names = env::vars_os().filter_map(|(name, _)| name.into_string().ok());
    let names: Vec<_> =
        names.filter_map(|name| name.strip_prefix(PREFIX).map(str::to_lowercase)).collect();
    let wiring = match &names[..] {
        [] => "standard",
        [name] => name,
        _ => panic!("features: one wiring at most, found {}", names.join(", ")),
    };
    let pins = fs::read_to_string(PINS).unwrap_or_else(|error| panic!("{PINS}: {error}"));
    if !pins.contains(&format!("wiring = \"{wiring}\"")) {
        panic!("features: wiring-{wiring} has no line in {PINS}");
    }
    println!("cargo::rerun-if-changed={PINS}");
    println!("cargo::rustc-cfg=wiring=\"{wiring}\"");
}

/// Passes the scripts for both slots and the boot program of the STM32G474 board.
fn link_stm32g474(out: &Path) {
    let sources = Path::new("src/boards/stm32g474");
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
    for (binary, map) in [("firmware", "slot_a"), ("firmware-b", "slot_b"), ("boot", "boot")] {
        println!("cargo::rustc-link-arg-bin={binary}=-L{}", out.join(map).display());
    }
    write_update_key(out);
    pass_common_arguments(out);
    // The boot program logs nothing, and this script requires a logger.
    println!("cargo::rustc-link-arg-bin=firmware=-Tdefmt.x");
    println!("cargo::rustc-link-arg-bin=firmware-b=-Tdefmt.x");
}

fn pass_common_arguments(out: &Path) {
    println!("cargo::rustc-link-search={}", out.display());
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=--nmagic");
}

fn copy(from: &Path, to: &Path) {
    println!("cargo::rerun-if-changed={}", from.display());
    let copied = to.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::copy(from, to));
    copied.unwrap_or_else(|error| panic!("{}: {error}", from.display()));
}

/// Writes the public key whose updates the boot program accepts: the file in `JOINT_UPDATE_KEY`, or with `test` the
/// published test key. Without it the boot program does not compile; an image needs no key.
fn write_update_key(out: &Path) {
    println!("cargo::rerun-if-env-changed=JOINT_UPDATE_KEY");
    let written = match env::var("JOINT_UPDATE_KEY") {
        Ok(key) => read_update_key(if key == "test" { "keys/test.pub" } else { &key }),
        Err(_) => "compile_error!(\"JOINT_UPDATE_KEY: expected a public key of host-sim sign --new-key, or \\
            test for a board on a bench, whose updates anyone can sign\")"
            .to_owned(),
    };
    fs::write(out.join("update_key.rs"), written).expect("OUT_DIR can be written");
}

/// Reads a public key as the expression of its bytes.
fn read_update_key(path: &str) -> String {
    println!("cargo::rerun-if-changed={path}");
    let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let digits = text.trim().strip_prefix("ed25519-public ").unwrap_or_default();
    let is_key = digits.len() == 64 && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    assert!(is_key, "{path}: expected a public key of host-sim sign --new-key");
    let bytes: String = (0..32).map(|at| format!("0x{},", &digits[2 * at..2 * at + 2])).collect();
    format!("[{bytes}]")
}

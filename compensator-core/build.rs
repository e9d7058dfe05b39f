//! Tells the build of a crate that prints refusals where the sources of this version are: it collects their texts.

use std::env;
use std::path::PathBuf;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let package = env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR");
    println!("cargo::metadata=sources={}", PathBuf::from(package).join("src").display());
}

//! Linker arguments of the WebAssembly module.

/// Stack of the module, bytes: that of a main thread on Linux, as `work::run` gives its threads. The default is 1 MiB.
const STACK_BYTES: usize = 8 << 20;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_FAMILY").is_ok_and(|family| family == "wasm") {
        println!("cargo:rustc-link-arg-cdylib=-zstack-size={STACK_BYTES}");
    }
}

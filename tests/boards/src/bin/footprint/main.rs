//! Images that differ only by the core: the difference of their sizes is the core's flash.
//!
//! Without a feature it is the reference image, which passes words from a source to a sink. Feature
//! `footprint-loop` adds what runs in the current loop: step and sum of a compensator that already exists
//! in memory. `footprint-core` adds the rest: parsing a record, validating and building. All inputs come
//! from, and all outputs go to, places that the compiler cannot see. So nothing is computed at build time
//! and nothing is removed.
//!
//! Code that all images need (start-up, panic) cancels in the difference. Code that only the core needs
//! (soft-float `f64` for validation, `libm` for terms) counts as the core's. `tests/cost/run` builds the
//! images and subtracts their sizes.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
mod image;

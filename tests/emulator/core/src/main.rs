//! The image: it answers the requests in its mailbox, which the emulator writes and reads.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
mod mailbox;

//! Published experiments made anew: each paper's short form runs, and says what it is to say.
//!
//! What a paper's numbers have to be is in a file of its own beside this one.
#![cfg(feature = "cli")]

mod damper;
mod manipulator;
mod underwater_joint;

use host_sim::papers::{Outcome, PAPERS, Request};
use std::path::PathBuf;

/// The short form of a paper, on the measured logs beside the checkout where they are.
pub fn quick(name: &str) -> Outcome {
    at(name, concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data").into())
}

/// The same on measured logs at another place.
pub fn at(name: &str, data: PathBuf) -> Outcome {
    let paper = PAPERS.iter().find(|paper| paper.name() == name).expect("a paper of that name");
    let progress = |_: &str| {};
    paper.run(&Request { quick: true, seed: 0, data, progress: &progress }).expect("its short form")
}

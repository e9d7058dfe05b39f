//! Published experiments made anew: each paper's short form runs, and says what it is to say.
//!
//! What a paper's numbers have to be is in a file of its own beside this one.
#![cfg(feature = "cli")]

mod manipulator;
mod underwater_joint;

use host_sim::papers::{Outcome, PAPERS, Request};

/// The short form of a paper, on the measured logs beside the checkout where they are.
pub fn quick(name: &str) -> Outcome {
    let paper = PAPERS.iter().find(|paper| paper.name() == name).expect("a paper of that name");
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data").into();
    let progress = |_: &str| {};
    paper.run(&Request { quick: true, seed: 0, data, progress: &progress }).expect("its short form")
}

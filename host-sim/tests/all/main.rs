//! The tests of `host-sim` in one binary, because linking twenty takes longer than the tests of some of them.
//!
//! `cargo test -p host-sim --test all X::` runs the tests of the file `X.rs`.

mod browser;
mod command_line;
mod compare_page;
mod diagnosis_page;
mod drawn_chart;
mod driver_on_a_bus;
mod export;
mod fleet;
mod friction_run;
mod help;
mod left_out_formats;
mod lugre_lstm;
mod measured_adaptation;
mod missing_feature;
mod missing_features;
mod monitor;
mod papers;
mod picture;
mod pool_tests;
mod predict;
mod predict_adapted;
mod progress;
mod replay;
mod replay_adaptation;
mod report_browser;
mod report_page;
mod report_thin;
mod scenarios;
mod scope;
#[path = "../../../tests/seal_equation.rs"]
mod seal_equation;
mod several_joints;
#[path = "../../../tests/snapshot.rs"]
mod snapshot;
mod stochastic;
mod tune;
mod tune_from;
mod tune_page;

use friction_diagnose::prepare::Prepared;
use friction_fit::{Loss, tracks};
use joint_log::{Dataset, SplitRule, split};
use simulated_machines::friction::Seal;

/// Returns a log that is split, without a check. Its files have a hash that pages show.
pub fn unchecked(data: Dataset, rule: &SplitRule) -> Prepared {
    let split = split(&data, rule, 0).unwrap();
    Prepared {
        joint: None,
        train: tracks(&data.select(&split.train)),
        test: tracks(&data.select(&split.test)),
        split,
        hashes: vec!["5e1f".to_owned(); data.files.len()],
        data,
        log_findings: Vec::new(),
        overview: Vec::new(),
        rigid_body: Vec::new(),
        columns: Vec::new(),
        skip: 0,
        decimate: 1,
        is_motion_logged: false,
        loss: Loss::Squares,
        seed: 0,
    }
}

/// Returns true if the tests run in their long form.
pub fn is_long() -> bool {
    std::env::var_os("LONG_TESTS").is_some()
}

/// Returns true if a test that belongs to the long form only must not run, and reports that it is skipped.
pub fn is_left_out(what: &str) -> bool {
    let left_out = !is_long();
    if left_out {
        println!("skipped: {what}: tests/run --all");
    }
    left_out
}

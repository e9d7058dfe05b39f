//! The tests of `friction-diagnose` in one binary, because linking each takes longer than most of the tests.
//!
//! `cargo test -p friction-diagnose --test all X::` runs the tests of the file `X.rs`.

mod awkward_machines;
mod cancellation;
mod log_check;
mod measured_diagnosis;
#[path = "../../../../tests/message.rs"]
mod message;
#[path = "../../../../tests/snapshot.rs"]
mod snapshot;
mod tables;

/// Returns the candidates of a diagnosis with their probabilities.
pub fn candidates(found: &friction_diagnose::Diagnosis) -> String {
    let describe = |candidate: &friction_diagnose::WeighedCause| {
        format!(
            "{} ({}) {:.2}",
            candidate.cause.name(),
            candidate.columns().join(", "),
            candidate.probability
        )
    };
    found.candidates.iter().map(describe).collect::<Vec<_>>().join("; ")
}

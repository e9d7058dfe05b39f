//! A contest of hypotheses: whole models compete for what a joint's torque follows.
//!
//! A hypothesis is a correction of the log, a base law and a set of causes. All are linear in their coefficients, so their
//! held-out errors follow from products of columns that are computed once ([`bank`]), and some ten thousand hypotheses are
//! compared on the same rows, weights and folds ([`rows`]) in about a second. No stage decides before another one.
//!
//! ```text
//! Dataset -> Rows -> Shapes, Law       base laws as columns                        rows, covariate, law, weights
//!         -> Variant                   causes as columns, a table                  cause
//!         -> Bank                      products for each correction and law        correction, bank, solve
//!         -> Search -> Ledger          beam with add, drop and swap                search, ledger
//!         -> Draws -> Outcome          inclusion, materiality, what stands in      draws, outcome
//! ```

pub mod bank;
pub mod cause;
pub mod correction;
pub mod covariate;
pub mod draws;
mod entry;
pub mod kernel;
pub mod law;
pub mod ledger;
pub mod linear;
pub mod outcome;
pub mod rows;
pub mod run;
pub mod search;
pub mod solve;
pub mod weights;

pub use law::LawStart;
pub use linear::LinearAnswer;
pub use outcome::{Figures, Finalist, FinalistCause, Outcome};
pub use rows::{RigidBody, Rows};
pub use run::contest;

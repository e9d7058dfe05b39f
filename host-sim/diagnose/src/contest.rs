//! A contest of hypotheses: whole models compete for what a joint's torque follows.
//!
//! A hypothesis is a correction of the log, a base law and a set of causes. All are linear in their coefficients, so their
//! held-out errors follow from products of columns that are computed once (`bank`), and some ten thousand hypotheses are
//! compared on the same rows, weights and folds (`rows`) in about a second. No stage decides before another one.
//!
//! ```text
//! Dataset -> Rows -> Shapes, Law       base laws as columns                        rows, covariate, law, weights
//!         -> Variant                   causes as columns, a table                  cause
//!         -> Bank                      products for each correction and law        correction, bank, solve
//!         -> Search -> Ledger          beam with add, drop and swap                search, ledger
//!         -> Draws -> Outcome          inclusion, materiality, what stands in      draws, outcome
//! ```

mod bank;
mod cause;
mod cause_key;
mod correction;
mod covariate;
mod detail;
mod draws;
mod entry;
mod finalists;
mod kernel;
mod law;
mod ledger;
mod linear;
mod orders;
mod outcome;
mod rows;
mod run;
mod search;
mod solve;
mod table;
mod weights;

pub(crate) use cause::acts_through_bristles;
pub use cause_key::CauseKey;
pub use correction::Correction;
pub use detail::{Detail, Gap, SimulatedGap, WaveKind};
pub(crate) use draws::DRAWS;
pub(crate) use finalists::share_taken;
pub use finalists::{Finalist, FinalistCause};
pub use law::LawStart;
pub(crate) use law::SMALLEST_LEVEL;
pub use linear::LinearAnswer;
pub(crate) use linear::plain;
pub(crate) use orders::MOST_FREE_ORDERS;
pub use outcome::{Figures, Outcome};
pub use rows::{RigidBody, Rows};
pub use run::contest;

//! Limits of the search that several files share.
//!
//! They decide which fits are made and which causes count as confounded. What rejects a cause is in [`super::rules`], and
//! what weighs the evidence for it in [`super::calibration`].

/// A fit that takes part in the choice must promise this share of the best one's fall. One whose column at size 0
/// says too little (see [`super::cause::Cause::is_nonlinear`]) gets in with a quarter of it.
pub const SHORTLISTED: f64 = 0.5;

/// Two causes that explain this share of each other's effect are confounded, unless one is better by [`BETTER`] standard
/// errors.
pub const ALIKE: f64 = 0.8;

/// See [`ALIKE`].
pub const BETTER: f64 = 3.0;

/// An error on unseen rows of so many times the floor, that hangs together from row to row, is structure: what is
/// left over is then `unknown`, not `none`. No joint is the law it is fitted with; a fifth above the floor is the error the
/// bench itself calls as good as can be.
pub const STRUCTURE: f64 = 1.2;

/// What is left over and follows no column is `unknown` where it is more than this share of the torque's standard
/// deviation: a hundredth of its variance. Below it the law has all there is to have, and says in the report how far above
/// the floor it ends. On drawn worlds with nothing hidden whose error lies 1.4 to 22 floors up, it lies at 0.004, 0.017, 0.022,
/// 0.033, 0.15 and 0.25; on measured machines without a known cause at 0.3 to 0.8.
pub const NEGLIGIBLE: f64 = 0.1;

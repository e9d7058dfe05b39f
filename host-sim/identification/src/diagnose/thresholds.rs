//! Every number that decides in a diagnosis, and why it is what it is.
//!
//! All of them are on one scale, the fall of the squared error on unseen rows ([`super::error_reduction`]). What halving and
//! doubling costs on drawn worlds has been measured where it says so.

/// Probability, all alternatives paid for, below which a fall is no chance. One false cause in two hundred
/// clean logs, before the other rules.
pub const CHANCE: f64 = 0.005;

/// Share of the squared error beyond the floor that a cause must take: a log of a real machine is long enough to
/// make a negligible effect significant.
pub const MATERIAL: f64 = 0.03;

/// Share a cause must take whose shape a wrong law's error has as well ([`super::cause::Cause::is_confounded_with_model_error`]), where all of the
/// squared error lies beyond the floor; less, the less of it does ([`super::round::material`]). The joint's own law is
/// never quite the base law, and what that leaves repeats itself at each reversal: no number of rows makes it chance. Of fifty drawn worlds half as much leaves
/// every verdict as it is, twice as much takes one that was right.
pub const CONFOUNDED_MATERIAL: f64 = 0.12;

/// A cause must extrapolate to runs left out by so many standard errors over the runs.
pub const EXTRAPOLATES: f64 = 1.0;

/// A fit that takes part in the choice must promise this share of the best one's fall. One whose column at size 0
/// says too little (see [`super::cause::Cause::is_nonlinear`]) gets in with a quarter of it.
pub const SHORTLISTED: f64 = 0.5;

/// What a curve of any shape must add to named causes that are in, as a share of what they explain: the
/// last bend of their own effect is not another one.
pub const ANY_SHAPE: f64 = 0.2;

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

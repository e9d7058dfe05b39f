//! Where one step of the core in a row does as well as many.
//!
//! Bristles that slide hold the level `g`, and a step of backward Euler at the log's own period leaves them
//! there; at rest nothing moves. Steps finer than the log matter where the bristles are on their way: at
//! reversals and breakaways, and in presliding. With `D = g sgn v - y` the way still to go and
//! `l = sigma0 |v| dt / g` the travel of a row in units of the bristles' own, a plain step does
//!
//! ```text
//! y -> y + D l / (1 + l)     instead of     y + D (1 - exp(-l))
//! ```
//!
//! with an error of at most `D l / 2`, `D / l` and `D`, summed over the rows until it is forgotten. A pilot,
//! the model in plain numbers at one step a row, tells what it did in the row, `D l / (1 + l)`, and so `D`.
//! Where the velocity changes sign, `D` is all of the level. Bristle damping turns an error of `y` into one
//! of the torque, larger by `1 + sigma1 / (sigma0 dt)`. Where the estimate is above [`TOLERANCE`] of the level
//! the row is stepped finely; in between there is a mixture of both, so that the torque stays a smooth
//! function of the parameters and an optimiser finds no steps.

use super::stepper::{Stepper, Varying};
use super::track::Track;
use compensator_core::{ParameterId as Id, Parameters, Real, Sample, TermKind};

/// Error of a row, as a share of the level, up to which it takes one step; from twice this on it is stepped
/// finely. A tenth of this is what noise of a hundredth of the level leaves of a mean over 10^4 rows.
const TOLERANCE: f64 = 1e-4;

/// Travels of the contact after which its age is that of sliding: `exp(-7)` is a thousandth.
const RENEWALS: f64 = 7.0;

/// All fields are written for plain numbers.
static VARYING: Varying = Varying::ALL;

/// The model in plain numbers, ahead of the others.
pub struct Pilot<'a> {
    /// `None` of a law without bristles, where one step always does.
    stepper: Option<Stepper<'a, f64>>,
    coulomb: f64,
    /// `sigma0 dt`, Nm s/rad, and `sigma1` over it, for the track's own period.
    stiffness_step: f64,
    damping: f64,
    period_s: f64,
    /// Travel after a reversal within which something else than the bristles is on its way (play, the age
    /// of the contact), and the travel since the last one.
    settling: f64,
    travel: f64,
}

impl Pilot<'_> {
    /// A pilot at the start of a track, where the bristles hold `held`, Nm, or slide.
    pub fn new<T: Real>(parameters: &Parameters<T>, track: &Track, held: Option<T>) -> Self {
        let parameters = parameters.convert::<f64>();
        let has = |term| parameters.terms.contains(&term);
        let travel = |term, id, times| if has(term) { times * parameters.get(id) } else { 0.0 };
        let play = travel(TermKind::Backlash, Id::BacklashTravel, 1.0);
        let renewal = travel(TermKind::DwellTimeStatic, Id::DwellTravel, RENEWALS);
        let stiffness_step = parameters.get(Id::BristleStiffness) * track.period_s;
        let bristles = parameters.law.has_bristles();
        let held = held.map(Real::value);
        Self {
            stepper: bristles.then(|| Stepper::new(&parameters, track, &VARYING, held, 1)),
            coulomb: parameters.get(Id::CoulombTorque).abs(),
            stiffness_step,
            damping: parameters.get(Id::BristleDamping) / stiffness_step,
            period_s: track.period_s,
            settling: play.max(renewal),
            travel: f64::INFINITY,
        }
    }

    /// Steps a row, and says how much of it is to be taken from a fine simulation, 0 to 1.
    pub fn share_of_fine<T: Real>(
        &mut self,
        before: &Sample<f64>,
        sample: &Sample<f64>,
        delayed: Option<[T; 2]>,
        ratio: f64,
    ) -> f64 {
        let Some(stepper) = &mut self.stepper else { return 0.0 };
        let delayed = delayed.map(|velocities| velocities.map(Real::value));
        let [from, to] = delayed.unwrap_or([before.velocity_rad_s, sample.velocity_rad_s]);
        let held = stepper.state.bristle_torque_nm;
        stepper.row(before, sample, delayed, ratio);
        let change = (stepper.state.bristle_torque_nm - held).abs();
        let level = stepper.state.bristle_torque_nm.abs().max(held.abs()).max(self.coulomb);

        let reverses = from * to <= 0.0;
        let moves = from != 0.0 || to != 0.0;
        let travel = self.period_s * ratio * to.abs();
        self.travel = if reverses && moves { travel } else { self.travel + travel };
        if moves && self.travel < self.settling {
            return 1.0;
        }
        let stiffness_step = self.stiffness_step * ratio;
        let way = |velocity: f64| stiffness_step * velocity.abs() / level;
        let (longer, shorter) = (way(from).max(way(to)), way(from).min(way(to)));
        let to_go = if reverses { 2.0 } else { (change / level * (1.0 + 1.0 / way(to))).min(2.0) };
        let shape = (0.5 * longer).min(1.0 / shorter).min(1.0);
        let error = to_go * shape * (1.0 + self.damping / ratio);
        // Also where the error is not a number.
        if !(error < 2.0 * TOLERANCE) {
            return 1.0;
        }
        let over = (error / TOLERANCE - 1.0).max(0.0);
        over * over * (3.0 - 2.0 * over)
    }
}

//! Where one step of the core in a row does as well as many.
//!
//! Bristles that slide hold the level `g`, and a step of backward Euler at the log's own period leaves them
//! there; at rest nothing moves. Steps finer than the log matter where the bristles are on their way: at
//! reversals and breakaways, and in presliding. With `d = g sgn v - y` the way still to go, `G` the change of
//! `g sgn v` within the row, and `l = sigma0 |v| dt / g` its travel in units of the bristles' own,
//!
//! ```text
//! d -> (d + G) / (1 + l)     instead of     d exp(-l) + G (1 - exp(-l)) / l
//! ```
//!
//! is left after a plain step: an error of `a (d - G/l)` with `a = 1 / (1 + l) - exp(-l)`, none for bristles
//! that follow a ramp. It is forgotten by `1 / (1 + l)` in each row. A pilot, the model in plain numbers at one
//! step a row, tells what it did, `(d + G) l / (1 + l)`, and so `d` and `G`. Where the velocity changes sign, `d`
//! is all of the level. Bristle damping turns an error of `y` into one of the torque, larger by
//! `1 + sigma1 / (sigma0 dt)`. Where the estimate is above [`TOLERANCE`] of the level the row is stepped
//! finely; in between there is a mixture of both, so that the torque stays a smooth function of the
//! parameters and an optimiser finds no steps.

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
    /// The way to go after the last row, and the change of the level in it, as shares of the level, positive
    /// towards motion.
    to_go: f64,
    change: f64,
    /// Error of the plain steps since the last fine one, likewise.
    error: f64,
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
            to_go: 0.0,
            change: 0.0,
            error: 0.0,
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
        let now = stepper.state.bristle_torque_nm;
        if from == 0.0 && to == 0.0 {
            return 0.0;
        }
        let level = now.abs().max(held.abs()).max(self.coulomb);
        let reverses = from * to <= 0.0;
        let travel = self.period_s * ratio * to.abs();
        self.travel = if reverses { travel } else { self.travel + travel };

        let way = |velocity: f64| self.stiffness_step * ratio * velocity.abs() / level;
        let [first, last] = [from, to].map(way);
        // What the pilot had to go in this row, all in all.
        let bent = (now - held) / level * 1f64.copysign(to);
        let before = if last > 0.0 { (bent * (1.0 + 1.0 / last)).clamp(-2.0, 2.0) } else { 0.0 };
        let (to_go, change) = if reverses { (2.0, 0.0) } else { (self.to_go, before - self.to_go) };
        let mean = 0.5 * (first + last);
        let faded = (-mean).exp();
        let wrong = 1.0 / (1.0 + last) - faded;
        // Of a ramp; and by how much its slope changes within the row.
        let along = if mean > 1e-3 { (1.0 - faded) / mean } else { 1.0 - 0.5 * mean };
        let bend = 0.5 * (change - self.change) * mean.min(1.0) / (1.0 + last);
        let row = to_go * wrong + change * (1.0 / (1.0 + last) - along);
        let error = self.error / (1.0 + last) + row;
        // The way still to go errs in the rows to come as well.
        let coming = to_go * wrong / mean.min(1.0);
        (self.to_go, self.change) = (before / (1.0 + last), if reverses { 0.0 } else { change });
        let most = error.abs().max(coming.abs()) + bend.abs();
        let share = self.share(most * (1.0 + self.damping / ratio));
        self.error = if share < 1.0 { error * (1.0 - share) } else { 0.0 };
        share
    }

    /// How much of a row with this error, as a share of the level, is to be taken from a fine simulation.
    fn share(&self, error: f64) -> f64 {
        if self.travel < self.settling {
            return 1.0;
        }
        if error >= 2.0 * TOLERANCE || error.is_nan() {
            return 1.0;
        }
        let over = (error / TOLERANCE - 1.0).max(0.0);
        over * over * (3.0 - 2.0 * over)
    }
}

#[cfg(test)]
mod tests {
    use super::super::simulate::{Resolution, simulate};
    use super::*;
    use crate::dual::Dual;
    use compensator_core::LawKind;

    const ROWS: usize = 4000;
    const COULOMB: f64 = 1.5;

    /// To and fro, now and then at rest, under a load that swings.
    fn track() -> Track {
        let at = |row: usize| row as f64 * 5e-3;
        let sample = |row| {
            let rests = (row / 500) % 3 == 2;
            let velocity_rad_s = if rests { 0.0 } else { 0.4 * (2.5 * at(row)).sin() };
            let load_torque_nm = 3.0 * (0.9 * at(row)).cos();
            Sample { velocity_rad_s, load_torque_nm, ..Sample::default() }
        };
        Track::even((0..ROWS).map(sample).collect(), vec![0.0; ROWS], 5e-3)
    }

    fn joint(stiffness: f64, damping: f64) -> Parameters<f64> {
        let mut joint = Parameters::<f64>::new(LawKind::Lugre)
            .with(Id::CoulombTorque, COULOMB)
            .with(Id::StaticTorque, 2.0)
            .with(Id::StribeckVelocity, 0.05)
            .with(Id::BristleStiffness, stiffness)
            .with(Id::BristleDamping, damping)
            .with(Id::ViscousFriction, 0.3);
        assert!(joint.add_term(TermKind::LoadTorqueCoulomb));
        joint.set(Id::LoadCoulomb, 0.1);
        joint
    }

    /// Stiffness, Nm/rad; damping, Nm s/rad; rows that take one step at least. The soft joint is in presliding
    /// wherever it moves.
    const JOINTS: [(f64, f64, usize); 3] =
        [(60.0, 0.2, ROWS / 4), (600.0, 1.0, ROWS / 3), (2e4, 20.0, ROWS / 2)];

    fn torques<T: Real<Setting = T>>(joint: &Parameters<T>, resolution: Resolution) -> Vec<T> {
        let mut torques = Vec::new();
        simulate(joint, &track(), Some(T::zero()), resolution, |_, torque, _| {
            torques.push(torque);
            true
        });
        torques
    }

    #[test]
    fn rows_of_one_step_are_as_right_as_those_of_many() {
        for (stiffness, damping, least) in JOINTS {
            let joint = joint(stiffness, damping);
            let track = track();
            let mut pilot = Pilot::new(&joint, &track, Some(0.0));
            let shares = (1..ROWS).map(|row| {
                let [before, now] = [row - 1, row].map(|row| &track.samples[row]);
                pilot.share_of_fine::<f64>(before, now, None, 1.0)
            });
            let single = shares.filter(|share| *share == 0.0).count();
            assert!(single > least, "{stiffness}: {single} of {ROWS} rows in one step");

            let found = torques(&joint, Resolution { substeps: 32, extrapolated: true });
            let [first, second] = [64, 128]
                .map(|substeps| torques(&joint, Resolution { substeps, extrapolated: false }));
            for (row, found) in found.iter().enumerate() {
                let right = 2.0 * second[row] - first[row];
                let apart = (found - right).abs();
                assert!(apart < 5e-4 * COULOMB, "{stiffness} at {row}: {found} {right}");
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_many_steps() {
        let ids =
            [Id::CoulombTorque, Id::BristleStiffness, Id::BristleDamping, Id::StribeckVelocity];
        for (stiffness, damping, _) in JOINTS {
            let joint = joint(stiffness, damping);
            let mut dual = joint.convert::<Dual<4>>();
            for (index, id) in ids.iter().enumerate() {
                dual.set(*id, Dual::parameter(joint.get(*id), index));
            }
            let found = torques(&dual, Resolution { substeps: 32, extrapolated: true });
            let right = torques(&dual, Resolution { substeps: 128, extrapolated: false });
            for (index, id) in ids.iter().enumerate() {
                let squares = |of: &dyn Fn(usize) -> f64| -> f64 {
                    (0..ROWS).map(|row| of(row).powi(2)).sum::<f64>().sqrt()
                };
                let all = squares(&|row| right[row].gradient[index]);
                let apart = squares(&|row| right[row].gradient[index] - found[row].gradient[index]);
                assert!(apart < 0.02 * all, "{stiffness} {}: {apart} of {all}", id.name());
            }
        }
    }
}

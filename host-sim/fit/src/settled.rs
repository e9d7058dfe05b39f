//! Choice of the step size in each row: where one step of the core per row is accurate enough.
//!
//! Sliding bristles stay at the level `g`, and a backward Euler step at the log's own period keeps them there. At rest
//! nothing moves. Finer steps matter while the bristles move: at reversals and breakaways, and in presliding. Let
//! `d = g sgn v - y` be the remaining distance, `G` the change of `g sgn v` within the row, and
//! `l = sigma0 |v| dt / g` the row's travel in units of the bristles' own. A plain step gives
//!
//! ```text
//! d -> (d + G) / (1 + l)     instead of     d exp(-l) + G (1 - exp(-l)) / l
//! ```
//!
//! Its error is `a (d - G/l)` with `a = 1 / (1 + l) - exp(-l)`, which is 0 for bristles that follow a ramp. The error
//! decays by `1 / (1 + l)` in each row. A pilot, the model in `f64` with one step per row, provides
//! `(d + G) l / (1 + l)`, and thereby `d` and `G`. When the velocity changes sign, `d` is the whole level. Bristle
//! damping turns an error of `y` into an error of the torque, larger by `1 + sigma1 / (sigma0 dt)`. Where the estimate
//! exceeds [`TOLERANCE`] of the level, the row is stepped finely. In a transition range both results are mixed, so
//! that the torque is a smooth function of the parameters.

use super::stepper::{Stepper, TrackRow, Varying};
use super::track::Track;
use compensator_core::{ParameterId as Id, Parameters, Real, TermKind};

/// Error of a row up to which it takes one step, as a share of the level; from twice this value it is stepped
/// finely. Noise of 1 % of the level leaves ten times this error in a mean over 10^4 rows.
const TOLERANCE: f64 = 1e-4;

/// Travel after which the contact's age is that of sliding, in dwell travels: `exp(-7)` is a thousandth.
const RENEWAL_TRAVELS: f64 = 7.0;

/// The model in `f64` with one step per row; its state decides the step size of the other simulations.
pub struct Pilot {
    /// `None` for a law without bristles, where one step is always enough.
    stepper: Option<Stepper<f64>>,
    coulomb: f64,
    /// `sigma0 dt`, Nm s/rad, for the track's own period.
    stiffness_step: f64,
    /// `sigma1 / (sigma0 dt)`.
    damping: f64,
    period_s: f64,
    /// Travel after a reversal within which backlash or the age of the contact still changes, rad.
    settling: f64,
    /// Travel since the last reversal, rad.
    travel: f64,
    /// Remaining distance after the last row, as a share of the level, positive in the direction of motion.
    remaining: f64,
    /// Change of the level within the last row, as a share of the level, positive in the direction of motion.
    change: f64,
    /// Error of the plain steps since the last fine one, as a share of the level.
    error: f64,
}

impl Pilot {
    /// Places a pilot at the start of a track, where the bristles hold `held`, Nm, or slide if it is `None`.
    pub fn new<T: Real>(parameters: &Parameters<T>, track: &Track, held: Option<T>) -> Self {
        let parameters = parameters.convert::<f64>();
        let has = |term| parameters.terms.contains(&term);
        let travel = |term, id, times| if has(term) { times * parameters.get(id) } else { 0.0 };
        let play = travel(TermKind::Backlash, Id::BacklashTravel, 1.0);
        let renewal = travel(TermKind::DwellTimeStatic, Id::DwellTravel, RENEWAL_TRAVELS);
        let stiffness_step = parameters.get(Id::BristleStiffness) * track.period_s;
        let bristles = parameters.law.has_bristles();
        let held = held.map(Real::value);
        Self {
            stepper: bristles.then(|| {
                Stepper::new(&parameters, track, Varying::of(&parameters, track), held, 1)
            }),
            coulomb: parameters.get(Id::CoulombTorque).abs(),
            stiffness_step,
            damping: parameters.get(Id::BristleDamping) / stiffness_step,
            period_s: track.period_s,
            settling: play.max(renewal),
            travel: f64::INFINITY,
            remaining: 0.0,
            change: 0.0,
            error: 0.0,
        }
    }

    /// Replaces the levels and other sizes of the model, and keeps its state.
    pub fn replace_parameters(&mut self, parameters: &Parameters<f64>, track: &Track) {
        self.coulomb = parameters.get(Id::CoulombTorque).abs();
        if let Some(stepper) = &mut self.stepper {
            stepper.replace_parameters(parameters, track);
        }
    }

    /// Simulates a row and returns the share of it to be taken from a fine simulation, 0 to 1.
    pub fn fine_share<T: Real>(&mut self, row: &TrackRow<T>) -> f64 {
        let Some(stepper) = &mut self.stepper else { return 0.0 };
        let TrackRow { track, index, before, sample, ratio, .. } = *row;
        let delayed = row.delayed.map(|motions| motions.map(|motion| motion.value()));
        let [from, to] = match delayed {
            Some(motions) => motions.map(|motion| motion.velocity_rad_s),
            None => [before.velocity_rad_s, sample.velocity_rad_s],
        };
        let held = stepper.state.bristle_torque_nm;
        stepper.step(&TrackRow { track, index, before, sample, delayed, ratio });
        let now = stepper.state.bristle_torque_nm;
        if from == 0.0 && to == 0.0 {
            return 0.0;
        }
        let level = now.abs().max(held.abs()).max(self.coulomb);
        let reverses = from * to <= 0.0;
        let travel = self.period_s * ratio * to.abs();
        self.travel = if reverses { travel } else { self.travel + travel };

        let relative_travel = |velocity: f64| self.stiffness_step * ratio * velocity.abs() / level;
        let [first, last] = [from, to].map(relative_travel);
        // Distance that the pilot covered in this row, and from it the distance before the row.
        let moved = (now - held) / level * 1f64.copysign(to);
        let before = if last > 0.0 { (moved * (1.0 + 1.0 / last)).clamp(-2.0, 2.0) } else { 0.0 };
        let (remaining, change) =
            if reverses { (2.0, 0.0) } else { (self.remaining, before - self.remaining) };
        let mean = 0.5 * (first + last);
        let decayed = (-mean).exp();
        let step_error = 1.0 / (1.0 + last) - decayed;
        // Error for a ramp of the level, and for the change of its slope within the row.
        let along = if mean > 1e-3 { (1.0 - decayed) / mean } else { 1.0 - 0.5 * mean };
        let bend = 0.5 * (change - self.change) * mean.min(1.0) / (1.0 + last);
        let row = remaining * step_error + change * (1.0 / (1.0 + last) - along);
        let error = self.error / (1.0 + last) + row;
        // The remaining distance causes an error in the following rows as well.
        let following = remaining * step_error / mean.min(1.0);
        (self.remaining, self.change) =
            (before / (1.0 + last), if reverses { 0.0 } else { change });
        let bound = error.abs().max(following.abs()) + bend.abs();
        let share = self.mixing_share(bound * (1.0 + self.damping / ratio));
        self.error = if share < 1.0 { error * (1.0 - share) } else { 0.0 };
        share
    }

    /// Returns the share of a row to be taken from a fine simulation, for this error as a share of the level.
    fn mixing_share(&self, error: f64) -> f64 {
        if self.travel < self.settling {
            return 1.0;
        }
        if error >= 2.0 * TOLERANCE || error.is_nan() {
            return 1.0;
        }
        let excess = (error / TOLERANCE - 1.0).max(0.0);
        excess * excess * (3.0 - 2.0 * excess)
    }
}

#[cfg(test)]
mod tests {
    use super::super::simulate::{Resolution, simulate};
    use super::super::stepper::track_rows;
    use super::*;
    use crate::dual::Dual;
    use compensator_core::{LawKind, Sample};

    const ROWS: usize = 4000;
    const COULOMB: f64 = 1.5;

    /// Oscillating motion with pauses, under an oscillating load.
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

    /// Stiffness, Nm/rad; damping, Nm s/rad; minimum number of rows with one step. The soft joint is always in presliding
    /// when it moves.
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
    fn simulate_with_single_step_rows_matches_many_steps() {
        for (stiffness, damping, min_single) in JOINTS {
            let joint = joint(stiffness, damping);
            let track = track();
            let mut pilot = Pilot::new(&joint, &track, Some(0.0));
            let rows: Vec<_> = track_rows::<f64>(&track, None).collect();
            let shares = rows[1..].iter().map(|row| pilot.fine_share(row));
            let single = shares.filter(|share| *share == 0.0).count();
            assert!(single > min_single, "{stiffness}: {single} of {ROWS} rows in one step");

            let found = torques(&joint, Resolution { substeps: 32, extrapolated: true });
            let [first, second] = [64, 128]
                .map(|substeps| torques(&joint, Resolution { substeps, extrapolated: false }));
            for (row, found) in found.iter().enumerate() {
                let reference = 2.0 * second[row] - first[row];
                let difference = (found - reference).abs();
                assert!(difference < 5e-4 * COULOMB, "{stiffness} at {row}: {found} {reference}");
            }
        }
    }

    #[test]
    fn simulate_with_single_step_rows_has_derivatives_of_many_steps() {
        let ids =
            [Id::CoulombTorque, Id::BristleStiffness, Id::BristleDamping, Id::StribeckVelocity];
        for (stiffness, damping, _) in JOINTS {
            let joint = joint(stiffness, damping);
            let mut dual = joint.convert::<Dual<4>>();
            for (index, id) in ids.iter().enumerate() {
                dual.set(*id, Dual::parameter(joint.get(*id), index));
            }
            let found = torques(&dual, Resolution { substeps: 32, extrapolated: true });
            let reference = torques(&dual, Resolution { substeps: 128, extrapolated: false });
            for (index, id) in ids.iter().enumerate() {
                let squares = |of: &dyn Fn(usize) -> f64| -> f64 {
                    (0..ROWS).map(|row| of(row).powi(2)).sum::<f64>().sqrt()
                };
                let norm = squares(&|row| reference[row].gradient[index]);
                let difference =
                    squares(&|row| reference[row].gradient[index] - found[row].gradient[index]);
                assert!(
                    difference < 0.02 * norm,
                    "{stiffness} {}: {difference} of {norm}",
                    id.name()
                );
            }
        }
    }
}

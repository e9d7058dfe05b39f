//! Whether the data determine a parameter, and why not.
//!
//! A small standard error is not enough: a wrong law has small errors too. A value is "determined" only if
//!
//! - its error is small against it, and its sign is possible;
//! - no parameter that compensates it is at an end of its range;
//! - its interval lies within what the log can show, and it does not cancel another part of the torque;
//! - both halves of the runs, or of the log, agree with it: one Gauss-Newton step from the optimum on each half.

use super::gradient::Differentiable;
use super::outcome::State;
use super::reason::Reason;
use super::reduce::{AtPoint, reduce};
use super::scales::{SEVERAL_ROWS, Scales};
use super::solve::Solution;
use super::statistics::inverse_information;
use super::streaming_qr::Reduced;
use super::track::{Rows, Track, run_count};
use crate::dual::Dual;
use ParameterId as Id;
use compensator_core::{ParameterId, Parameters, TermKind};
use joint_log::statistics::quantile_by_count;
use nalgebra::{DMatrix, DVector};

/// Relative standard error of a positive parameter above which it is "not determined": values from half to twice as large
/// are then within two standard errors. The prior alone gives 7.
const MAX_RELATIVE_ERROR: f64 = 0.5;

/// Effect of two standard errors on the torque, as a share of its RMS, above which any other parameter is "not determined",
/// unless its value differs from 0 by three standard errors.
const MAX_ERROR_EFFECT: f64 = 0.2;

/// Derivative that counts as 0, as a share of the torque's RMS.
const NEGLIGIBLE_EFFECT: f64 = 1e-9;

/// Half of the width of a 95 % interval, standard errors.
const INTERVAL: f64 = 1.96;

/// Absolute correlation above which a parameter compensates another.
const PARTNER_CORRELATION: f64 = 0.9;

/// Absolute correlation above which two parts of the torque that both exceed it cancel.
const CANCELLING_CORRELATION: f64 = 0.98;

/// Least fall of a Stribeck curve, as a share of its level, and the speed at which it has ended, in Stribeck velocities: 2 % of it
/// are left.
const MIN_FALL: f64 = 0.03;
const SLIDING_SPEEDS: f64 = 2.0;

/// Difference of the halves above which they disagree: in standard errors, and as a share of the value.
const MAX_HALVES_ERRORS: f64 = 3.0;
const MAX_HALVES_SHARE: f64 = 0.25;

/// Range of the values that a log can show.
#[derive(Clone, Copy, Debug)]
struct Shown {
    /// Range of the torque, with 0, Nm.
    torque: f64,
    /// Slowest and fastest speed of several rows, rad/s.
    speeds: [f64; 2],
    /// Motion from row to row at the slowest speed, and the swing, rad.
    travels: [f64; 2],
}

impl Shown {
    fn of(tracks: &[Track], scales: &Scales) -> Self {
        let included = tracks.iter().flat_map(|track| {
            let rows = (0..track.len()).filter(|row| track.is_included(*row));
            rows.map(|row| (track.torque[row], track.samples[row].velocity_rad_s.abs()))
        });
        let (torques, speeds): (Vec<f64>, Vec<f64>) = included.unzip();
        let slower = 1.0 - SEVERAL_ROWS as f64 / speeds.len().max(1) as f64;
        Self {
            torque: torques.iter().copied().fold(0.0, f64::max)
                - torques.iter().copied().fold(0.0, f64::min),
            speeds: [
                scales.slow_speed,
                quantile_by_count(speeds, slower.max(0.0)).unwrap_or_default(),
            ],
            travels: [scales.slow_speed * scales.period_s, scales.swing],
        }
    }

    /// Returns true if a log can show the value of a parameter with this error.
    fn contains(&self, id: Id, error: f64, parameters: &Parameters<f64>) -> bool {
        let value = parameters.get(id);
        let inside = |[least, most]: [f64; 2], value: f64| least <= value && value <= most;
        match id {
            // A level that only slower motion than the log's reaches is not shown.
            Id::StaticTorque | Id::StaticTorqueNegative => {
                value.abs() + INTERVAL * error <= self.torque
                    && parameters.get(Id::StribeckVelocity) >= self.speeds[0]
            }
            Id::CoulombTorque
            | Id::CoulombTorqueNegative
            | Id::TorqueOffset
            | Id::GravitySine
            | Id::GravityCosine => value.abs() + INTERVAL * error <= self.torque,
            Id::StribeckVelocity => {
                inside(self.speeds, value) && value + INTERVAL * error <= self.speeds[1]
            }
            Id::BristleStiffness => inside(
                self.travels,
                parameters.get(Id::CoulombTorque) / value.max(f64::MIN_POSITIVE),
            ),
            _ => true,
        }
    }
}

impl Shown {
    /// Returns true if the log is fast enough to show the law beyond its Stribeck curve. Within the curve, its fall and the
    /// viscous friction compensate each other.
    fn shows_sliding(&self, parameters: &Parameters<f64>) -> bool {
        let [coulomb, level] = [Id::CoulombTorque, Id::StaticTorque].map(|id| parameters.get(id));
        let has_curve = parameters.active().any(|id| id == Id::StribeckVelocity)
            && (level - coulomb).abs() > MIN_FALL * level.max(coulomb);
        !has_curve || SLIDING_SPEEDS * parameters.get(Id::StribeckVelocity) <= self.speeds[1]
    }
}

/// Errors of the free parameters of a fit, and what decides whether they are determined.
pub(super) struct Evidence<'a> {
    solution: &'a Solution,
    parameters: &'a Parameters<f64>,
    free: Vec<Id>,
    /// Covariance of the coordinates.
    covariance: DMatrix<f64>,
    /// Derivatives of the parameters by the coordinates.
    change: DMatrix<f64>,
    /// Standard errors of the parameters.
    errors: Vec<f64>,
    /// Correlation of the parameters.
    pub correlation: DMatrix<f64>,
    /// Difference of each parameter between both halves of the data.
    halves: Vec<HalvesDifference>,
    shown: Shown,
    /// RMS torque, Nm.
    torque: f64,
}

impl<'a> Evidence<'a> {
    /// Computes the errors. `time` is the number of rows that count as one observation.
    pub fn of(
        solution: &'a Solution,
        parameters: &'a Parameters<f64>,
        rows: Rows,
        time: f64,
    ) -> Self {
        let count = solution.coordinates.len();
        let free: Vec<Id> = solution.coordinates.ids().collect();
        let covariance = covariance(&solution.reduced, solution.reduced.sum_of_squares(), time);
        // d(parameter)/d(coordinate), exact to rounding: from the dual numbers of the fit, one coordinate at a time.
        let model = AtPoint { coordinates: &solution.coordinates, point: &solution.point };
        let dual: Vec<Parameters<Dual<1>>> =
            (0..count).map(|at| model.parameters(at..at + 1)).collect();
        let change = DMatrix::from_fn(count, count, |i, j| dual[j].get(free[i]).gradient[0]);
        let natural = &change * &covariance * change.transpose();
        let errors: Vec<f64> = natural.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect();
        let correlation = DMatrix::from_fn(count, count, |i, j| {
            (natural[(i, j)] / (errors[i] * errors[j]).max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0)
        });
        let scales = Scales::of(rows.tracks);
        let halves = halves_differ(solution, &change, rows, time);
        let shown = Shown::of(rows.tracks, &scales);
        let torque = scales.torque;
        Self {
            solution,
            parameters,
            free,
            covariance,
            change,
            errors,
            correlation,
            halves,
            shown,
            torque,
        }
    }

    /// Returns the index of a free parameter.
    pub fn position(&self, id: Id) -> Option<usize> {
        self.free.iter().position(|free| *free == id)
    }

    /// Returns the standard error of a free parameter.
    pub fn error(&self, index: usize) -> f64 {
        self.errors[index]
    }

    /// Returns whether the data determine a free parameter, and why not.
    pub fn state(&self, index: usize) -> (State, Option<Reason>) {
        let Solution { coordinates, point, start, .. } = self.solution;
        let from = coordinates.point(start)[index];
        let is_moved = (point[index] - from).abs() > 1e-6 * (1.0 + from.abs());
        let is_without_effect = !is_moved && self.norm(index) < NEGLIGIBLE_EFFECT * self.torque;
        if is_without_effect && !coordinates.is_at_end(index, point, self.parameters) {
            return (State::AtStart, None);
        }
        if coordinates.is_at_bound(index, point, self.parameters) {
            return (State::AtBound, None);
        }
        match self.reason(index) {
            Some(reason) => (State::NotDetermined, Some(reason)),
            None => (State::Determined, None),
        }
    }

    fn reason(&self, index: usize) -> Option<Reason> {
        let (id, error) = (self.free[index], self.error(index));
        let value = self.parameters.get(id);
        if let Some(reason) = self.looseness(index) {
            return Some(reason);
        }
        if id == Id::QuadraticDrag && value < 0.0 {
            return Some(Reason::ImpossibleSign);
        }
        if let Some(partner) = self.partner_at_end(index) {
            return Some(Reason::PartnerAtBound(partner));
        }
        if !self.shown.contains(id, error, self.parameters) {
            return Some(Reason::BeyondLog);
        }
        let is_of_sliding =
            matches!(id, Id::CoulombTorque | Id::CoulombTorqueNegative | Id::ViscousFriction);
        if is_of_sliding && !self.shown.shows_sliding(self.parameters) {
            return Some(Reason::InsideCurve);
        }
        if let Some(other) = self.cancelled_by(index) {
            return Some(Reason::Cancels(other));
        }
        let HalvesDifference { magnitude, std_error } = self.halves[index];
        let agree =
            magnitude <= (MAX_HALVES_ERRORS * std_error).max(MAX_HALVES_SHARE * value.abs());
        (!agree).then_some(Reason::HalvesDisagree)
    }

    /// Returns the reason if the error is too large.
    fn looseness(&self, index: usize) -> Option<Reason> {
        let (id, error) = (self.free[index], self.error(index));
        let value = self.parameters.get(id).abs();
        let is_positive = id.info().lower > 0.0;
        let is_loose = if self.solution.coordinates.is_held_by_prior(index) {
            self.covariance[(index, index)].sqrt() > MAX_RELATIVE_ERROR
        } else if is_positive {
            error > MAX_RELATIVE_ERROR * value
        } else {
            // Not significantly different from 0, or with a large effect of its error.
            value < 2.0 * error
                || 2.0 * error * self.effect(index) > MAX_ERROR_EFFECT * self.torque
                    && value < 3.0 * error
        };
        let reason =
            if is_positive || value >= 2.0 * error { Reason::Loose } else { Reason::Insignificant };
        (is_loose || !error.is_finite()).then_some(reason)
    }

    /// Returns a parameter at an end of its range that compensates this one: of the same part of the law, or correlated.
    fn partner_at_end(&self, index: usize) -> Option<Id> {
        let is_at_end = |other: usize| {
            let Solution { coordinates, point, .. } = self.solution;
            coordinates.is_at_end(other, point, self.parameters)
        };
        let is_partner = |other: &usize| {
            *other != index
                && (are_of_one_part(self.free[index], self.free[*other])
                    || self.correlation[(index, *other)].abs() > PARTNER_CORRELATION)
        };
        let mut partners = (0..self.free.len()).filter(is_partner);
        partners.find(|other| is_at_end(*other)).map(|other| self.free[other])
    }

    /// Returns a parameter whose part of the torque exceeds it, as that of this one, and which cancels it.
    fn cancelled_by(&self, index: usize) -> Option<Id> {
        let size = |index: usize| self.parameters.get(self.free[index]).abs() * self.effect(index);
        let cancels = |other: &usize| {
            let smaller = size(index).min(size(*other));
            let correlation = self.correlation[(index, *other)].abs();
            *other != index
                && is_additive(self.free[index])
                && is_additive(self.free[*other])
                && (smaller > self.shown.torque
                    || smaller > self.torque && correlation > CANCELLING_CORRELATION)
        };
        (0..self.free.len()).find(cancels).map(|other| self.free[other])
    }

    /// Returns the RMS change of the torque per unit of a coordinate.
    fn norm(&self, index: usize) -> f64 {
        let (reduced, count) = (&self.solution.reduced, self.free.len());
        let squares: f64 =
            (0..count).map(|i| reduced.factor[i * count + index].powi(2)).sum::<f64>();
        (squares / reduced.rows.max(1) as f64).sqrt()
    }

    /// Returns the RMS change of the torque per unit of a parameter.
    fn effect(&self, index: usize) -> f64 {
        self.norm(index) / self.change[(index, index)].abs().max(f64::MIN_POSITIVE)
    }
}

/// Returns the covariance of the coordinates for a sum of squared residuals.
fn covariance(reduced: &Reduced, squares: f64, time: f64) -> DMatrix<f64> {
    let spare = reduced.rows.saturating_sub(reduced.residual.len()).max(1) as f64;
    inverse_information(reduced) * (time * squares / spare)
}

/// Difference of a parameter between both halves of the data.
struct HalvesDifference {
    magnitude: f64,
    std_error: f64,
}

/// Returns the difference of each parameter between both halves of the data: one Gauss-Newton step from the optimum on each half.
fn halves_differ(
    solution: &Solution,
    change: &DMatrix<f64>,
    rows: Rows,
    time: f64,
) -> Vec<HalvesDifference> {
    let count = solution.coordinates.len();
    let [first, second] = halves(rows.tracks).map(|tracks| {
        let rows = Rows { tracks: &tracks, ..rows };
        let reduced = reduce(&solution.coordinates, &solution.point, rows, solution.resolution);
        let factor = DMatrix::from_row_slice(count, count, &reduced.factor);
        let gradient = factor.transpose() * DVector::from_column_slice(&reduced.residual);
        // Each half has the error of its own optimum.
        let covariance = covariance(&reduced, reduced.rest.powi(2), time);
        (-inverse_information(&reduced) * gradient, covariance)
    });
    let difference = change * (first.0 - second.0);
    let covariance = change * (first.1 + second.1) * change.transpose();
    let of = |index: usize| HalvesDifference {
        magnitude: difference[index].abs(),
        std_error: covariance[(index, index)].max(0.0).sqrt(),
    };
    (0..count).map(of).collect()
}

/// Returns every other run, and the rest. Of a single run, returns the rows before and after the middle of the log; the
/// others have weight 0, so that the states are those of the whole log.
fn halves(tracks: &[Track]) -> [Vec<Track>; 2] {
    if run_count(tracks) > 1 {
        let mut runs: Vec<usize> = tracks.iter().map(|track| track.run).collect();
        runs.dedup();
        let is_second =
            |track: &&Track| runs.iter().take_while(|run| **run != track.run).count() % 2 == 1;
        let (second, first) = tracks.iter().partition::<Vec<_>, _>(is_second);
        return [first, second].map(|half| half.into_iter().cloned().collect());
    }
    let middle = tracks.iter().map(Track::len).sum::<usize>() / 2;
    [false, true].map(|is_second| {
        let mut before = 0;
        let weighed = tracks.iter().map(|track| {
            let mut half = track.clone();
            half.scale_weights(|row| f64::from((before + row >= middle) == is_second));
            before += track.len();
            half
        });
        weighed.collect()
    })
}

/// Returns true if two parameters belong to one part of a law or to one term.
fn are_of_one_part(a: Id, b: Id) -> bool {
    const PARTS: [&[Id]; 4] = [
        &[Id::CoulombTorque, Id::StaticTorque, Id::StribeckVelocity],
        &[Id::CoulombTorqueNegative, Id::StaticTorqueNegative, Id::StribeckVelocity],
        &[Id::BristleStiffness, Id::BristleDamping],
        &[Id::AtanTorque, Id::AtanSlope],
    ];
    let terms = TermKind::ALL.iter().map(|term| term.parameters());
    PARTS.into_iter().chain(terms).any(|part| part.contains(&a) && part.contains(&b))
}

/// Returns true if a parameter is the factor of a part of the torque, which another part can cancel.
fn is_additive(id: Id) -> bool {
    matches!(
        id,
        Id::ViscousFriction
            | Id::QuadraticFriction
            | Id::CubicFriction
            | Id::AtanTorque
            | Id::TorqueOffset
            | Id::GravitySine
            | Id::GravityCosine
            | Id::Inertia
            | Id::LoadGain
            | Id::QuadraticDrag
    )
}

#[cfg(test)]
mod tests;

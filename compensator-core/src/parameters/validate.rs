//! What makes parameters legal, and how a refusal reads.
//!
//! Beyond each parameter's own range, a set must keep `F_S >= F_C > 0` wherever load, pressure,
//! drift and ripple may take the levels within the declared envelope, and must not be a source of
//! energy (bristle laws; terms that thin the film or age the contact are not part of the proof).
//! The latter (passivity) holds at `sigma2 >= 0` if `sigma2 F_C >= sigma1 (F_S - F_C)` (Barabanov and Ortega
//! 2000, constant `sigma1`), or if `sigma1(v) |v| <= 4 g(v)` at every speed (Olsson 1996): within
//! the envelope for a constant `sigma1`, everywhere for one that fades as `exp(-(v/v_s)^2)`, whose
//! largest `sigma1(v) |v|` is `0.4289 sigma1 v_s`.

use super::{Envelope, ParameterId, Parameters};
use crate::number::Real;
use crate::term::TermKind;
use ParameterId as Id;
use core::fmt;

/// The bound a refused value broke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// It must be at least this.
    AtLeast(f64),
    /// It must be at most this.
    AtMost(f64),
    /// It must be more than this.
    MoreThan(f64),
    /// It must be a finite number.
    Finite,
    /// It must be a whole number.
    Whole,
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Bound::AtLeast(bound) => write!(f, "at least {bound}"),
            Bound::AtMost(bound) => write!(f, "at most {bound}"),
            Bound::MoreThan(bound) => write!(f, "more than {bound}"),
            Bound::Finite => f.write_str("a finite number"),
            Bound::Whole => f.write_str("a whole number"),
        }
    }
}

/// Why parameters were refused: which, its value, its bound and the reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterError {
    /// Name of the parameter or envelope field.
    pub field: &'static str,
    /// Its value, in its own unit.
    pub value: f64,
    /// What it should have been.
    pub bound: Bound,
    /// Why.
    pub why: &'static str,
}

impl fmt::Display for ParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Seven digits: records hold f32, and 1.8 should not read 1.7999999523162842.
        write!(f, "{} = {}: must be {}: {}", self.field, self.value as f32, self.bound, self.why)
    }
}

impl core::error::Error for ParameterError {}

/// Checks numbers against ranges: smallest and largest legal value, and why, each in the order of the names.
///
/// # Errors
/// Names the first that is not a number or out of its range.
pub fn check_ranges(
    names: &[&'static str],
    values: &[f32],
    ranges: &[(f32, f32, &'static str)],
) -> Result<(), ParameterError> {
    for ((field, value), (least, most, why)) in names.iter().zip(values).zip(ranges) {
        let bound = if !value.is_finite() {
            Bound::Finite
        } else if value < least {
            Bound::AtLeast((*least).into())
        } else if value > most {
            Bound::AtMost((*most).into())
        } else {
            continue;
        };
        return refuse(field, (*value).into(), bound, why);
    }
    Ok(())
}

pub(super) fn refuse(
    field: &'static str,
    value: f64,
    bound: Bound,
    why: &'static str,
) -> Result<(), ParameterError> {
    Err(ParameterError { field, value, bound, why })
}

/// Least share of a level that load, pressure or wear may leave: a positive rest that the rounding of
/// the step's number cannot make 0.
const LEAST_SHARE: f64 = 1e-3;

/// Largest amplitude of the ripple over the angle, as the range of each of its two parts.
const RIPPLE_MAX: f64 = 0.99;

/// Largest field of an envelope: beyond it `f32` products of the step could leave their range.
const ENVELOPE_MAX: f32 = 1e9;

/// Largest value of `x exp(-x^2)`, taken at `x = 1/sqrt 2`.
const PEAK_OF_FADING: f64 = 0.428_881_942_480_353_4;

impl<S: Real> Parameters<S> {
    /// Checks every parameter that counts; the first refusal is returned.
    ///
    /// # Errors
    /// Names the parameter, its value, the bound it broke and why the bound is there.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for id in self.active() {
            let (info, value) = (id.info(), self.get(id).value());
            let why = "range of this parameter";
            if !value.is_finite() {
                return refuse(info.name, value, Bound::Finite, why);
            }
            if value < info.lower {
                return refuse(info.name, value, Bound::AtLeast(info.lower), why);
            }
            if value > info.upper {
                return refuse(info.name, value, Bound::AtMost(info.upper), why);
            }
        }
        self.validate_envelope()?;
        self.validate_levels()?;
        self.validate_terms()?;
        self.validate_passivity()
    }

    fn validate_envelope(&self) -> Result<(), ParameterError> {
        let e = &self.envelope;
        for (field, value) in Envelope::NAMES.into_iter().zip(e.to_array()) {
            if !value.is_finite() || value < 0.0 {
                return refuse(field, value.into(), Bound::AtLeast(0.0), "an envelope is a size");
            }
            if value > ENVELOPE_MAX {
                let bound = Bound::AtMost(ENVELOPE_MAX.into());
                return refuse(field, value.into(), bound, "range of an envelope");
            }
        }
        if e.velocity_max_rad_s == 0.0 {
            return refuse("velocity_max_rad_s", 0.0, Bound::MoreThan(0.0), "the joint must move");
        }
        Ok(())
    }

    fn validate_levels(&self) -> Result<(), ParameterError> {
        let value = |id: Id| self.get(id).value();
        let corners = self.seal_corners();
        let least_of =
            |added: fn((f64, f64)) -> f64| corners.map(added).into_iter().fold(0.0, f64::min);
        let taken = -least_of(|corner| corner.0) - self.load_torque_added().0;
        let drop = -least_of(|corner| corner.1);
        let negative = self.law.parameters().contains(&Id::CoulombTorqueNegative);
        for (coulomb, static_level) in [
            (Id::CoulombTorque, Id::StaticTorque),
            (Id::CoulombTorqueNegative, Id::StaticTorqueNegative),
        ] {
            if coulomb == Id::CoulombTorqueNegative && !negative {
                continue;
            }
            let least = taken / (1.0 - LEAST_SHARE);
            if value(coulomb) < least {
                let why = "the Coulomb level must stay positive at every load and pressure of the envelope";
                return refuse(coulomb.name(), value(coulomb), Bound::AtLeast(least), why);
            }
            // Dahl's bristles have the Coulomb level for a static one.
            let bristles_only = self.law.has_bristles() && !self.law.has_stribeck_curve();
            let static_level = if bristles_only { coulomb } else { static_level };
            let lowest = value(coulomb) + drop;
            let has_static = bristles_only || self.law.has_stribeck_curve();
            if has_static && value(static_level) < lowest {
                let why = "F_S >= F_C must hold at every load and pressure of the envelope";
                let bound = Bound::AtLeast(lowest);
                return refuse(static_level.name(), value(static_level), bound, why);
            }
        }
        Ok(())
    }

    fn validate_terms(&self) -> Result<(), ParameterError> {
        let value = |id: Id| self.get(id).value();
        for (index, kind) in self.terms.iter().enumerate() {
            if self.terms.iter().take(index).any(|earlier| earlier == kind) {
                let why = "a term may be listed once";
                return refuse(kind.name(), 2.0, Bound::AtMost(1.0), why);
            }
        }
        if let Some(kind) = self.terms.iter().find(|kind| self.law.includes(**kind)) {
            return refuse(
                kind.name(),
                1.0,
                Bound::AtMost(0.0),
                "this law has the term in it already",
            );
        }
        let amplitude = self.ripple_amplitude();
        if amplitude > RIPPLE_MAX {
            let why = "a ripple of 1 or more turns friction round";
            let field = "hypot(ripple_sine, ripple_cosine)";
            return refuse(field, amplitude, Bound::AtMost(RIPPLE_MAX), why);
        }
        let (least, _) = self.drift_range();
        if least < LEAST_SHARE {
            // The run-in alone leaves at least 1 %: it is the wear that takes the rest.
            let end_s = f64::from(self.envelope.campaign_max_h) * 3600.0;
            let why = "the level must stay positive to the end of the campaign";
            let rate = value(Id::DriftRate);
            let bound = Bound::AtLeast(rate + (LEAST_SHARE - least) / end_s);
            return refuse(Id::DriftRate.name(), rate, bound, why);
        }
        if self.terms.contains(&TermKind::Unknown) {
            // Its change of the level leaves at least a tenth: the range of each knot sees to that.
            let column = value(Id::UnknownColumn);
            if column != libm::trunc(column) {
                let why = "a column has a number";
                return refuse(Id::UnknownColumn.name(), column, Bound::Whole, why);
            }
            let (lower, upper) = (value(Id::UnknownLower), value(Id::UnknownUpper));
            if upper <= lower {
                let why = "the knots are spread over a range";
                return refuse(Id::UnknownUpper.name(), upper, Bound::MoreThan(lower), why);
            }
        }
        Ok(())
    }

    fn validate_passivity(&self) -> Result<(), ParameterError> {
        if self.choices.allow_active {
            return Ok(());
        }
        let viscous = self.get(Id::ViscousFriction).value();
        if self.law.has_bristles() && viscous < 0.0 {
            let why = "passivity: below 0 it drives instead of braking (allow_active)";
            return refuse(Id::ViscousFriction.name(), viscous, Bound::AtLeast(0.0), why);
        }
        let Some(largest) = self.active_damping() else { return Ok(()) };
        refuse(
            Id::BristleDamping.name(),
            self.get(Id::BristleDamping).value(),
            Bound::AtMost(largest),
            "passivity: more bristle damping can give out energy (damping_fades, or allow_active)",
        )
    }

    /// `None` where the bristle damping is passive at every constant load of the envelope; else the
    /// largest that would be.
    pub fn active_damping(&self) -> Option<f64> {
        if !self.law.parameters().contains(&Id::BristleDamping) {
            return None;
        }
        let value = |id: Id| self.get(id).value();
        let damping = value(Id::BristleDamping);
        let mut coulomb = value(Id::CoulombTorque);
        let mut excess = value(Id::StaticTorque) - coulomb;
        if self.law.parameters().contains(&Id::CoulombTorqueNegative) {
            excess = excess.max(value(Id::StaticTorqueNegative) - value(Id::CoulombTorqueNegative));
            coulomb = coulomb.min(value(Id::CoulombTorqueNegative));
        }
        coulomb += self.load_torque_added().0;
        let fastest = if self.choices.damping_fades {
            PEAK_OF_FADING * value(Id::StribeckVelocity)
        } else {
            f64::from(self.envelope.velocity_max_rad_s)
        };
        // Each criterion is linear in the load, so what holds at the corners holds between them;
        // but only the same criterion at all of them.
        let at_corners = |largest: &dyn Fn(f64, f64) -> f64| {
            let at = |(added, widened): (f64, f64)| largest(coulomb + added, excess + widened);
            self.seal_corners().map(at).into_iter().fold(f64::MAX, f64::min)
        };
        let mut largest = at_corners(&|coulomb, _| 4.0 * coulomb / fastest);
        if !self.choices.damping_fades {
            let viscous = value(Id::ViscousFriction);
            largest = largest.max(at_corners(&|coulomb, excess| {
                if excess > 0.0 { viscous * coulomb / excess } else { f64::MAX }
            }));
        }
        (damping > largest).then_some(largest)
    }
}

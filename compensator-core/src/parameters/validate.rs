//! What makes parameters legal, and how a refusal reads.
//!
//! Beyond each parameter's own range, a set must keep `F_S >= F_C > 0` wherever load, pressure,
//! drift and ripple may take the levels within the declared envelope, and must not be a source of
//! energy. The latter (passivity) holds if `sigma2 F_C >= sigma1 (F_S - F_C)` (Barabanov and Ortega
//! 2000, constant `sigma1`), or if `sigma1(v) |v| <= 4 g(v)` at every speed (Olsson 1996): within
//! the envelope for a constant `sigma1`, everywhere for one that fades as `exp(-(v/v_s)^2)`, whose
//! largest `sigma1(v) |v|` is `0.4289 sigma1 v_s`.

use super::{Envelope, ParameterId, Parameters};
use crate::number::Real;
use crate::term::{MAX_TERMS, TermKind};
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
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Bound::AtLeast(bound) => write!(f, "at least {bound}"),
            Bound::AtMost(bound) => write!(f, "at most {bound}"),
            Bound::MoreThan(bound) => write!(f, "more than {bound}"),
            Bound::Finite => f.write_str("a finite number"),
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
        write!(f, "{} = {}: must be {}: {}", self.field, self.value, self.bound, self.why)
    }
}

impl core::error::Error for ParameterError {}

pub(super) fn refuse(
    field: &'static str,
    value: f64,
    bound: Bound,
    why: &'static str,
) -> Result<(), ParameterError> {
    Err(ParameterError { field, value, bound, why })
}

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
        }
        if e.velocity_max_rad_s == 0.0 {
            return refuse("velocity_max_rad_s", 0.0, Bound::MoreThan(0.0), "the joint must move");
        }
        Ok(())
    }

    /// The smallest that load and pressure can add to a level within the envelope, Nm: each acts
    /// linearly, so the smallest is at a corner.
    fn least_added(&self, per_force: f64, per_pressure: f64) -> f64 {
        let e = &self.envelope;
        let seal = self.law.has_seal_load();
        let acts = |kind, coefficient: f64, largest: f32| {
            let on = seal || self.terms.contains(&kind);
            if on { (coefficient * f64::from(largest)).min(0.0) } else { 0.0 }
        };
        acts(TermKind::RadialForceCoulomb, per_force, e.radial_force_max_n)
            + acts(TermKind::PressureCoulomb, per_pressure, e.pressure_diff_max_pa)
    }

    fn validate_levels(&self) -> Result<(), ParameterError> {
        let value = |id: Id| self.get(id).value();
        let per_force = value(Id::RadialForceCoulomb);
        let per_pressure = value(Id::PressureCoulomb);
        let mut least = self.least_added(per_force, per_pressure);
        if self.terms.contains(&TermKind::LoadTorqueCoulomb) {
            let largest = f64::from(self.envelope.load_torque_max_nm);
            least += (value(Id::LoadCoulomb) * largest).min(0.0);
        }
        let negative = self.law.parameters().contains(&Id::CoulombTorqueNegative);
        for (coulomb, static_level) in [
            (Id::CoulombTorque, Id::StaticTorque),
            (Id::CoulombTorqueNegative, Id::StaticTorqueNegative),
        ] {
            if coulomb == Id::CoulombTorqueNegative && !negative {
                continue;
            }
            if value(coulomb) + least <= 0.0 {
                let why = "the Coulomb level must stay positive at every load and pressure of the envelope";
                return refuse(coulomb.name(), value(coulomb), Bound::MoreThan(-least), why);
            }
            if self.law.has_stribeck_curve() {
                let drop = self.least_added(
                    value(Id::RadialForceStaticExcess),
                    value(Id::PressureStaticExcess),
                );
                let lowest = value(coulomb) - drop;
                if value(static_level) < lowest {
                    let why = "F_S >= F_C must hold at every load and pressure of the envelope";
                    let bound = Bound::AtLeast(lowest);
                    return refuse(static_level.name(), value(static_level), bound, why);
                }
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
        debug_assert!(self.terms.len() <= MAX_TERMS);
        if self.terms.contains(&TermKind::PositionRipple) {
            let amplitude = libm::hypot(value(Id::RippleSine), value(Id::RippleCosine));
            if amplitude >= 1.0 {
                let why = "a ripple of 1 or more turns friction round";
                return refuse("ripple_sine", amplitude, Bound::AtMost(0.99), why);
            }
        }
        if self.terms.contains(&TermKind::TimeDrift) {
            let end_s = f64::from(self.envelope.campaign_max_h) * 3600.0;
            let run_in = |t: f64| value(Id::DriftAmplitude) * libm::exp(-t / value(Id::DriftTime));
            let end = 1.0 + run_in(end_s) + value(Id::DriftRate) * end_s;
            if end <= 0.0 {
                let why = "the level must stay positive to the end of the campaign";
                let bound = Bound::MoreThan(-(1.0 + run_in(end_s)) / end_s);
                return refuse("drift_rate", value(Id::DriftRate), bound, why);
            }
        }
        Ok(())
    }

    fn validate_passivity(&self) -> Result<(), ParameterError> {
        match self.active_damping() {
            Some(largest) if !self.choices.allow_active => refuse(
                Id::BristleDamping.name(),
                self.get(Id::BristleDamping).value(),
                Bound::AtMost(largest),
                "passivity: more bristle damping can give out energy (damping_fades, or allow_active)",
            ),
            _ => Ok(()),
        }
    }

    /// `None` where the law is passive; else the largest bristle damping that would be.
    pub fn active_damping(&self) -> Option<f64> {
        if !self.law.parameters().contains(&Id::BristleDamping) {
            return None;
        }
        let value = |id: Id| self.get(id).value();
        let damping = value(Id::BristleDamping);
        let negative = self.law.parameters().contains(&Id::CoulombTorqueNegative);
        let mut coulomb = value(Id::CoulombTorque);
        let mut excess = value(Id::StaticTorque) - coulomb;
        if negative {
            excess = excess.max(value(Id::StaticTorqueNegative) - value(Id::CoulombTorqueNegative));
            coulomb = coulomb.min(value(Id::CoulombTorqueNegative));
        }
        let fastest = if self.choices.damping_fades {
            PEAK_OF_FADING * value(Id::StribeckVelocity)
        } else {
            f64::from(self.envelope.velocity_max_rad_s)
        };
        let mut largest = 4.0 * coulomb / fastest;
        if !self.choices.damping_fades {
            let viscous = value(Id::ViscousFriction);
            let by_viscous =
                if excess > 0.0 { viscous * coulomb / excess } else { f64::MAX * viscous.signum() };
            largest = largest.max(by_viscous);
        }
        (damping > largest).then_some(largest)
    }
}

//! Validates parameters and describes the violated bound.
//!
//! Each parameter must be within its range. In addition, two conditions must hold for the whole set. First,
//! `F_S >= F_C > 0` under every load, pressure, drift and ripple of the declared envelope. Second, a bristle law
//! must be passive, that is, it must not generate energy. The passivity check does not include the terms for
//! viscosity over temperature and for contact age.
//!
//! The law is passive if `sigma2 >= 0` and one of two criteria holds:
//! - `sigma2 F_C >= sigma1 (F_S - F_C)`, for a constant `sigma1` (Barabanov and Ortega 2000).
//! - `sigma1(v) |v| <= 4 g(v)` at every speed (Olsson 1996). For a constant `sigma1`, it is checked within the
//!   envelope. If `sigma1` decreases as `exp(-(v/v_s)^2)`, it is checked at every speed: the maximum of
//!   `sigma1(v) |v|` is `0.4289 sigma1 v_s`.

use super::{Envelope, ParameterId, Parameters};
use crate::number::Real;
use crate::refusal::{Bound, ParameterError, refuse};
use crate::term::TermKind;
use crate::term::bounds::{Added, LEAST_SHARE};
use crate::text;
use ParameterId as Id;

/// Maximum of each field of an envelope, in its unit. It keeps the `f32` products of a step in range.
const ENVELOPE_MAX: f32 = 1e9;

/// Maximum of `x exp(-x^2)`, at `x = 1/sqrt 2`. It is the peak of `sigma1(v) |v| / (sigma1 v_s)`.
const FADING_DAMPING_PEAK: f32 = 0.428_881_94;

impl<S: Real> Parameters<S> {
    /// Checks the active parameters, the envelope, the levels, the terms and the passivity.
    ///
    /// # Errors
    /// Returns the first violation: the parameter, its value, the bound and the reason for the bound.
    pub fn validate(&self) -> Result<(), ParameterError> {
        for id in self.active() {
            let ([lower, upper], value) = (id.range(), self.get(id).single());
            let why = text!("range of this parameter");
            if !value.is_finite() {
                return refuse(id.text(), value, Bound::Finite, why);
            }
            if value < lower {
                return refuse(id.text(), value, Bound::AtLeast(lower), why);
            }
            if value > upper {
                return refuse(id.text(), value, Bound::AtMost(upper), why);
            }
        }
        self.validate_envelope()?;
        self.validate_levels()?;
        self.validate_terms()?;
        self.validate_passivity()
    }

    fn validate_envelope(&self) -> Result<(), ParameterError> {
        let e = &self.envelope;
        for (field, value) in Envelope::TEXTS.into_iter().zip(e.to_array()) {
            if !value.is_finite() || value < 0.0 {
                return refuse(field, value, Bound::AtLeast(0.0), text!("an envelope is a size"));
            }
            if value > ENVELOPE_MAX {
                let bound = Bound::AtMost(ENVELOPE_MAX);
                return refuse(field, value, bound, text!("range of an envelope"));
            }
        }
        if e.velocity_max_rad_s == 0.0 {
            return refuse(
                text!("velocity_max_rad_s"),
                0.0,
                Bound::MoreThan(0.0),
                text!("the joint must move"),
            );
        }
        Ok(())
    }

    fn validate_levels(&self) -> Result<(), ParameterError> {
        let value = |id: Id| self.get(id).single();
        let levels = self.bounds().corners(&self.envelope);
        let taken = -levels.iter().map(|added| added.coulomb).fold(0.0, f32::min);
        let drop = -levels.iter().map(|added| added.excess).fold(0.0, f32::min);
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
                let why = text!(
                    "the Coulomb level must stay positive at every load and pressure of the envelope"
                );
                return refuse(coulomb.text(), value(coulomb), Bound::AtLeast(least), why);
            }
            // In the Dahl law, the static level equals the Coulomb level.
            let bristles_only = self.law.has_bristles() && !self.law.has_stribeck_curve();
            let static_level = if bristles_only { coulomb } else { static_level };
            let lowest = value(coulomb) + drop;
            let has_static = bristles_only || self.law.has_stribeck_curve();
            if has_static && value(static_level) < lowest {
                let why = text!("F_S >= F_C must hold at every load and pressure of the envelope");
                let bound = Bound::AtLeast(lowest);
                return refuse(static_level.text(), value(static_level), bound, why);
            }
        }
        Ok(())
    }

    fn validate_terms(&self) -> Result<(), ParameterError> {
        for (index, kind) in self.terms.iter().enumerate() {
            if self.terms.iter().take(index).any(|earlier| earlier == kind) {
                let why = text!("a term may be listed once");
                return refuse(kind.text(), 2.0, Bound::AtMost(1.0), why);
            }
        }
        if let Some(kind) = self.terms.iter().find(|kind| self.law.includes(**kind)) {
            return refuse(
                kind.text(),
                1.0,
                Bound::AtMost(0.0),
                text!("this law has the term in it already"),
            );
        }
        let on = TermKind::ALL.iter().filter(|kind| self.terms.contains(kind));
        for kind in on {
            kind.validate(&self.values, &self.envelope)?;
        }
        Ok(())
    }

    fn validate_passivity(&self) -> Result<(), ParameterError> {
        if self.choices.allow_active {
            return Ok(());
        }
        let viscous = self.get(Id::ViscousFriction).single();
        if self.law.has_bristles() && viscous < 0.0 {
            let why = text!("passivity: below 0 it drives instead of braking (allow_active)");
            return refuse(Id::ViscousFriction.text(), viscous, Bound::AtLeast(0.0), why);
        }
        let Some(largest) = self.active_damping() else { return Ok(()) };
        refuse(
            Id::BristleDamping.text(),
            self.get(Id::BristleDamping).single(),
            Bound::AtMost(largest),
            text!(
                "passivity: more bristle damping can supply energy (damping_fades, or allow_active)"
            ),
        )
    }

    /// Returns `None` if the bristle damping is passive at every constant load of the envelope. Otherwise
    /// returns the largest passive bristle damping, Nm s/rad.
    pub fn active_damping(&self) -> Option<f32> {
        if !self.law.parameters().contains(&Id::BristleDamping) {
            return None;
        }
        let value = |id: Id| self.get(id).single();
        let damping = value(Id::BristleDamping);
        let mut coulomb = value(Id::CoulombTorque);
        let mut excess = value(Id::StaticTorque) - coulomb;
        if self.law.parameters().contains(&Id::CoulombTorqueNegative) {
            excess = excess.max(value(Id::StaticTorqueNegative) - value(Id::CoulombTorqueNegative));
            coulomb = coulomb.min(value(Id::CoulombTorqueNegative));
        }
        let fastest = if self.choices.damping_fades {
            FADING_DAMPING_PEAK * value(Id::StribeckVelocity)
        } else {
            self.envelope.velocity_max_rad_s
        };
        // Each criterion is linear in the load. If one criterion holds at all corners, it therefore
        // holds in the whole envelope.
        let levels = self.bounds().corners(&self.envelope);
        let at_corners = |largest: &dyn Fn(f32, f32) -> f32| {
            let at = |added: &Added| largest(coulomb + added.coulomb, excess + added.excess);
            levels.iter().map(at).fold(f32::MAX, f32::min)
        };
        let mut largest = at_corners(&|coulomb, _| 4.0 * coulomb / fastest);
        if !self.choices.damping_fades {
            let viscous = value(Id::ViscousFriction);
            largest = largest.max(at_corners(&|coulomb, excess| {
                if excess > 0.0 { viscous * coulomb / excess } else { f32::MAX }
            }));
        }
        (damping > largest).then_some(largest)
    }
}

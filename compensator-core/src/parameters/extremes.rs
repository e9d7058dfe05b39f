//! How far load, pressure and terms can take a law's quantities within the declared envelope.
//!
//! Validation needs the *least* level (it must stay positive, or the step divides by nothing) and
//! building for fixed point the *largest* (or a product leaves the number's range). Load and
//! pressure act linearly, so their extremes lie at the corners of the envelope; ripple, drift,
//! direction and what has no known cause are factors on top, each with a range of its own. What is off
//! counts for nothing.

use super::{ParameterId, Parameters};
use crate::number::Real;
use crate::quantity::TEMPERATURE_RANGE_C;
use crate::term::{CONTACT_AGE_MAX_S, TermKind, UNKNOWN_LEVELS, UNKNOWN_TORQUES};
use ParameterId as Id;

impl<S: Real> Parameters<S> {
    fn value(&self, id: Id) -> f64 {
        self.get(id).value()
    }

    /// What load and pressure add to `F_C`, and to `F_S - F_C`, at each corner, Nm.
    pub(super) fn seal_corners(&self) -> [(f64, f64); 4] {
        let largest = |kind, size: f32| {
            let on = self.law.has_seal_load() || self.terms.contains(&kind);
            if on { f64::from(size) } else { 0.0 }
        };
        let force = largest(TermKind::RadialForceCoulomb, self.envelope.radial_force_max_n);
        let pressure = largest(TermKind::PressureCoulomb, self.envelope.pressure_diff_max_pa);
        [(0.0, 0.0), (force, 0.0), (0.0, pressure), (force, pressure)].map(|(force, pressure)| {
            // A value that is off may be anything, NaN too: it is not even multiplied by 0.
            let acts = |id, size: f64| if size > 0.0 { self.value(id) * size } else { 0.0 };
            (
                acts(Id::RadialForceCoulomb, force) + acts(Id::PressureCoulomb, pressure),
                acts(Id::RadialForceStaticExcess, force) + acts(Id::PressureStaticExcess, pressure),
            )
        })
    }

    /// The least (at most 0) and the most that the transmitted torque adds to both levels, Nm.
    pub(super) fn load_torque_added(&self) -> (f64, f64) {
        if !self.terms.contains(&TermKind::LoadTorqueCoulomb) {
            return (0.0, 0.0);
        }
        let added = self.value(Id::LoadCoulomb) * f64::from(self.envelope.load_torque_max_nm);
        (added.min(0.0), added.max(0.0))
    }

    /// Least and largest factor of drift on the level; between its ends it stays within them and 1.
    pub(super) fn drift_range(&self) -> (f64, f64) {
        if !self.terms.contains(&TermKind::TimeDrift) {
            return (1.0, 1.0);
        }
        let end_s = f64::from(self.envelope.campaign_max_h) * 3600.0;
        let amplitude = self.value(Id::DriftAmplitude);
        let start = 1.0 + amplitude;
        let end = 1.0
            + amplitude * libm::exp(-end_s / self.value(Id::DriftTime))
            + self.value(Id::DriftRate) * end_s;
        (start.min(end).min(1.0), start.max(end).max(1.0))
    }

    /// Amplitude of the ripple over the angle.
    pub(super) fn ripple_amplitude(&self) -> f64 {
        if !self.terms.contains(&TermKind::PositionRipple) {
            return 0.0;
        }
        libm::hypot(self.value(Id::RippleSine), self.value(Id::RippleCosine))
    }

    /// Least and largest factor on the level of what has no known cause: at a knot, or 1 where the
    /// column it follows is not believed.
    pub(super) fn unknown_range(&self) -> (f64, f64) {
        if !self.terms.contains(&TermKind::Unknown) {
            return (1.0, 1.0);
        }
        let factors = UNKNOWN_LEVELS.map(|id| 1.0 + self.value(id));
        (factors.into_iter().fold(1.0, f64::min), factors.into_iter().fold(1.0, f64::max))
    }

    fn asymmetry(&self, id: Id) -> f64 {
        let on = self.terms.contains(&TermKind::DirectionAsymmetry);
        if on { self.value(id).abs() } else { 0.0 }
    }

    /// The lowest level the step can divide by, Nm.
    pub(super) fn smallest_level(&self) -> f64 {
        let mut coulomb = self.value(Id::CoulombTorque);
        if self.law.parameters().contains(&Id::CoulombTorqueNegative) {
            coulomb = coulomb.min(self.value(Id::CoulombTorqueNegative));
        }
        let seal = self.seal_corners().map(|corner| corner.0).into_iter().fold(0.0, f64::min);
        (coulomb + seal + self.load_torque_added().0)
            * self.drift_range().0
            * self.unknown_range().0
            * (1.0 - self.ripple_amplitude())
            * (1.0 - self.asymmetry(Id::CoulombAsymmetry))
    }

    /// The highest static level, Nm: no bristle torque is larger.
    pub(super) fn largest_level(&self) -> f64 {
        let sides = [
            Id::CoulombTorque,
            Id::StaticTorque,
            Id::CoulombTorqueNegative,
            Id::StaticTorqueNegative,
        ];
        let own = self.law.parameters();
        let base = sides.iter().filter(|id| own.contains(id)).map(|id| self.value(*id));
        let seal = self.seal_corners().map(|(coulomb, excess)| coulomb + excess.max(0.0));
        let dwell = if self.terms.contains(&TermKind::DwellTimeStatic) {
            let ages = CONTACT_AGE_MAX_S / self.value(Id::DwellTime);
            self.value(Id::DwellGain) * libm::log(1.0 + ages)
        } else {
            0.0
        };
        let sum = base.fold(0.0, f64::max)
            + seal.into_iter().fold(0.0, f64::max)
            + self.load_torque_added().1
            + dwell;
        sum * self.drift_range().1
            * self.unknown_range().1
            * (1.0 + self.ripple_amplitude())
            * (1.0 + self.asymmetry(Id::CoulombAsymmetry))
    }

    /// The largest magnitude of the viscous coefficient, Nm s/rad.
    pub(super) fn largest_viscous(&self) -> f64 {
        let warmth = if self.terms.contains(&TermKind::TemperatureViscous) {
            let reference = self.value(Id::TemperatureReference);
            let rate = self.value(Id::TemperatureViscosity);
            let hottest = TEMPERATURE_RANGE_C.map(|end| libm::exp(-rate * (end - reference)));
            hottest[0].max(hottest[1])
        } else {
            1.0
        };
        let asymmetry = self.asymmetry(Id::ViscousAsymmetry);
        self.value(Id::ViscousFriction).abs() * warmth * (1.0 + asymmetry)
    }

    /// The largest magnitude of what terms add to the friction torque, Nm.
    pub(super) fn largest_added_torque(&self) -> f64 {
        let e = &self.envelope;
        let speed = f64::from(e.velocity_max_rad_s);
        let of = |id, size: f64| self.value(id).abs() * size;
        let added = |kind: &TermKind| match kind {
            TermKind::GravityImbalance => {
                libm::hypot(self.value(Id::GravitySine), self.value(Id::GravityCosine))
            }
            TermKind::TorqueOffset => of(Id::TorqueOffset, 1.0),
            TermKind::QuadraticDrag => of(Id::QuadraticDrag, speed * speed),
            TermKind::UnmodelledInertia => of(Id::Inertia, e.acceleration_max_rad_s2.into()),
            TermKind::LoadGain => of(Id::LoadGain, e.load_torque_max_nm.into()),
            TermKind::Unknown => {
                UNKNOWN_TORQUES.map(|id| self.value(id).abs()).into_iter().fold(0.0, f64::max)
            }
            _ => 0.0,
        };
        self.terms.iter().map(added).sum()
    }
}

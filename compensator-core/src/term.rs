//! Extension terms: one for every cause the diagnosis can name.
//!
//! A term is a small correction to a law: it moves a level, bends the bristles, scales the viscous
//! part, or adds a torque of its own. Each reads the covariates it needs from a
//! [`crate::model::Sample`] and writes into [`crate::effect::Effects`]; the laws know nothing of terms. A model carries a bounded
//! list of them, each kind at most once. To add a cause: a kind here with its name and parameters,
//! its rows in [`crate::parameters::table`], and its arms in the feature-gated module `built`, where
//! terms are made for a sample period and act.

#[cfg(feature = "terms")]
mod built;
#[cfg(feature = "terms")]
mod spline;

#[cfg(feature = "terms")]
pub use built::{Memory, Term};
#[cfg(feature = "terms")]
pub use spline::Spline;

use crate::parameters::ParameterId;
use ParameterId as Id;

/// Largest number of terms in one model.
pub const MAX_TERMS: usize = 8;

/// Samples a delay line holds: the longest [`TermKind::ChannelDelay`] is one less.
pub const DELAY_LINE: usize = 32;

/// Contact stops ageing after this, s: its effect grows with the logarithm, and fixed point ends.
pub const CONTACT_AGE_MAX_S: f64 = 1000.0;

/// Knots of [`TermKind::Unknown`].
pub const KNOTS: usize = 6;

/// The torques at the knots of [`TermKind::Unknown`], in their order.
pub const UNKNOWN_TORQUES: [ParameterId; KNOTS] = [
    Id::UnknownTorque1,
    Id::UnknownTorque2,
    Id::UnknownTorque3,
    Id::UnknownTorque4,
    Id::UnknownTorque5,
    Id::UnknownTorque6,
];

/// The changes of the level at the knots of [`TermKind::Unknown`], in their order.
pub const UNKNOWN_LEVELS: [ParameterId; KNOTS] = [
    Id::UnknownLevel1,
    Id::UnknownLevel2,
    Id::UnknownLevel3,
    Id::UnknownLevel4,
    Id::UnknownLevel5,
    Id::UnknownLevel6,
];

macro_rules! term_kinds {
    ($($(#[$doc:meta])* $kind:ident = $name:literal [$($parameter:ident),*]),* $(,)?) => {
        /// The kinds of term, named as the causes they explain.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum TermKind { $($(#[$doc])* $kind),* }

        impl TermKind {
            /// Every kind, in the order of their numbers.
            pub const ALL: &'static [TermKind] = &[$(TermKind::$kind),*];

            /// The name used in model names, files and findings.
            pub const fn name(self) -> &'static str {
                match self { $(TermKind::$kind => $name),* }
            }

            /// The parameters that belong to this kind.
            pub const fn parameters(self) -> &'static [ParameterId] {
                match self { $(TermKind::$kind => &[$(Id::$parameter),*]),* }
            }
        }
    };
}

term_kinds! {
    /// `F_C += k F_L`, `F_S` likewise: side load presses the seal.
    RadialForceCoulomb = "radial-force-coulomb" [RadialForceCoulomb, RadialForceStaticExcess],
    /// `dz/dt += eta3 dF_L/dt`: a changing side load bends the bristles.
    RadialForceRate = "radial-force-rate" [RadialForceRate],
    /// `F_C += k dP`, `F_S` likewise: pressure preloads the seal.
    PressureCoulomb = "pressure-coulomb" [PressureCoulomb, PressureStaticExcess],
    /// `sigma2 *= exp(-b (T - T0))`: the film thins as it warms.
    TemperatureViscous = "temperature-viscous" [TemperatureViscosity, TemperatureReference],
    /// `g *= 1 + a sin(n q + phi)`: friction follows the shaft angle.
    PositionRipple = "position-ripple" [RippleSine, RippleCosine, RippleOrder],
    /// `+ m sin(q + phi)`: a torque of the angle, whichever way it turns.
    GravityImbalance = "gravity-imbalance" [GravitySine, GravityCosine],
    /// Levels and viscous part differ by direction.
    DirectionAsymmetry = "direction-asymmetry" [CoulombAsymmetry, ViscousAsymmetry],
    /// `+ c`: a sensor's zero error.
    TorqueOffset = "torque-offset" [TorqueOffset],
    /// `+ c v |v|`: water drag.
    QuadraticDrag = "quadratic-drag" [QuadraticDrag],
    /// `F_S += k ln(1 + age/t0)`: the longer the rest, the higher the breakaway.
    DwellTimeStatic = "dwell-time-static" [DwellGain, DwellTime, DwellTravel],
    /// `g *= 1 + a exp(-t/T) + r t`: run-in and wear.
    TimeDrift = "time-drift" [DriftAmplitude, DriftTime, DriftRate],
    /// `F_C += k |tau_L|`, `F_S` likewise: transmitted torque loads the gear.
    LoadTorqueCoulomb = "load-torque-coulomb" [LoadCoulomb],
    /// `+ J dv/dt`.
    UnmodelledInertia = "unmodelled-inertia" [Inertia],
    /// Bristle stiffness is low while the play is crossed.
    Backlash = "backlash" [BacklashTravel, BacklashStiffnessRatio],
    /// `exp(-|v/v_s|^delta)`.
    StribeckShape = "stribeck-shape" [StribeckExponent],
    /// `v(t - d)`: velocity and torque are logged at different times.
    ChannelDelay = "channel-delay" [ChannelDelay],
    /// `+ k tau_L`: the known load, in the torque channel's own scale. A rigid-body part, no cause.
    LoadGain = "load-gain" [LoadGain],
    /// `+ t(x)`, `g *= 1 + l(x)`, both broken lines over one column: structure no named cause
    /// explains, and calibration errors that follow a covariate.
    Unknown = "unknown" [
        UnknownColumn, UnknownLower, UnknownUpper, UnknownTorque1, UnknownTorque2, UnknownTorque3,
        UnknownTorque4, UnknownTorque5, UnknownTorque6, UnknownLevel1, UnknownLevel2,
        UnknownLevel3, UnknownLevel4, UnknownLevel5, UnknownLevel6
    ],
}

impl TermKind {
    /// The kind with this name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.name() == name)
    }

    /// The kind with this number (its position in [`TermKind::ALL`]).
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }
}

//! Extension terms: one for every cause the diagnosis can name.
//!
//! A term is a small correction to a law: it moves a level, bends the bristles, scales the viscous
//! part, or adds a torque of its own. Each reads the covariates it needs from a
//! [`crate::model::Sample`] and writes into [`crate::effect::Effects`]; the laws know nothing of terms. A
//! model carries a bounded list of them, each kind at most once; they act in its order, before the law.
//!
//! Each term is one file, which answers the questions of `interface`: its parameters, what it is built of,
//! what it does, and how far it can go. To add one: its file, its row in the table below, and rows for
//! its parameters at the end of [`crate::parameter`].

// Without the feature `terms` a term's parameters are still read and checked, but no list runs it.
#![cfg_attr(not(feature = "terms"), allow(dead_code, unused_imports))]

mod angle;
mod backlash;
pub(crate) mod bounds;
mod channel_delay;
mod direction_asymmetry;
mod dwell_time_static;
mod gravity_imbalance;
mod interface;
mod load_gain;
mod load_torque_coulomb;
mod lookup_table;
mod position_ripple;
mod pressure_coulomb;
mod quadratic_drag;
mod radial_force_coulomb;
mod radial_force_rate;
mod stribeck_shape;
mod temperature_coulomb;
mod temperature_viscous;
mod time_drift;
mod torque_offset;
mod torque_ripple;
mod unmodelled_inertia;
mod warm_up;

#[cfg_attr(not(feature = "terms"), path = "term/no_list.rs")]
mod list;

pub(crate) use list::{Memory, Terms, check};
pub use lookup_table::{KNOTS, LOOKUP_LEVELS, LOOKUP_TORQUES, LookupFormula};
pub use torque_ripple::{TORQUE_RIPPLE_PARAMETERS, TORQUE_RIPPLES};

use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId, Values};
use crate::quantity::Quantity;
use crate::refusal::ParameterError;
use bounds::Bounds;
use interface::Term;

/// Largest number of terms in one model.
pub const MAX_TERMS: usize = 8;

/// Hands the table of terms to a macro. A row says what the term does, its kind (the name of its type as
/// well), the name used in model names, files and findings, and its file. Its position is its number in
/// records: a new one goes to the end.
macro_rules! term_table {
    ($use:ident) => {
        $use! {
            /// `F_C += k F_L`, `F_S` likewise: side load presses the seal.
            RadialForceCoulomb = "radial-force-coulomb" in radial_force_coulomb,
            /// `dz/dt += eta3 dF_L/dt`: a changing side load bends the bristles.
            RadialForceRate = "radial-force-rate" in radial_force_rate,
            /// `F_C += k dP`, `F_S` likewise: pressure preloads the seal.
            PressureCoulomb = "pressure-coulomb" in pressure_coulomb,
            /// `sigma2 *= exp(-b (T - T0))`: the film thins as it warms.
            TemperatureViscous = "temperature-viscous" in temperature_viscous,
            /// `g *= 1 + a sin(n q + phi)`: friction follows the shaft angle.
            PositionRipple = "position-ripple" in position_ripple,
            /// `+ m sin(q + phi)`: a torque of the angle, whichever way it turns.
            GravityImbalance = "gravity-imbalance" in gravity_imbalance,
            /// Levels and viscous part differ by direction.
            DirectionAsymmetry = "direction-asymmetry" in direction_asymmetry,
            /// `+ c`: a sensor's zero error.
            TorqueOffset = "torque-offset" in torque_offset,
            /// `+ c v |v|`: water drag.
            QuadraticDrag = "quadratic-drag" in quadratic_drag,
            /// `F_S += k ln(1 + age/t0)`: the longer the rest, the higher the breakaway.
            DwellTimeStatic = "dwell-time-static" in dwell_time_static,
            /// `g *= 1 + a exp(-t/T) + r t`: run-in and wear.
            TimeDrift = "time-drift" in time_drift,
            /// `F_C += k |tau_L|`, `F_S` likewise: transmitted torque loads the gear.
            LoadTorqueCoulomb = "load-torque-coulomb" in load_torque_coulomb,
            /// `+ J dv/dt`.
            UnmodelledInertia = "unmodelled-inertia" in unmodelled_inertia,
            /// Bristle stiffness is low while the play is crossed.
            Backlash = "backlash" in backlash,
            /// `exp(-|v/v_s|^delta)`.
            StribeckShape = "stribeck-shape" in stribeck_shape,
            /// `v(t - d)`: velocity and torque are logged at different times.
            ChannelDelay = "channel-delay" in channel_delay,
            /// `+ k tau_L`: the known load, in the torque channel's own scale. A rigid-body part, no cause.
            LoadGain = "load-gain" in load_gain,
            /// `+ t(x)`, `g *= 1 + l(x)`, both broken lines over one column: structure no named cause
            /// explains, and calibration errors that follow a covariate.
            LookupTable = "unknown" in lookup_table,
            /// `+ sum a_k sin(n_k q) + b_k cos(n_k q)`: cogging and gear mesh.
            TorqueRipple = "torque-ripple" in torque_ripple,
            /// `g *= exp(-b (T - T0))`: the seal stiffens with cold.
            TemperatureCoulomb = "temperature-coulomb" in temperature_coulomb,
            /// `g *= 1 - a (1 - exp(-E/E0))`, `E` dissipated, cooling: friction falls with its own heat.
            WarmUp = "warm-up" in warm_up,
        }
    };
}
pub(crate) use term_table;

macro_rules! define_kinds {
    ($($(#[$doc:meta])* $kind:ident = $name:literal in $file:ident,)*) => {
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
            #[inline(never)]
            pub const fn parameters(self) -> &'static [ParameterId] {
                match self { $(TermKind::$kind => <$file::$kind<f64> as Term<f64>>::PARAMETERS),* }
            }

            /// The quantity it does nothing without; `None` where velocity, acceleration or time, which every
            /// log has, is all it needs, or where what it follows is a choice.
            pub const fn reads(self) -> Option<Quantity> {
                match self { $(TermKind::$kind => <$file::$kind<f64> as Term<f64>>::READS),* }
            }

            /// Whether it goes before all others, because they are to see what it does.
            pub const fn acts_first(self) -> bool {
                match self { $(TermKind::$kind => <$file::$kind<f64> as Term<f64>>::ACTS_FIRST),* }
            }

            /// Widens the bounds of a law's quantities by what it does to them within the envelope.
            pub(crate) fn widen<S: Real>(
                self,
                values: &Values<S>,
                envelope: &Envelope,
                bounds: &mut Bounds,
            ) {
                match self {
                    $(TermKind::$kind => $file::$kind::<f64>::widen(values, envelope, bounds)),*
                }
            }

            /// Checks what the ranges of its parameters leave open.
            pub(crate) fn validate<S: Real>(
                self,
                values: &Values<S>,
                envelope: &Envelope,
            ) -> Result<(), ParameterError> {
                match self { $(TermKind::$kind => $file::$kind::<f64>::validate(values, envelope)),* }
            }
        }
    };
}

term_table!(define_kinds);

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

//! Extension terms: one for each cause that the diagnosis can identify.
//!
//! A term is a small correction to a law. It changes a level, deflects the bristles, scales the viscous
//! friction, or adds a torque. A term reads its covariates from a [`crate::model::Sample`] and writes to
//! [`crate::effect::Effects`]. The laws do not depend on the terms. A model has a bounded list of terms, with
//! each kind at most once. They act in the order of the list, before the law.
//!
//! Each term is one file that implements the trait in `interface`: parameters, coefficients, effect and bounds.
//! To add a term, add its file, its row in the table below, and rows for its parameters at the end of
//! [`crate::parameter`].

// Without the feature `terms`, the parameters of terms are still read and checked, but no model runs a term.
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
mod seal_levels;
mod stribeck_shape;
mod temperature_coulomb;
mod temperature_viscous;
mod thermal_factor;
mod time_drift;
mod torque_offset;
mod torque_ripple;
mod unmodelled_inertia;
mod warm_up;

#[cfg_attr(not(feature = "terms"), path = "term/no_list.rs")]
mod list;

pub(crate) use list::{Memory, Terms, check};
pub use lookup_table::{LOOKUP_KNOTS, LOOKUP_LEVELS, LOOKUP_TORQUES, LookupFormula};
pub use torque_ripple::{TORQUE_RIPPLE_ORDERS, TORQUE_RIPPLE_PARAMETERS};

use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId, ParameterValues};
use crate::quantity::Quantity;
use crate::refusal::{ParameterError, Text};
use bounds::Bounds;
use interface::Term;

/// Maximum number of terms in one model.
pub const MAX_TERMS: usize = 8;

/// Passes the table of terms to a macro.
///
/// A row holds: a description; the kind, which is also the name of its type; the name in model names, files and
/// findings; the file. The position of a row is the number of the term in records, so a new row goes at the end.
macro_rules! term_table {
    ($use:ident) => {
        $use! {
            /// `F_C += k F_L`, `F_S` likewise: side load compresses the seal.
            RadialForceCoulomb = "radial-force-coulomb" in radial_force_coulomb,
            /// `dz/dt += eta3 dF_L/dt`: a change of the side load deflects the bristles.
            RadialForceRate = "radial-force-rate" in radial_force_rate,
            /// `F_C += k dP`, `F_S` likewise: pressure preloads the seal.
            PressureCoulomb = "pressure-coulomb" in pressure_coulomb,
            /// `sigma2 *= exp(-b (T - T0))`: the viscosity of the lubricant decreases with temperature.
            TemperatureViscous = "temperature-viscous" in temperature_viscous,
            /// `g *= 1 + a sin(n q + phi)`: friction depends on the shaft angle.
            PositionRipple = "position-ripple" in position_ripple,
            /// `+ m sin(q + phi)`: a torque that depends on the angle, not on the direction of motion.
            GravityImbalance = "gravity-imbalance" in gravity_imbalance,
            /// Levels and viscous coefficient depend on the direction of motion.
            DirectionAsymmetry = "direction-asymmetry" in direction_asymmetry,
            /// `+ c`: the zero error of a torque sensor.
            TorqueOffset = "torque-offset" in torque_offset,
            /// `+ c v |v|`: water drag.
            QuadraticDrag = "quadratic-drag" in quadratic_drag,
            /// `F_S += k ln(1 + age/t0)`: the breakaway torque increases with the time at rest.
            DwellTimeStatic = "dwell-time-static" in dwell_time_static,
            /// `g *= 1 + a exp(-t/T) + r t`: run-in and wear.
            TimeDrift = "time-drift" in time_drift,
            /// `F_C += k |tau_L|`, `F_S` likewise: the transmitted torque loads the gear.
            LoadTorqueCoulomb = "load-torque-coulomb" in load_torque_coulomb,
            /// `+ J dv/dt`: an inertia that was not subtracted from the torque.
            UnmodelledInertia = "unmodelled-inertia" in unmodelled_inertia,
            /// The bristle stiffness is reduced while the drive crosses its play.
            Backlash = "backlash" in backlash,
            /// `exp(-|v/v_s|^delta)`: the Stribeck curve with another exponent.
            StribeckShape = "stribeck-shape" in stribeck_shape,
            /// `v(t - d)`: velocity and torque are logged with a time offset.
            ChannelDelay = "channel-delay" in channel_delay,
            /// `+ k tau_L`: the known load in the scale of the torque channel. It is a rigid-body part, not a cause.
            LoadGain = "load-gain" in load_gain,
            /// `+ t(x)`, `g *= 1 + l(x)`, both piecewise linear over one column: structure that no named
            /// cause explains, and calibration errors that depend on a covariate.
            LookupTable = "unknown" in lookup_table,
            /// `+ sum a_k sin(n_k q) + b_k cos(n_k q)`: cogging and gear mesh.
            TorqueRipple = "torque-ripple" in torque_ripple,
            /// `g *= exp(-b (T - T0))`: the seal stiffens at low temperature.
            TemperatureCoulomb = "temperature-coulomb" in temperature_coulomb,
            /// `g *= 1 - a (1 - exp(-E/E0))`: friction decreases as it heats the seal. `E` is the
            /// dissipated energy less cooling.
            WarmUp = "warm-up" in warm_up,
        }
    };
}
pub(crate) use term_table;

macro_rules! define_kinds {
    ($($(#[$doc:meta])* $kind:ident = $name:literal in $file:ident,)*) => {
        /// The kinds of terms, named after the causes that they explain.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum TermKind { $($(#[$doc])* $kind),* }

        impl TermKind {
            /// Every kind, ordered by number.
            pub const ALL: &'static [TermKind] = &[$(TermKind::$kind),*];

            /// Returns the name used in model names, files and findings.
            pub const fn name(self) -> &'static str {
                match self { $(TermKind::$kind => $name),* }
            }

            /// Returns the name as a refusal contains it.
            pub const fn text(self) -> Text {
                match self { $(TermKind::$kind => crate::text!($name)),* }
            }

            /// Returns the parameters of this kind.
            #[inline(never)]
            pub const fn parameters(self) -> &'static [ParameterId] {
                match self { $(TermKind::$kind => <$file::$kind<f32> as Term<f32>>::PARAMETERS),* }
            }

            /// Returns the parameters that scale with a gain on the term; empty if it has no size.
            pub const fn sizes(self) -> &'static [ParameterId] {
                match self { $(TermKind::$kind => <$file::$kind<f32> as Term<f32>>::SIZES),* }
            }

            /// Returns the quantity that the term requires.
            ///
            /// `None` if it needs only velocity, acceleration or time, which every log has, or if a
            /// parameter selects its column.
            pub const fn reads(self) -> Option<Quantity> {
                match self { $(TermKind::$kind => <$file::$kind<f32> as Term<f32>>::READS),* }
            }

            /// Returns true if the term acts before all others, because they depend on its effect.
            pub const fn is_applied_first(self) -> bool {
                match self { $(TermKind::$kind => <$file::$kind<f32> as Term<f32>>::IS_APPLIED_FIRST),* }
            }

            /// Widens the bounds of a law's quantities by the effect of the term within the envelope.
            pub(crate) fn widen<S: Real>(
                self,
                values: &ParameterValues<S>,
                envelope: &Envelope,
                bounds: &mut Bounds,
            ) {
                match self {
                    $(TermKind::$kind => $file::$kind::<f32>::widen(values, envelope, bounds)),*
                }
            }

            /// Checks the conditions that the ranges of the single parameters do not cover.
            pub(crate) fn validate<S: Real>(
                self,
                values: &ParameterValues<S>,
                envelope: &Envelope,
            ) -> Result<(), ParameterError> {
                match self { $(TermKind::$kind => $file::$kind::<f32>::validate(values, envelope)),* }
            }
        }
    };
}

term_table!(define_kinds);

impl TermKind {
    /// Returns the kind with this name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|kind| kind.name() == name)
    }

    /// Returns the kind with this number, which is its position in [`TermKind::ALL`].
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }
}

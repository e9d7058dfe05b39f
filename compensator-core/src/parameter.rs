//! The one list of all parameters: name, units, range, default.
//!
//! Names are the field's standard terms. Units are those of a revolute joint; the second is the
//! prismatic one. Ranges are what the mathematics needs, not what a good seal has: a value at the
//! edge of its range is legal and strange. New parameters go to the *end*: their position is their
//! number in records and on CAN.

use crate::number::Real;
use crate::quantity::Quantity;

/// What is known of a parameter apart from its value.
#[derive(Clone, Copy, Debug)]
pub struct Info {
    /// Name in files, on the command line and in reports.
    pub name: &'static str,
    /// Unit for a revolute joint.
    pub unit: &'static str,
    /// Unit for a prismatic joint.
    pub unit_prismatic: &'static str,
    /// Smallest legal value.
    pub lower: f64,
    /// Largest legal value.
    pub upper: f64,
    /// Value where nothing is given: such that the parameter does nothing, where there is one.
    pub default: f64,
}

macro_rules! parameters {
    ($($(#[$doc:meta])* $id:ident = $name:literal, $unit:literal, $prismatic:literal,
       $lower:expr, $upper:expr, $default:expr;)*) => {
        /// The number and name of a parameter.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum ParameterId { $($(#[$doc])* $id),* }

        impl ParameterId {
            /// Every parameter, in the order of their numbers.
            pub const ALL: &'static [ParameterId] = &[$(ParameterId::$id),*];
        }

        /// How many parameters there are.
        pub const COUNT: usize = ParameterId::ALL.len();

        /// What is known of each, in the order of their numbers.
        pub static TABLE: [Info; COUNT] = [$(Info {
            name: $name, unit: $unit, unit_prismatic: $prismatic,
            lower: $lower, upper: $upper, default: $default,
        }),*];
    };
}

const ANY: f64 = f64::MAX;
const TINY: f64 = 1e-9;

parameters! {
    /// `F_C`, Coulomb level; of the positive side in the asymmetric law.
    CoulombTorque = "coulomb_torque", "Nm", "N", TINY, 1e6, 1.0;
    /// `F_S`, static (breakaway) level; of the positive side in the asymmetric law.
    StaticTorque = "static_torque", "Nm", "N", TINY, 1e6, 1.0;
    /// `v_s`.
    StribeckVelocity = "stribeck_velocity", "rad/s", "m/s", 1e-6, 1e3, 0.1;
    /// `sigma0`, Ding et al.'s `k0`.
    BristleStiffness = "bristle_stiffness", "Nm/rad", "N/m", 1e-3, 1e9, 1e4;
    /// `sigma1`, Ding et al.'s `k1`. Constant, or with `damping_fades` times `exp(-(v/v_s)^2)`.
    BristleDamping = "bristle_damping", "Nm s/rad", "N s/m", 0.0, 1e7, 0.0;
    /// `sigma2`, Ding et al.'s `k2`.
    ViscousFriction = "viscous_friction", "Nm s/rad", "N s/m", -1e6, 1e6, 0.0;
    /// `f1` of the extended law.
    QuadraticFriction = "quadratic_friction", "Nm s^2/rad^2", "N s^2/m^2", -ANY, ANY, 0.0;
    /// `f2` of the extended law.
    CubicFriction = "cubic_friction", "Nm s^3/rad^3", "N s^3/m^3", -ANY, ANY, 0.0;
    /// `fa` of the atan law.
    AtanTorque = "atan_torque", "Nm", "N", -1e6, 1e6, 0.0;
    /// `fb` of the atan law.
    AtanSlope = "atan_slope", "s/rad", "s/m", 1e-6, 1e6, 1.0;
    /// `F_C` of the negative side, asymmetric law.
    CoulombTorqueNegative = "coulomb_torque_negative", "Nm", "N", TINY, 1e6, 1.0;
    /// `F_S` of the negative side, asymmetric law.
    StaticTorqueNegative = "static_torque_negative", "Nm", "N", TINY, 1e6, 1.0;
    /// Coulomb torque per side load, `k_C2` of Ding et al., eq. 16.
    RadialForceCoulomb = "radial_force_coulomb", "Nm/N", "N/N", -1e3, 1e3, 0.0;
    /// What `F_S` gains per side load beyond what `F_C` gains. Ding et al. give `F_S` nothing, and its
    /// curve inverts when the loaded `F_C` passes it; 0 keeps their difference.
    RadialForceStaticExcess = "radial_force_static_excess", "Nm/N", "N/N", -1e3, 1e3, 0.0;
    /// Coulomb torque per pressure difference, `k_C1` of Ding et al., eq. 16.
    PressureCoulomb = "pressure_coulomb", "Nm/Pa", "N/Pa", -1.0, 1.0, 0.0;
    /// As `RadialForceStaticExcess`, for pressure.
    PressureStaticExcess = "pressure_static_excess", "Nm/Pa", "N/Pa", -1.0, 1.0, 0.0;
    /// `eta3`, bristle travel per side load. `eta1` of eq. 16 is 1: only `k0 eta1`, `k0 eta3` and
    /// `k1/k0` reach the output, so one of the four is redundant.
    RadialForceRate = "radial_force_rate", "rad/N", "m/N", -1.0, 1.0, 0.0;
    /// `b`, relative fall of the viscous coefficient per kelvin.
    TemperatureViscosity = "temperature_viscosity", "1/K", "1/K", -1.0, 1.0, 0.0;
    /// `T0`, where viscous coefficient and levels have their stated values.
    TemperatureReference = "temperature_reference", "degC", "degC", -50.0, 150.0, 20.0;
    /// Relative ripple of the level with the sine of `n q`.
    RippleSine = "ripple_sine", "1", "1", -0.99, 0.99, 0.0;
    /// Relative ripple of the level with the cosine of `n q`.
    RippleCosine = "ripple_cosine", "1", "1", -0.99, 0.99, 0.0;
    /// `n`, angular order of the ripple: `n` periods in one turn for a revolute joint.
    RippleOrder = "ripple_order", "1/rad", "rad/m", 0.0, 1e5, 1.0;
    /// Torque with the sine of the position.
    GravitySine = "gravity_sine", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque with the cosine of the position.
    GravityCosine = "gravity_cosine", "Nm", "N", -1e6, 1e6, 0.0;
    /// `a`: the level is `1 + a` forwards and `1 - a` backwards.
    CoulombAsymmetry = "coulomb_asymmetry", "1", "1", -0.99, 0.99, 0.0;
    /// As `CoulombAsymmetry`, for the viscous coefficient.
    ViscousAsymmetry = "viscous_asymmetry", "1", "1", -10.0, 10.0, 0.0;
    /// Constant torque; `f0` of the atan law.
    TorqueOffset = "torque_offset", "Nm", "N", -1e6, 1e6, 0.0;
    /// `c` of water drag.
    QuadraticDrag = "quadratic_drag", "Nm s^2/rad^2", "N s^2/m^2", -ANY, ANY, 0.0;
    /// `k`, static level per e-fold of contact age.
    DwellGain = "dwell_gain", "Nm", "N", 0.0, 1e6, 0.0;
    /// `t0`, contact age at which the growth sets in.
    DwellTime = "dwell_time", "s", "s", 1e-3, 1e6, 1.0;
    /// Travel after which the contact is new and its age forgotten.
    DwellTravel = "dwell_travel", "rad", "m", 1e-6, 1e3, 1e-2;
    /// `a` of run-in.
    DriftAmplitude = "drift_amplitude", "1", "1", -0.99, 100.0, 0.0;
    /// `T` of run-in.
    DriftTime = "drift_time", "s", "s", 1.0, 1e9, 3600.0;
    /// `r`, relative change of the level per second (wear).
    DriftRate = "drift_rate", "1/s", "1/s", -1.0, 1.0, 0.0;
    /// Level per transmitted torque.
    LoadCoulomb = "load_coulomb", "Nm/Nm", "N/Nm", -1e3, 1e3, 0.0;
    /// Inertia not taken out of the torque.
    Inertia = "inertia", "kg m^2", "kg", -1e6, 1e6, 0.0;
    /// `b`, travel of the play.
    BacklashTravel = "backlash_travel", "rad", "m", 0.0, 10.0, 0.0;
    /// Stiffness within the play over stiffness in contact.
    BacklashStiffnessRatio = "backlash_stiffness_ratio", "1", "1", 0.0, 1.0, 0.02;
    /// `delta`, exponent of the Stribeck curve.
    StribeckExponent = "stribeck_exponent", "1", "1", 0.2, 8.0, 2.0;
    /// `d`: torque answers the velocity of `d` ago.
    ChannelDelay = "channel_delay", "s", "s", 0.0, 10.0, 0.0;
    /// Gain on the transmitted torque.
    LoadGain = "load_gain", "Nm/Nm", "N/Nm", -1e6, 1e6, 0.0;
    /// Which column the term of unknown cause follows: the number of a column of
    /// [`crate::quantity::Info`].
    LookupColumn = "unknown_column", "1", "1", 0.0, Quantity::LAST_COLUMN as f64, 0.0;
    /// Where the term's first knot lies; its unit is that of its column: rad/s, rad, s, N, Pa, degC,
    /// Nm, or the auxiliary column's own.
    LookupLower = "unknown_lower", "of the column", "of the column", -1e12, 1e12, 0.0;
    /// Where its last knot lies. The others are evenly spread between.
    LookupUpper = "unknown_upper", "of the column", "of the column", -1e12, 1e12, 1.0;
    /// Torque of unknown cause at its first knot, whichever way the joint moves.
    LookupTorque1 = "unknown_torque_1", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque of unknown cause at its second knot, whichever way the joint moves.
    LookupTorque2 = "unknown_torque_2", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque of unknown cause at its third knot, whichever way the joint moves.
    LookupTorque3 = "unknown_torque_3", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque of unknown cause at its fourth knot, whichever way the joint moves.
    LookupTorque4 = "unknown_torque_4", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque of unknown cause at its fifth knot, whichever way the joint moves.
    LookupTorque5 = "unknown_torque_5", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque of unknown cause at its sixth knot, whichever way the joint moves.
    LookupTorque6 = "unknown_torque_6", "Nm", "N", -1e6, 1e6, 0.0;
    /// Relative change of the level, of unknown cause, at its first knot.
    LookupLevel1 = "unknown_level_1", "1", "1", -0.9, 10.0, 0.0;
    /// Relative change of the level, of unknown cause, at its second knot.
    LookupLevel2 = "unknown_level_2", "1", "1", -0.9, 10.0, 0.0;
    /// Relative change of the level, of unknown cause, at its third knot.
    LookupLevel3 = "unknown_level_3", "1", "1", -0.9, 10.0, 0.0;
    /// Relative change of the level, of unknown cause, at its fourth knot.
    LookupLevel4 = "unknown_level_4", "1", "1", -0.9, 10.0, 0.0;
    /// Relative change of the level, of unknown cause, at its fifth knot.
    LookupLevel5 = "unknown_level_5", "1", "1", -0.9, 10.0, 0.0;
    /// Relative change of the level, of unknown cause, at its sixth knot.
    LookupLevel6 = "unknown_level_6", "1", "1", -0.9, 10.0, 0.0;
    /// First angular order of a torque ripple: periods in one turn for a revolute joint; 0 is none.
    TorqueRippleOrder1 = "torque_ripple_order_1", "1/rad", "rad/m", 0.0, 1e5, 1.0;
    /// Torque with the sine of the first order's angle.
    TorqueRippleSine1 = "torque_ripple_sine_1", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque with its cosine.
    TorqueRippleCosine1 = "torque_ripple_cosine_1", "Nm", "N", -1e6, 1e6, 0.0;
    /// Second angular order of a torque ripple: periods in one turn for a revolute joint; 0 is none.
    TorqueRippleOrder2 = "torque_ripple_order_2", "1/rad", "rad/m", 0.0, 1e5, 0.0;
    /// Torque with the sine of the second order's angle.
    TorqueRippleSine2 = "torque_ripple_sine_2", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque with its cosine.
    TorqueRippleCosine2 = "torque_ripple_cosine_2", "Nm", "N", -1e6, 1e6, 0.0;
    /// Third angular order of a torque ripple: periods in one turn for a revolute joint; 0 is none.
    TorqueRippleOrder3 = "torque_ripple_order_3", "1/rad", "rad/m", 0.0, 1e5, 0.0;
    /// Torque with the sine of the third order's angle.
    TorqueRippleSine3 = "torque_ripple_sine_3", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque with its cosine.
    TorqueRippleCosine3 = "torque_ripple_cosine_3", "Nm", "N", -1e6, 1e6, 0.0;
    /// Fourth angular order of a torque ripple: periods in one turn for a revolute joint; 0 is none.
    TorqueRippleOrder4 = "torque_ripple_order_4", "1/rad", "rad/m", 0.0, 1e5, 0.0;
    /// Torque with the sine of the fourth order's angle.
    TorqueRippleSine4 = "torque_ripple_sine_4", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque with its cosine.
    TorqueRippleCosine4 = "torque_ripple_cosine_4", "Nm", "N", -1e6, 1e6, 0.0;
    /// `b`, relative fall of the levels per kelvin.
    TemperatureCoulomb = "temperature_coulomb", "1/K", "1/K", -1.0, 1.0, 0.0;
    /// By which formula the level follows the column of unknown cause: 0 none, 1 linear, 2 saturating,
    /// 3 exponential.
    LookupFormula = "unknown_formula", "1", "1", 0.0, 3.0, 0.0;
    /// Relative change of the level by the formula from the first knot to the last.
    LookupRise = "unknown_rise", "1", "1", -0.9, 10.0, 0.0;
    /// How far from the first knot a saturating formula has risen by half of what it ever will.
    LookupScale = "unknown_scale", "of the column", "of the column", 1e-12, 1e12, 1.0;
    /// Where the play is crossed: 0 right after a reversal, the held torque staying what it is; 1 once the
    /// drive has unwound and holds nothing.
    BacklashUnloaded = "backlash_unloaded", "1", "1", 0.0, 1.0, 0.0;
    /// `a`, share of the level that goes with warming.
    WarmUpFall = "warm_up_fall", "1", "1", -0.9, 0.9, 0.0;
    /// `E0`, dissipated energy after which 63 % of that has gone.
    WarmUpEnergy = "warm_up_energy", "J", "J", 1e-3, 1e9, 1e3;
    /// `T`, time in which the heat is lost again.
    WarmUpCooling = "warm_up_cooling", "s", "s", 5.0, 1e9, 600.0;
}

/// A value of each parameter, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values<S>([S; COUNT]);

impl<S: Real> Values<S> {
    /// Every parameter at its default.
    // Out of line: each place it is written out in is a store for each parameter.
    #[inline(never)]
    pub fn new() -> Self {
        Self(TABLE.each_ref().map(|info| S::from_f64(info.default)))
    }

    /// The value of a parameter.
    #[inline]
    pub fn get(&self, id: ParameterId) -> S {
        self.0.get(id as usize).copied().unwrap_or_default()
    }

    /// Sets a parameter.
    pub fn set(&mut self, id: ParameterId, value: S) {
        if let Some(slot) = self.0.get_mut(id as usize) {
            *slot = value;
        }
    }

    /// The value of a parameter as `f64`.
    pub fn value(&self, id: ParameterId) -> f64 {
        self.get(id).value()
    }

    /// The same values in another number.
    pub fn convert<R: Real>(&self) -> Values<R> {
        Values(self.0.map(|value| R::from_f64(value.value())))
    }
}

impl<S: Real> Default for Values<S> {
    fn default() -> Self {
        Self::new()
    }
}

impl ParameterId {
    /// What is known of the parameter.
    pub fn info(self) -> &'static Info {
        // In bounds: the table has a row for each variant.
        &TABLE[self as usize]
    }

    /// Name in files and reports.
    pub fn name(self) -> &'static str {
        self.info().name
    }

    /// The parameter with this name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|id| id.name() == name)
    }
}

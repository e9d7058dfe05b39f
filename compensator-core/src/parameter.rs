//! The list of all parameters: name, units, range and default.
//!
//! The first unit is that of a revolute joint, the second that of a prismatic joint. A range is the range in
//! which the equations are valid. It is wider than the range of typical values. The position of a parameter is
//! its number in records and on CAN, so a new parameter goes at the end.

use crate::number::Real;
use crate::quantity::Quantity;
use crate::refusal::Text;

/// Static description of a parameter.
#[derive(Clone, Copy, Debug)]
pub struct ParameterInfo {
    /// Minimum legal value.
    pub lower: f64,
    /// Maximum legal value.
    pub upper: f64,
    /// Value if none is given. If a value exists that has no effect, it is the default.
    pub default: f64,
}

macro_rules! parameters {
    ($($(#[$doc:meta])* $id:ident = $name:literal, $unit:literal, $prismatic:literal,
       $lower:expr, $upper:expr, $default:expr;)*) => {
        /// Identifies a parameter. The discriminant is its number.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum ParameterId { $($(#[$doc])* $id),* }

        impl ParameterId {
            /// Every parameter, ordered by number.
            pub const ALL: &'static [ParameterId] = &[$(ParameterId::$id),*];
        }

        /// Number of parameters.
        pub const COUNT: usize = ParameterId::ALL.len();

        /// Description of each parameter, ordered by number.
        pub static TABLE: [ParameterInfo; COUNT] = [$(ParameterInfo {
            lower: $lower, upper: $upper, default: $default,
        }),*];

        /// Ranges in single precision, in which a driver checks them.
        static RANGES: [[f32; 2]; COUNT] = [$([$lower as f32, $upper as f32]),*];

        /// Names of the parameters. The tables of texts are apart, because the image of a driver needs few of them.
        static NAMES: [&str; COUNT] = [$($name),*];

        /// Names as a refusal contains them.
        static TEXTS: [Text; COUNT] = Text::all([$($name),*]);

        /// Units of each parameter, for a revolute and a prismatic joint.
        static UNITS: [[&str; 2]; COUNT] = [$([$unit, $prismatic]),*];

        impl<S: Real> ParameterValues<S> {
            /// Creates the values with every parameter at its default.
            // Out of line, because each inlined copy has one store per parameter.
            #[inline(never)]
            pub fn new() -> Self {
                Self([$(S::from_f64($default)),*])
            }
        }
    };
}

/// Bound of a parameter that any finite value satisfies.
const ANY: f64 = f64::MAX;
/// Minimum of a parameter that must be positive.
const TINY: f64 = 1e-9;

parameters! {
    /// `F_C`, Coulomb level. In the asymmetric law, it applies to the positive direction.
    CoulombTorque = "coulomb_torque", "Nm", "N", TINY, 1e6, 1.0;
    /// `F_S`, static (breakaway) level. In the asymmetric law, it applies to the positive direction.
    StaticTorque = "static_torque", "Nm", "N", TINY, 1e6, 1.0;
    /// `v_s`, Stribeck velocity.
    StribeckVelocity = "stribeck_velocity", "rad/s", "m/s", 1e-6, 1e3, 0.1;
    /// `sigma0`, bristle stiffness; `k0` in Ding et al.
    BristleStiffness = "bristle_stiffness", "Nm/rad", "N/m", 1e-3, 1e9, 1e4;
    /// `sigma1`, bristle damping; `k1` in Ding et al. With `damping_fades`, it is multiplied by `exp(-(v/v_s)^2)`.
    BristleDamping = "bristle_damping", "Nm s/rad", "N s/m", 0.0, 1e7, 0.0;
    /// `sigma2`, viscous coefficient; `k2` in Ding et al.
    ViscousFriction = "viscous_friction", "Nm s/rad", "N s/m", -1e6, 1e6, 0.0;
    /// `f1`, quadratic coefficient of the extended law.
    QuadraticFriction = "quadratic_friction", "Nm s^2/rad^2", "N s^2/m^2", -ANY, ANY, 0.0;
    /// `f2`, cubic coefficient of the extended law.
    CubicFriction = "cubic_friction", "Nm s^3/rad^3", "N s^3/m^3", -ANY, ANY, 0.0;
    /// `fa`, amplitude of the arc tangent in the atan law.
    AtanTorque = "atan_torque", "Nm", "N", -1e6, 1e6, 0.0;
    /// `fb`, slope of the arc tangent in the atan law.
    AtanSlope = "atan_slope", "s/rad", "s/m", 1e-6, 1e6, 1.0;
    /// `F_C` of the negative direction in the asymmetric law.
    CoulombTorqueNegative = "coulomb_torque_negative", "Nm", "N", TINY, 1e6, 1.0;
    /// `F_S` of the negative direction in the asymmetric law.
    StaticTorqueNegative = "static_torque_negative", "Nm", "N", TINY, 1e6, 1.0;
    /// Coulomb torque per side load; `k_C2` in Ding et al., eq. 16.
    RadialForceCoulomb = "radial_force_coulomb", "Nm/N", "N/N", -1e3, 1e3, 0.0;
    /// Increase of `F_S - F_C` per side load. With 0, the difference is constant. In Ding et al., `F_S` does
    /// not depend on the side load, so the Stribeck curve inverts when the loaded `F_C` exceeds `F_S`.
    RadialForceStaticExcess = "radial_force_static_excess", "Nm/N", "N/N", -1e3, 1e3, 0.0;
    /// Coulomb torque per pressure difference; `k_C1` in Ding et al., eq. 16.
    PressureCoulomb = "pressure_coulomb", "Nm/Pa", "N/Pa", -1.0, 1.0, 0.0;
    /// Increase of `F_S - F_C` per pressure difference.
    PressureStaticExcess = "pressure_static_excess", "Nm/Pa", "N/Pa", -1.0, 1.0, 0.0;
    /// `eta3`, bristle travel per side load. `eta1` of eq. 16 is set to 1: the output depends only on
    /// `k0 eta1`, `k0 eta3` and `k1/k0`, so one of the four coefficients is redundant.
    RadialForceRate = "radial_force_rate", "rad/N", "m/N", -1.0, 1.0, 0.0;
    /// `b`, relative decrease of the viscous coefficient per kelvin.
    TemperatureViscosity = "temperature_viscosity", "1/K", "1/K", -1.0, 1.0, 0.0;
    /// `T0`, temperature at which the viscous coefficient and the levels have their nominal values.
    TemperatureReference = "temperature_reference", "degC", "degC", -50.0, 150.0, 20.0;
    /// Relative ripple of the level, factor of `sin(n q)`.
    RippleSine = "ripple_sine", "1", "1", -0.99, 0.99, 0.0;
    /// Relative ripple of the level, factor of `cos(n q)`.
    RippleCosine = "ripple_cosine", "1", "1", -0.99, 0.99, 0.0;
    /// `n`, angular order of the ripple: `n` periods per turn of a revolute joint.
    RippleOrder = "ripple_order", "1/rad", "rad/m", 0.0, 1e5, 1.0;
    /// Gravity torque, factor of the sine of the position.
    GravitySine = "gravity_sine", "Nm", "N", -1e6, 1e6, 0.0;
    /// Gravity torque, factor of the cosine of the position.
    GravityCosine = "gravity_cosine", "Nm", "N", -1e6, 1e6, 0.0;
    /// `a`, relative asymmetry of the level: its factor is `1 + a` in positive and `1 - a` in negative direction.
    CoulombAsymmetry = "coulomb_asymmetry", "1", "1", -0.99, 0.99, 0.0;
    /// Relative asymmetry of the viscous coefficient, defined as `CoulombAsymmetry`.
    ViscousAsymmetry = "viscous_asymmetry", "1", "1", -10.0, 10.0, 0.0;
    /// Constant torque; `f0` in the atan law.
    TorqueOffset = "torque_offset", "Nm", "N", -1e6, 1e6, 0.0;
    /// `c`, coefficient of the quadratic drag in water.
    QuadraticDrag = "quadratic_drag", "Nm s^2/rad^2", "N s^2/m^2", -ANY, ANY, 0.0;
    /// `k`, increase of the static level per e-fold of the contact age.
    DwellGain = "dwell_gain", "Nm", "N", 0.0, 1e6, 0.0;
    /// `t0`, contact age at which the increase of the static level begins.
    DwellTime = "dwell_time", "s", "s", 1e-3, 1e6, 1.0;
    /// Travel that renews the contact and so resets its age.
    DwellTravel = "dwell_travel", "rad", "m", 1e-6, 1e3, 1e-2;
    /// `a`, relative amplitude of the run-in.
    DriftAmplitude = "drift_amplitude", "1", "1", -0.99, 100.0, 0.0;
    /// `T`, time constant of the run-in.
    DriftTime = "drift_time", "s", "s", 1.0, 1e9, 3600.0;
    /// `r`, relative change of the level per second (wear).
    DriftRate = "drift_rate", "1/s", "1/s", -1.0, 1.0, 0.0;
    /// Increase of the levels per transmitted torque.
    LoadCoulomb = "load_coulomb", "Nm/Nm", "N/Nm", -1e3, 1e3, 0.0;
    /// Inertia that was not subtracted from the torque.
    Inertia = "inertia", "kg m^2", "kg", -1e6, 1e6, 0.0;
    /// `b`, travel of the play.
    BacklashTravel = "backlash_travel", "rad", "m", 0.0, 10.0, 0.0;
    /// Ratio of the stiffness within the play to the stiffness in contact.
    BacklashStiffnessRatio = "backlash_stiffness_ratio", "1", "1", 0.0, 1.0, 0.02;
    /// `delta`, exponent of the Stribeck curve.
    StribeckExponent = "stribeck_exponent", "1", "1", 0.2, 8.0, 2.0;
    /// `d`, delay: the torque corresponds to the velocity at the time `t - d`.
    ChannelDelay = "channel_delay", "s", "s", 0.0, 10.0, 0.0;
    /// Gain on the transmitted torque.
    LoadGain = "load_gain", "Nm/Nm", "N/Nm", -1e6, 1e6, 0.0;
    /// Number of the column that the lookup table uses as input, from [`crate::quantity::QuantityInfo`].
    LookupColumn = "unknown_column", "1", "1", 0.0, Quantity::MAX_COLUMN_NUMBER as f64, 0.0;
    /// Position of the first knot of the lookup table, in the unit of the column: rad/s, rad, s, N, Pa, degC,
    /// Nm, or the unit of the auxiliary column.
    LookupLower = "unknown_lower", "of the column", "of the column", -1e12, 1e12, 0.0;
    /// Position of the last knot of the lookup table. The other knots are evenly spaced between.
    LookupUpper = "unknown_upper", "of the column", "of the column", -1e12, 1e12, 1.0;
    /// Torque of the lookup table at its first knot, independent of direction.
    LookupTorque1 = "unknown_torque_1", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque of the lookup table at its second knot, independent of direction.
    LookupTorque2 = "unknown_torque_2", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque of the lookup table at its third knot, independent of direction.
    LookupTorque3 = "unknown_torque_3", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque of the lookup table at its fourth knot, independent of direction.
    LookupTorque4 = "unknown_torque_4", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque of the lookup table at its fifth knot, independent of direction.
    LookupTorque5 = "unknown_torque_5", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque of the lookup table at its sixth knot, independent of direction.
    LookupTorque6 = "unknown_torque_6", "Nm", "N", -1e6, 1e6, 0.0;
    /// Relative change of the level by the lookup table at its first knot.
    LookupLevel1 = "unknown_level_1", "1", "1", -0.9, 10.0, 0.0;
    /// Relative change of the level by the lookup table at its second knot.
    LookupLevel2 = "unknown_level_2", "1", "1", -0.9, 10.0, 0.0;
    /// Relative change of the level by the lookup table at its third knot.
    LookupLevel3 = "unknown_level_3", "1", "1", -0.9, 10.0, 0.0;
    /// Relative change of the level by the lookup table at its fourth knot.
    LookupLevel4 = "unknown_level_4", "1", "1", -0.9, 10.0, 0.0;
    /// Relative change of the level by the lookup table at its fifth knot.
    LookupLevel5 = "unknown_level_5", "1", "1", -0.9, 10.0, 0.0;
    /// Relative change of the level by the lookup table at its sixth knot.
    LookupLevel6 = "unknown_level_6", "1", "1", -0.9, 10.0, 0.0;
    /// First angular order of the torque ripple: periods per turn of a revolute joint; 0 disables it.
    TorqueRippleOrder1 = "torque_ripple_order_1", "1/rad", "rad/m", 0.0, 1e5, 1.0;
    /// Torque ripple, factor of the sine of the first order.
    TorqueRippleSine1 = "torque_ripple_sine_1", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque ripple, factor of the cosine of the first order.
    TorqueRippleCosine1 = "torque_ripple_cosine_1", "Nm", "N", -1e6, 1e6, 0.0;
    /// Second angular order of the torque ripple: periods per turn of a revolute joint; 0 disables it.
    TorqueRippleOrder2 = "torque_ripple_order_2", "1/rad", "rad/m", 0.0, 1e5, 0.0;
    /// Torque ripple, factor of the sine of the second order.
    TorqueRippleSine2 = "torque_ripple_sine_2", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque ripple, factor of the cosine of the second order.
    TorqueRippleCosine2 = "torque_ripple_cosine_2", "Nm", "N", -1e6, 1e6, 0.0;
    /// Third angular order of the torque ripple: periods per turn of a revolute joint; 0 disables it.
    TorqueRippleOrder3 = "torque_ripple_order_3", "1/rad", "rad/m", 0.0, 1e5, 0.0;
    /// Torque ripple, factor of the sine of the third order.
    TorqueRippleSine3 = "torque_ripple_sine_3", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque ripple, factor of the cosine of the third order.
    TorqueRippleCosine3 = "torque_ripple_cosine_3", "Nm", "N", -1e6, 1e6, 0.0;
    /// Fourth angular order of the torque ripple: periods per turn of a revolute joint; 0 disables it.
    TorqueRippleOrder4 = "torque_ripple_order_4", "1/rad", "rad/m", 0.0, 1e5, 0.0;
    /// Torque ripple, factor of the sine of the fourth order.
    TorqueRippleSine4 = "torque_ripple_sine_4", "Nm", "N", -1e6, 1e6, 0.0;
    /// Torque ripple, factor of the cosine of the fourth order.
    TorqueRippleCosine4 = "torque_ripple_cosine_4", "Nm", "N", -1e6, 1e6, 0.0;
    /// `b`, relative decrease of the levels per kelvin.
    TemperatureCoulomb = "temperature_coulomb", "1/K", "1/K", -1.0, 1.0, 0.0;
    /// Formula by which the level depends on the column of the lookup table: 0 none, 1 linear,
    /// 2 saturating, 3 exponential.
    LookupFormula = "unknown_formula", "1", "1", 0.0, 3.0, 0.0;
    /// Relative change of the level from the first to the last knot, by the formula.
    LookupRise = "unknown_rise", "1", "1", -0.9, 10.0, 0.0;
    /// Distance from the first knot at which the saturating formula reaches half of its limit.
    LookupScale = "unknown_scale", "of the column", "of the column", 1e-12, 1e12, 1.0;
    /// Point at which the drive crosses the play. 0: directly after a reversal, at constant bristle torque.
    /// 1: when the bristle torque has returned to zero.
    BacklashUnloaded = "backlash_unloaded", "1", "1", 0.0, 1.0, 0.0;
    /// `a`, share of the level that is lost by warming.
    WarmUpFall = "warm_up_fall", "1", "1", -0.9, 0.9, 0.0;
    /// `E0`, dissipated energy after which 63 % of this share is lost, without cooling.
    WarmUpEnergy = "warm_up_energy", "J", "J", 1e-3, 1e9, 1e3;
    /// `T`, time constant of the cooling.
    WarmUpCooling = "warm_up_cooling", "s", "s", 5.0, 1e9, 600.0;
}

/// Values of all parameters, each in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterValues<S>([S; COUNT]);

impl<S: Real> ParameterValues<S> {
    /// Returns the value of a parameter.
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

    /// Returns the value of a parameter in single precision: see [`Real::single`].
    pub(crate) fn single(&self, id: ParameterId) -> f32 {
        self.get(id).single()
    }

    /// Returns the value of a parameter as `f64`.
    pub fn value(&self, id: ParameterId) -> f64 {
        self.get(id).value()
    }

    /// Converts the values to another number type.
    pub fn convert<R: Real>(&self) -> ParameterValues<R> {
        ParameterValues(self.0.map(|value| R::from_f64(value.value())))
    }
}

impl<S: Real> Default for ParameterValues<S> {
    fn default() -> Self {
        Self::new()
    }
}

impl ParameterId {
    /// Returns the description of the parameter.
    pub fn info(self) -> &'static ParameterInfo {
        // In bounds: the table has a row for each variant.
        &TABLE[self as usize]
    }

    /// Returns minimum and maximum legal value in single precision.
    pub fn range(self) -> [f32; 2] {
        RANGES[self as usize]
    }

    /// Returns the name in files and reports.
    pub fn name(self) -> &'static str {
        NAMES[self as usize]
    }

    /// Returns the name as a refusal contains it.
    pub fn text(self) -> Text {
        TEXTS[self as usize]
    }

    /// Returns the unit for a revolute joint.
    pub fn unit(self) -> &'static str {
        UNITS[self as usize][0]
    }

    /// Returns the unit for a prismatic joint.
    pub fn unit_prismatic(self) -> &'static str {
        UNITS[self as usize][1]
    }

    /// Returns the parameter with this name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|id| id.name() == name)
    }
}

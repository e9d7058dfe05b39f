//! How a fit and a diagnosis treat each parameter, in one table.
//!
//! A parameter without a row is free and may have any value, as most parameters of terms. A row restricts the values
//! (positive within a range, not negative with a typical size, not below another parameter), fixes a parameter unless
//! the options free it, or marks it as a friction level.

use super::scales::Scales;
use ParameterId as Id;
use compensator_core::{LawKind, ParameterId};

/// Values that a fit may choose.
#[derive(Clone, Copy)]
pub enum Values {
    /// Any value.
    Any,
    /// Positive values, on a logarithmic scale, within the legal range and this one. Beyond this range the effect on the rows
    /// is that at the bound.
    Positive(fn(&Scales) -> (f64, f64)),
    /// Values from 0, with this typical size.
    NotNegative(fn(&Scales) -> f64),
    /// Values from 0 of a factor of a regressor, with this typical size. The rows determine it like any other factor.
    FactorNotNegative(fn(&Scales) -> f64),
    /// Values whose magnitude is below this.
    Below(f64),
    /// Values from that of another parameter.
    NotBelow(ParameterId),
}

/// Treatment of a parameter.
#[derive(Clone, Copy)]
pub struct Treatment {
    /// Values that a fit may choose.
    pub values: Values,
    /// True if the parameter keeps its start value unless the options free it: choices, and parameters that data rarely
    /// determine.
    pub is_fixed_by_default: bool,
    /// True for the parameters to which, together, the friction level is proportional.
    pub is_level: bool,
    /// Meaning of a value at the bound, for the report.
    pub at_bound: &'static str,
}

const FREE: Treatment = Treatment {
    values: Values::Any,
    is_fixed_by_default: false,
    is_level: false,
    at_bound: "the end of its legal range",
};

const FIXED: Treatment = Treatment { is_fixed_by_default: true, ..FREE };

const LEVEL: Treatment = Treatment { is_level: true, ..FREE };

const fn positive(range: fn(&Scales) -> (f64, f64)) -> Treatment {
    Treatment { values: Values::Positive(range), ..FREE }
}

const fn not_negative(typical: fn(&Scales) -> f64, at_bound: &'static str) -> Treatment {
    Treatment { values: Values::NotNegative(typical), at_bound, ..FREE }
}

const fn not_below(other: ParameterId, at_bound: &'static str) -> Treatment {
    Treatment { values: Values::NotBelow(other), at_bound, ..LEVEL }
}

/// No restriction besides the legal range.
const LEGAL_RANGE: fn(&Scales) -> (f64, f64) = |_| (0.0, f64::INFINITY);

/// Largest asymmetry: the level of the smaller direction is then close to 0, and beyond 1 it would drive the joint.
const MAX_ASYMMETRY: f64 = 0.99;

const NO_EFFECT: &str = "0 fits best, the effect is absent";

/// Returns the treatment of a parameter.
pub fn treatment_of(id: ParameterId) -> Treatment {
    match id {
        // At most the largest torque of a log whose joint often rests.
        Id::CoulombTorque | Id::CoulombTorqueNegative => Treatment {
            values: Values::Positive(|scales| (1e-4 * scales.torque, 4.0 * scales.torque)),
            ..LEVEL
        },
        Id::StaticTorque => {
            not_below(Id::CoulombTorque, "F_S = F_C, the data show no Stribeck effect")
        }
        Id::StaticTorqueNegative => not_below(
            Id::CoulombTorqueNegative,
            "F_S = F_C backwards, the data show no Stribeck effect",
        ),
        // A speed that several rows do not exceed, and several do.
        Id::StribeckVelocity => positive(|scales| {
            ((1e-3 * scales.speed).max(0.3 * scales.slow_speed), 2.0 * scales.speed)
        }),
        // A presliding travel between the motion from row to row and the swing, for levels from a hundredth of the torque.
        Id::BristleStiffness => positive(|scales| {
            let step = scales.slow_speed * scales.period_s;
            (0.01 * scales.torque / scales.swing, 3.0 * scales.torque / step)
        }),
        Id::ViscousFriction => Treatment {
            values: Values::FactorNotNegative(|scales| scales.torque / scales.speed),
            at_bound: "0 fits best: friction does not grow with speed over this range",
            ..FREE
        },
        Id::Inertia => Treatment {
            values: Values::FactorNotNegative(|scales| scales.torque / scales.acceleration),
            at_bound: NO_EFFECT,
            ..FREE
        },
        Id::CoulombAsymmetry | Id::ViscousAsymmetry => Treatment {
            values: Values::Below(MAX_ASYMMETRY),
            at_bound: "one direction has no friction",
            ..FREE
        },
        Id::BristleDamping => {
            not_negative(|scales| 0.1 * scales.torque / scales.speed, "0 fits best")
        }
        Id::AtanSlope => positive(|scales| (1e-2 / scales.speed, 1e4 / scales.speed)),
        Id::RadialForceCoulomb | Id::PressureCoulomb | Id::LoadCoulomb => LEVEL,
        Id::RadialForceStaticExcess => FIXED,
        Id::PressureStaticExcess => Treatment { is_level: true, ..FIXED },
        Id::TemperatureReference | Id::BacklashStiffnessRatio | Id::BacklashUnloaded => FIXED,
        Id::RippleOrder
        | Id::TorqueRippleOrder1
        | Id::TorqueRippleOrder2
        | Id::TorqueRippleOrder3
        | Id::TorqueRippleOrder4
        | Id::StribeckExponent
        | Id::DwellTime => positive(LEGAL_RANGE),
        Id::DwellTravel => Treatment { values: Values::Positive(LEGAL_RANGE), ..FIXED },
        Id::DwellGain => {
            Treatment { is_level: true, ..not_negative(|scales| 0.1 * scales.torque, NO_EFFECT) }
        }
        Id::DriftTime => positive(|scales| (1e-2 * scales.campaign_s, 1e2 * scales.campaign_s)),
        Id::BacklashTravel => not_negative(|scales| 0.01 * scales.travel, NO_EFFECT),
        Id::ChannelDelay => not_negative(|scales| scales.period_s, NO_EFFECT),
        // Column and range are choices; only the curve is fitted.
        Id::LookupColumn | Id::LookupLower | Id::LookupUpper | Id::LookupFormula => FIXED,
        Id::LookupScale => positive(LEGAL_RANGE),
        Id::WarmUpEnergy | Id::WarmUpCooling => positive(LEGAL_RANGE),
        _ => FREE,
    }
}

/// Returns the values that a fit of a law may choose. In a curve of several parts the sign of one coefficient is free.
pub fn values(law: LawKind, id: ParameterId) -> Values {
    match (law, id) {
        (LawKind::Extended | LawKind::Atan, Id::ViscousFriction) => Values::Any,
        _ => treatment_of(id).values,
    }
}

/// Returns the range in which a positive parameter is searched, inside its legal range.
pub fn bounds(id: ParameterId, range: fn(&Scales) -> (f64, f64), scales: &Scales) -> (f64, f64) {
    let (least, most) = range(scales);
    // For a vanishing torque or motion the range may be empty: then it is a single value.
    let least = least.max(id.info().lower).min(id.info().upper);
    (least, most.min(id.info().upper).max(least))
}

/// Returns the typical size of a parameter that cannot be negative, and 1 for any other.
pub fn typical_value(id: ParameterId, scales: &Scales) -> f64 {
    match treatment_of(id).values {
        Values::NotNegative(typical) | Values::FactorNotNegative(typical) => typical(scales),
        _ => 1.0,
    }
}

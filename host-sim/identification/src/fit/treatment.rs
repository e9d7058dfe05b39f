//! How a fit and a diagnosis treat each parameter: one table.
//!
//! A parameter without a row is free and may have any value: most parameters of terms are such. A row says
//! what else is known of it: that it is positive and over which decades it is sought, that it cannot be
//! negative and how large it may be expected to be, that it is not below another, that it is kept unless a
//! fit is told to free it, that the friction level is proportional to it.

use super::scales::Scales;
use ParameterId as Id;
use compensator_core::ParameterId;

/// What values a fit seeks.
#[derive(Clone, Copy)]
pub enum Values {
    /// Any.
    Any,
    /// Positive ones, by their logarithm, within its legal range and this one, beyond which it does on these
    /// rows what it does at the bound.
    Positive(fn(&Scales) -> (f64, f64)),
    /// None below 0; a size that may be expected.
    NotNegative(fn(&Scales) -> f64),
    /// None below those of another.
    NotBelow(ParameterId),
}

/// How a parameter is treated.
#[derive(Clone, Copy)]
pub struct Treatment {
    /// What values are sought.
    pub values: Values,
    /// Whether it stays where it starts unless it is freed: what is chosen, or hardly ever determined.
    pub kept: bool,
    /// Whether the friction level is proportional to all such together.
    pub is_level: bool,
    /// What it means that it ended at its bound.
    pub at_bound: &'static str,
}

const FREE: Treatment = Treatment {
    values: Values::Any,
    kept: false,
    is_level: false,
    at_bound: "the edge of its legal range",
};

const KEPT: Treatment = Treatment { kept: true, ..FREE };

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

/// As far as it is legal.
const LEGAL: fn(&Scales) -> (f64, f64) = |_| (0.0, f64::INFINITY);

const NOT_THERE: &str = "0 fits best, the effect is not there";

/// How this parameter is treated.
pub fn of(id: ParameterId) -> Treatment {
    match id {
        Id::CoulombTorque | Id::CoulombTorqueNegative => Treatment {
            values: Values::Positive(|scales| (1e-4 * scales.torque, 1e3 * scales.torque)),
            ..LEVEL
        },
        Id::StaticTorque => not_below(Id::CoulombTorque, "F_S = F_C, no Stribeck effect is seen"),
        Id::StaticTorqueNegative => {
            not_below(Id::CoulombTorqueNegative, "F_S = F_C backwards, no Stribeck effect is seen")
        }
        Id::StribeckVelocity => positive(|scales| (1e-3 * scales.speed, 1e1 * scales.speed)),
        // Presliding over a hundred times the travel, or a millionth of it.
        Id::BristleStiffness => positive(|scales| {
            (0.01 * scales.torque / scales.travel, 1e6 * scales.torque / scales.travel)
        }),
        Id::BristleDamping => {
            not_negative(|scales| 0.1 * scales.torque / scales.speed, "0 fits best")
        }
        Id::AtanSlope => positive(|scales| (1e-2 / scales.speed, 1e4 / scales.speed)),
        Id::RadialForceCoulomb | Id::PressureCoulomb | Id::LoadCoulomb => LEVEL,
        Id::RadialForceStaticExcess => KEPT,
        Id::PressureStaticExcess => Treatment { is_level: true, ..KEPT },
        Id::TemperatureReference | Id::BacklashStiffnessRatio | Id::BacklashUnloaded => KEPT,
        Id::RippleOrder
        | Id::TorqueRippleOrder1
        | Id::TorqueRippleOrder2
        | Id::TorqueRippleOrder3
        | Id::TorqueRippleOrder4
        | Id::StribeckExponent
        | Id::DwellTime => positive(LEGAL),
        Id::DwellTravel => Treatment { values: Values::Positive(LEGAL), ..KEPT },
        Id::DwellGain => {
            Treatment { is_level: true, ..not_negative(|scales| 0.1 * scales.torque, NOT_THERE) }
        }
        Id::DriftTime => positive(|scales| (1e-2 * scales.campaign_s, 1e2 * scales.campaign_s)),
        Id::BacklashTravel => not_negative(|scales| 0.01 * scales.travel, NOT_THERE),
        Id::ChannelDelay => not_negative(|scales| scales.period_s, NOT_THERE),
        // Which column, and over which range, is chosen; what happens along it is fitted.
        Id::LookupColumn | Id::LookupLower | Id::LookupUpper | Id::LookupFormula => KEPT,
        Id::LookupScale => positive(LEGAL),
        Id::WarmUpEnergy | Id::WarmUpCooling => positive(LEGAL),
        _ => FREE,
    }
}

/// Between which values a positive parameter is sought, well inside its legal range.
pub fn bounds(id: ParameterId, range: fn(&Scales) -> (f64, f64), scales: &Scales) -> (f64, f64) {
    let (least, most) = range(scales);
    // Of a torque or a motion of next to nothing there may be no such range: then it is a point.
    let least = least.max(id.info().lower).min(id.info().upper);
    (least, most.min(id.info().upper).max(least))
}

/// The size that may be expected of a parameter that cannot be negative; 1 of any other.
pub fn typical(id: ParameterId, scales: &Scales) -> f64 {
    match of(id).values {
        Values::NotNegative(typical) => typical(scales),
        _ => 1.0,
    }
}

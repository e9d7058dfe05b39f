//! `sigma2 *= exp(-b (T - T0))`: the viscosity of the lubricant decreases with temperature.

use super::bounds::TEMPERATURES_C;
use super::interface::*;

/// Legal factors of the viscous coefficient. The largest admits 0.2 1/K, twice the rate of the steepest oils, for a reference
/// of up to 30 deg C. The smallest may be 0, because no step divides by the coefficient.
const LEGAL_FACTORS: [f32; 2] = [0.0, 1e7];

super::thermal_factor::thermal_factor! {
    TemperatureViscous of TemperatureViscosity {
        scales: viscous_scale,
        widen: |bounds: &mut Bounds, _, most| bounds.viscous_factor *= most,
        legal: LEGAL_FACTORS,
        why: "the viscosity must stay sane from -50 to 150 deg C",
    }
}

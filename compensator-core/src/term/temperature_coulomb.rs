//! `g *= exp(-b (T - T0))`: the seal stiffens at low temperature.

use super::bounds::{LEAST_SHARE, TEMPERATURES_C};
use super::interface::*;

super::thermal_factor::thermal_factor! {
    TemperatureCoulomb of TemperatureCoulomb {
        scales: level_scale,
        widen: Bounds::scale_level,
        legal: [LEAST_SHARE, 1.0 / LEAST_SHARE],
        why: "the level must stay positive, and sane, from -50 to 150 deg C",
    }
}

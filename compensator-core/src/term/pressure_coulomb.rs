//! `F_C += k dP`, `F_S` likewise: pressure preloads the seal.

use super::interface::*;

super::seal_levels::seal_levels! {
    /// Levels per MPa.
    PressureCoulomb of Pressure {
        parameters: [PressureCoulomb, PressureStaticExcess],
        reading: pressure_diff_mpa,
        per_unit: 1e6,
        envelope: pressure_diff_max_pa,
        bounds: per_pascal,
    }
}

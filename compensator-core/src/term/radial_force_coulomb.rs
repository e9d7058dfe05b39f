//! `F_C += k F_L`, `F_S` likewise: side load compresses the seal.

use super::interface::*;

super::seal_levels::seal_levels! {
    /// Levels per N.
    RadialForceCoulomb of RadialForce {
        parameters: [RadialForceCoulomb, RadialForceStaticExcess],
        reading: radial_force_n,
        per_unit: 1.0,
        envelope: radial_force_max_n,
        bounds: per_newton,
    }
}

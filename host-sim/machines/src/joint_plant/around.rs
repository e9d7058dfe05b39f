//! What acts on a joint from outside.

/// Operating conditions of the seal in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Around {
    /// Side load at the end of the shaft, N.
    pub radial_force_n: f64,
    /// Outside minus inside pressure, Pa.
    pub pressure_diff_pa: f64,
    /// Torque transmitted to the load, Nm, positive against positive motion.
    pub load_torque_nm: f64,
}

//! What the statements of the terms pass to those of the law.

use super::program::Expr;

/// Field of the state with the torque of the bristle deflection, Nm.
pub const BRISTLE_TORQUE: &str = "bristle_torque_nm";

/// Effects of the terms on the law, and the motion that they read. `None` is a neutral effect.
pub(super) struct Effects {
    /// Velocity, rad/s.
    pub velocity: Expr,
    /// Magnitude of the velocity, rad/s.
    pub speed: Expr,
    /// Sign of the velocity: -1, 0 or 1.
    pub direction: Expr,
    /// Added to the Coulomb level, Nm.
    pub added_coulomb: Option<Expr>,
    /// Added to the static level, Nm.
    pub added_static: Option<Expr>,
    /// Factor of the level.
    pub level_scale: Option<Expr>,
    /// The factor of the level is `1 + level_asymmetry` forwards and `1 - level_asymmetry` backwards.
    pub level_asymmetry: Option<Expr>,
    /// Factor of the viscous coefficient.
    pub viscous_scale: Option<Expr>,
    /// Factor of the bristle stiffness.
    pub stiffness_scale: Option<Expr>,
    /// Bristle deflection rate from the changing side load, rad/s.
    pub carried_rate: Option<Expr>,
    /// Exponent of the Stribeck curve, if it is not 2.
    pub stribeck_exponent: Option<Expr>,
    /// Torque outside the law, Nm.
    pub torque: Option<Expr>,
}

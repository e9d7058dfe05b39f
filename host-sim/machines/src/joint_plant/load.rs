//! Loads of the joint's output: none, a propeller, a wall, a lifting leg, and a jumping leg.
//!
//! Each load has a torque against positive motion, a side load at the end of the shaft, and an inertia. The torque of
//! the propeller grows with the square of its speed. The lifting leg moves 2 kg from below to above the horizontal. The
//! jumping leg pushes a platform off the ground through a rubber foot. The contact transmits only pressure, so a fast
//! platform leaves the ground and lands again.

use super::parameters::Parameters;

/// Initial angle of the lifting leg, rad from the horizontal.
pub const LIFT_FROM_RAD: f64 = -1.3;
/// Initial angle of the jumping leg, rad from the horizontal.
pub const JUMP_FROM_RAD: f64 = -0.2;

/// Load of the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// A bare shaft.
    Free,
    /// A propeller in water.
    Propeller,
    /// A leg that lifts 2 kg under water.
    Leg,
    /// A wall against positive motion. It damps little, and does not pull.
    Wall {
        /// Position of the wall, rad.
        position_rad: f64,
        /// Stiffness, Nm/rad.
        stiffness_nm_per_rad: f64,
    },
    /// A leg that jumps with its platform.
    Jump {
        /// Height of the platform above the unloaded foot, m.
        height_m: f64,
        /// Upward speed of the platform, m/s.
        speed_m_s: f64,
    },
}

/// Torque and force of the load on the joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Acting {
    /// Torque against positive motion, Nm.
    pub torque_nm: f64,
    /// Side load at the end of the shaft, N.
    pub radial_force_n: f64,
}

impl Load {
    /// Returns a platform at rest on its foot.
    pub fn jump(p: &Parameters) -> Self {
        Self::Jump { height_m: -p.platform_weight_n / p.ground_stiffness_n_per_m, speed_m_s: 0.0 }
    }

    /// Returns the initial position of the joint, rad.
    pub fn start_rad(&self) -> f64 {
        match self {
            Self::Free | Self::Propeller | Self::Wall { .. } => 0.0,
            Self::Leg => LIFT_FROM_RAD,
            Self::Jump { .. } => JUMP_FROM_RAD,
        }
    }

    /// Returns the inertia that the load adds to the output, kg m^2.
    pub fn inertia_kg_m2(&self, p: &Parameters) -> f64 {
        let rod = p.leg_mass_kg * p.leg_length_m * p.leg_length_m / 3.0 + p.leg_added_inertia_kg_m2;
        match self {
            Self::Free | Self::Wall { .. } => 0.0,
            Self::Propeller => p.propeller_inertia_kg_m2,
            Self::Leg => {
                p.leg_mass_kg * p.leg_length_m * p.leg_length_m + p.leg_added_inertia_kg_m2
            }
            Self::Jump { .. } => 0.2 * rod,
        }
    }

    /// Returns the torque and force at a position (rad) and velocity (rad/s).
    ///
    /// The motion of a platform is integrated by `dt` (s).
    pub fn act(&mut self, p: &Parameters, position: f64, velocity: f64, dt: f64) -> Acting {
        match self {
            Self::Free => Acting::default(),
            Self::Propeller => {
                let turns = velocity / std::f64::consts::TAU;
                let torque = p.propeller_torque_coefficient
                    * p.water_density_kg_m3
                    * p.propeller_diameter_m.powi(5)
                    * turns
                    * turns.abs();
                let ripple = p.propeller_ripple_n * (3.0 * position).sin();
                Acting { torque_nm: torque, radial_force_n: p.propeller_weight_n + ripple }
            }
            Self::Leg => {
                let lift = p.leg_weight_n * p.leg_length_m * position.cos();
                let drag = p.leg_drag_nm_s2_per_rad2 * velocity * velocity.abs();
                let swung = p.leg_mass_kg * p.leg_length_m * velocity * velocity;
                Acting { torque_nm: lift + drag, radial_force_n: p.leg_weight_n + swung }
            }
            Self::Wall { position_rad, stiffness_nm_per_rad } => {
                let pressed = position - *position_rad;
                let push = *stiffness_nm_per_rad * (pressed + 1e-3 * velocity);
                let torque_nm = if pressed > 0.0 { push.max(0.0) } else { 0.0 };
                Acting { torque_nm, radial_force_n: 0.0 }
            }
            Self::Jump { height_m, speed_m_s } => {
                let foot = p.leg_length_m * (position.sin() - JUMP_FROM_RAD.sin());
                let foot_speed = p.leg_length_m * velocity * position.cos();
                let pressed = foot - *height_m;
                let push = p.ground_stiffness_n_per_m * pressed
                    + p.ground_damping_n_s_per_m * (foot_speed - *speed_m_s);
                // The contact transmits no tension.
                let push = if pressed > 0.0 { push.max(0.0) } else { 0.0 };
                let drag = p.platform_drag_n_s2_per_m2 * *speed_m_s * speed_m_s.abs();
                *speed_m_s += dt * (push - p.platform_weight_n - drag) / p.platform_mass_kg;
                *height_m += dt * *speed_m_s;
                let leg_drag_nm = p.leg_drag_nm_s2_per_rad2 * velocity * velocity.abs();
                Acting {
                    torque_nm: push * p.leg_length_m * position.cos() + leg_drag_nm,
                    radial_force_n: push,
                }
            }
        }
    }
}

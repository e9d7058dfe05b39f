//! What hangs on the joint's output: nothing, a propeller, a leg that lifts, a leg that jumps.
//!
//! Each gives at an instant the torque against positive motion and the side load it puts on the shaft's end, and
//! adds its inertia. The propeller turns water with the square of its speed. The leg lifts 2 kg from below the horizontal
//! to above it. The jumping leg pushes a platform off the ground through a rubber foot: the contact only pushes,
//! the platform flies when it is fast enough, and lands again.

use super::parameters::Parameters;

/// Where the legs begin, rad from the horizontal.
pub const LIFT_FROM_RAD: f64 = -1.3;
/// Where the jump begins.
pub const JUMP_FROM_RAD: f64 = -0.2;

/// What is on the output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// A bare shaft.
    Free,
    /// A propeller in water.
    Propeller,
    /// A leg that lifts 2 kg under water.
    Leg,
    /// A leg that jumps with its platform: height of the platform, m, and its speed, m/s.
    Jump {
        /// Height over the foot's rest, m.
        height_m: f64,
        /// Upwards, m/s.
        speed_m_s: f64,
    },
}

/// What it does to the joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Acting {
    /// Against positive motion, Nm.
    pub torque_nm: f64,
    /// Side load at the shaft's end, N.
    pub radial_force_n: f64,
}

impl Load {
    /// A platform that stands on its foot.
    pub fn jump(p: &Parameters) -> Self {
        Self::Jump { height_m: -p.platform_weight_n / p.ground_stiffness_n_per_m, speed_m_s: 0.0 }
    }

    /// Position the joint begins at, rad.
    pub fn start_rad(&self) -> f64 {
        match self {
            Self::Free | Self::Propeller => 0.0,
            Self::Leg => LIFT_FROM_RAD,
            Self::Jump { .. } => JUMP_FROM_RAD,
        }
    }

    /// Inertia it adds to the output, kg m^2.
    pub fn inertia_kg_m2(&self, p: &Parameters) -> f64 {
        let rod = p.leg_mass_kg * p.leg_length_m * p.leg_length_m / 3.0 + p.leg_added_inertia_kg_m2;
        match self {
            Self::Free => 0.0,
            Self::Propeller => p.propeller_inertia_kg_m2,
            Self::Leg => {
                p.leg_mass_kg * p.leg_length_m * p.leg_length_m + p.leg_added_inertia_kg_m2
            }
            Self::Jump { .. } => 0.2 * rod,
        }
    }

    /// What acts at a position (rad) and velocity (rad/s); a platform moves on by `dt` (s).
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
            Self::Jump { height_m, speed_m_s } => {
                let foot = p.leg_length_m * (position.sin() - JUMP_FROM_RAD.sin());
                let foot_speed = p.leg_length_m * velocity * position.cos();
                let pressed = foot - *height_m;
                let push = p.ground_stiffness_n_per_m * pressed
                    + p.ground_damping_n_s_per_m * (foot_speed - *speed_m_s);
                // Ground and foot do not hold each other.
                let push = if pressed > 0.0 { push.max(0.0) } else { 0.0 };
                let drag = p.platform_drag_n_s2_per_m2 * *speed_m_s * speed_m_s.abs();
                *speed_m_s += dt * (push - p.platform_weight_n - drag) / p.platform_mass_kg;
                *height_m += dt * *speed_m_s;
                let own = p.leg_drag_nm_s2_per_rad2 * velocity * velocity.abs();
                Acting {
                    torque_nm: push * p.leg_length_m * position.cos() + own,
                    radial_force_n: push,
                }
            }
        }
    }
}

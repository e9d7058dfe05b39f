//! The drives that take a friction feed-forward, with their units and parameters.
//!
//! No firmware below has a parameter for friction, so the host program sends the torque with each set-point. Both firmwares
//! have one for inertia.
//!
//! - moteus, firmware 1.0.0 (`docs/protocol/registers.md`, `docs/reference/configuration.md`): register 022h, *Feedforward
//!   torque*, at the output shaft, and `servo.inertia_feedforward` in kg m^2.
//! - ODrive, firmware 0.5.6 (`Firmware/odrive-interface.yaml`): `controller.input_torque` in Nm, in the input mode
//!   `PASSTHROUGH` only, and `controller.config.inertia` in Nm/(turn/s^2).

use joint_log::JointKind;
use std::f64::consts::TAU;

/// A drive that takes the feed-forward.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drive {
    /// mjbots' moteus.
    Moteus,
    /// ODrive.
    ODrive,
    /// A joint of this project, or any program that sends torques in SI units.
    Joint,
}

/// The units of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableUnits {
    /// Unit of the speed.
    pub speed: &'static str,
    /// Unit of the torque.
    pub torque: &'static str,
    /// Size of one unit of speed, rad/s or m/s.
    pub speed_size: f64,
    /// Suffix of names for the torque.
    pub suffix: &'static str,
}

impl Drive {
    /// Returns the name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Moteus => "moteus",
            Self::ODrive => "odrive",
            Self::Joint => "joint",
        }
    }

    /// Returns the name in sentences.
    pub fn title(self) -> &'static str {
        match self {
            Self::Moteus => "moteus",
            Self::ODrive => "ODrive",
            Self::Joint => "this joint",
        }
    }

    /// Returns the units of the table; `None` if the drive has no such joint.
    pub fn units(self, joint: JointKind) -> Option<TableUnits> {
        let si = |speed, torque, suffix| TableUnits { speed, torque, speed_size: 1.0, suffix };
        match (self, joint) {
            (Self::Joint, JointKind::Revolute) => Some(si("rad/s", "Nm", "nm")),
            (Self::Joint, JointKind::Prismatic) => Some(si("m/s", "N", "n")),
            (_, JointKind::Revolute) => {
                Some(TableUnits { speed: "turns/s", speed_size: TAU, ..si("", "Nm", "nm") })
            }
            (_, JointKind::Prismatic) => None,
        }
    }

    /// Returns the place where speed and torque are those of the log.
    pub fn shaft(self) -> &'static str {
        match self {
            Self::Moteus => "at the output shaft (after motor_position.rotor_to_output_ratio)",
            Self::ODrive => {
                "at the shaft of the encoder that the log holds; the torque is the motor's"
            }
            Self::Joint => "at the joint",
        }
    }
}

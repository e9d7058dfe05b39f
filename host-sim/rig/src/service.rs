//! A drawn joint in service: the parameters and settings that its driver starts with.
//!
//! The machines' crate does not know the firmware, so that what a person has set on the driver is composed here, from what
//! the joint's builder knows ([`KnownConstants`]).

use compensator_core::compensator::CompensatorParameters;
use firmware::control::MotorParameters;
use firmware::drive_settings::DriveSettings;
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::Thresholds;
use simulated_machines::joint_plant::DrawnJoint;
use simulated_machines::joint_plant::drawn::KnownConstants;
use std::f64::consts::TAU;

/// Crossover of the velocity loop that the usual rule gives, Hz (docs/src/how-to/cia-402-master.md).
const VELOCITY_CROSSOVER_HZ: f64 = 4.0;

/// Gain of the position loop per crossover of the velocity loop: below half of it.
const POSITION_SHARE: f64 = 0.4;

/// Position limits, rad from the start on each side.
pub const WINDOW_RAD: f64 = 1.0;

/// Following error that stops the joint, rad, and its time, ms.
const FOLLOWING_ERROR_RAD: f64 = 0.3;
const FOLLOWING_TIME_MS: u16 = 100;

/// Current from which a joint that has not moved is stopped, A: above the breakaway of every drawn joint.
const STALL_CURRENT_A: f32 = 8.0;

/// Returns the torque at the joint per ampere that the builder knows, Nm/A.
fn torque_per_ampere(joint: &DrawnJoint) -> f64 {
    joint.known.torque_constant_nm_per_a * joint.constants.gear_ratio
}

/// Returns the crossover of the velocity loop that a person has set, rad/s.
fn velocity_crossover(known: &KnownConstants) -> f64 {
    TAU * VELOCITY_CROSSOVER_HZ * known.velocity_gain_factor
}

/// Returns the set of a joint that was commissioned and whose loops were set by hand. Its friction is not compensated.
pub fn starting_set(joint: &DrawnJoint) -> ParameterSet {
    let (known, constants) = (&joint.known, &joint.constants);
    let per_ampere = torque_per_ampere(joint);
    let mut set = ParameterSet {
        motor: MotorParameters {
            pole_pairs: constants.pole_pairs as f32,
            gear_ratio: constants.gear_ratio as f32,
            resistance_ohm: known.resistance_ohm as f32,
            inductance_d_h: known.inductance_h as f32,
            inductance_q_h: known.inductance_h as f32,
            torque_constant_nm_per_a: known.torque_constant_nm_per_a as f32,
            encoder_offset_rad: constants.encoder_zero_rad as f32,
            encoder_direction: constants.encoder_direction as f32,
            inertia_kg_m2: known.inertia_kg_m2 as f32,
            velocity_gain_a_s_per_rad: (velocity_crossover(known) * known.inertia_kg_m2
                / per_ampere) as f32,
            ..MotorParameters::default()
        },
        thresholds: Thresholds {
            stall_current_a: STALL_CURRENT_A,
            position_required: 1,
            ..Thresholds::default()
        },
        ..ParameterSet::default()
    };
    set.friction.compensator = CompensatorParameters {
        scale: 0.0,
        torque_constant_nm_per_a: per_ampere as f32,
        ..CompensatorParameters::default()
    };
    // The side load comes over the bus, or not at all.
    set.sensors.strain_connected = 0.0;
    set
}

/// Returns the settings of the drive: every stop is a ramp, and the position is limited to [`WINDOW_RAD`] around the start.
pub fn drive_settings(joint: &DrawnJoint) -> DriveSettings {
    let micro = |value: f64| (1e6 * value).round();
    let gain = POSITION_SHARE * velocity_crossover(&joint.known) * joint.known.position_gain_factor;
    DriveSettings {
        quick_stop_option: 2,
        shutdown_option: 1,
        disable_option: 1,
        halt_option: 1,
        fault_option: 2,
        abort_connection: 1,
        following_window: micro(FOLLOWING_ERROR_RAD) as u32,
        following_time_ms: FOLLOWING_TIME_MS,
        position_min: micro(joint.start_rad - WINDOW_RAD) as i32,
        position_max: micro(joint.start_rad + WINDOW_RAD) as i32,
        position_gain: (1e3 * gain).round() as u32,
        ..DriveSettings::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starting_set_of_drawn_joints_is_accepted_and_follows_the_rules() {
        for seed in 0..50 {
            let joint = DrawnJoint::draw(seed, &[], None).expect("a joint");
            let set = starting_set(&joint);
            assert_eq!(set.validate(), Ok(()), "seed {seed}");
            assert_eq!(set.check_buildable(), Ok(()), "seed {seed}");
            assert_eq!(set.friction.compensator.scale, 0.0);
            let settings = drive_settings(&joint);
            let bytes = settings.to_words().map(u32::to_le_bytes);
            let parsed = DriveSettings::parse(bytes.as_flattened());
            assert_eq!(parsed, Some(settings), "seed {seed}");
            let window = settings.position_max - settings.position_min;
            assert!((window - 2_000_000).abs() <= 1, "{window}");
        }
    }
}

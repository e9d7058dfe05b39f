//! Evaluates the cause of each code from an observation.
//!
//! The functions here keep no state: they say whether a cause is present now. Where a code has hysteresis,
//! the range between its raise and clear levels leaves the cause unchanged. [`super::Supervisor`] holds the
//! state and applies the delays.

use super::{CanState, Code, Observation, Supervisor, Thresholds};
use crate::control::LoopFlags;
use CauseState::{Absent, Present, Reported, Unchanged};
use compensator_core::Flags;

/// State of a cause in one observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CauseState {
    /// The cause is present.
    Present,
    /// The cause is absent.
    Absent,
    /// The cause keeps its previous state.
    Unchanged,
    /// Observations do not show this cause; a separate method of the supervisor reports it.
    Reported,
}

impl CauseState {
    fn present_if(present: bool) -> Self {
        if present { Present } else { Absent }
    }
}

/// Compares a value with its raise and clear levels. NaN is neither; other codes report it.
// Not inlined: one copy takes less flash than one for each caller.
#[inline(never)]
fn above(value: f32, raise: f32, clear: f32) -> CauseState {
    if value >= raise {
        Present
    } else if value <= clear {
        Absent
    } else {
        Unchanged
    }
}

/// Returns the flags of the current loop any of which raises a code.
const fn raising_loop_flags(code: Code) -> LoopFlags {
    match code {
        Code::Overcurrent => LoopFlags::OVERCURRENT,
        Code::CurrentSensorInvalid => LoopFlags::CURRENT_INVALID,
        Code::BusOvervoltage => LoopFlags::BUS_OVERVOLTAGE,
        Code::BusUndervoltage => LoopFlags::BUS_UNDERVOLTAGE,
        Code::EncoderLost => LoopFlags::ENCODER_LOST,
        Code::EncoderJump => LoopFlags::ENCODER_IMPLAUSIBLE,
        Code::AdcTimeout => LoopFlags::BUS_UNKNOWN,
        Code::Overspeed => LoopFlags::OVERSPEED.union(LoopFlags::VELOCITY_EXCEEDED),
        Code::Internal => LoopFlags::NOT_FINITE,
        Code::VoltageLimited => LoopFlags::VOLTAGE_LIMITED,
        Code::CurrentLimited => LoopFlags::CURRENT_LIMITED,
        Code::CurrentImbalance => LoopFlags::CURRENT_IMBALANCE,
        Code::BrakingLimited => LoopFlags::BRAKING_LIMITED,
        Code::EncoderCoasting => LoopFlags::ENCODER_COASTING.union(LoopFlags::ENCODER_INVALID),
        Code::SetpointInvalid => LoopFlags::SETPOINT_INVALID,
        _ => LoopFlags::empty(),
    }
}

/// Returns the flags of the compensator any of which raises a code.
const fn raising_compensator_flags(code: Code) -> Flags {
    match code {
        Code::ModelNotFinite => Flags::MODEL_NOT_FINITE,
        Code::CurrentLimited => Flags::CURRENT_LIMITED,
        Code::SetpointInvalid => Flags::COMMAND_INVALID,
        Code::CompensationLimited => Flags::TORQUE_LIMITED,
        Code::CompensationSlewed => Flags::SLEW_LIMITED,
        Code::RadialForceStale => Flags::RADIAL_FORCE_STALE.union(Flags::RADIAL_FORCE_INVALID),
        Code::PressureStale => Flags::PRESSURE_STALE.union(Flags::PRESSURE_INVALID),
        Code::TemperatureStale => Flags::TEMPERATURE_STALE.union(Flags::TEMPERATURE_INVALID),
        Code::OtherInputStale => Flags::POSITION_STALE
            .union(Flags::POSITION_INVALID)
            .union(Flags::ACCELERATION_STALE)
            .union(Flags::ACCELERATION_INVALID)
            .union(Flags::LOAD_TORQUE_STALE)
            .union(Flags::LOAD_TORQUE_INVALID)
            .union(Flags::AUXILIARY_STALE)
            .union(Flags::AUXILIARY_INVALID)
            .union(Flags::CAMPAIGN_TIME_INVALID),
        _ => Flags::empty(),
    }
}

/// Evaluates the cause of a code.
pub(super) fn evaluate(
    supervisor: &Supervisor,
    code: Code,
    observation: &Observation,
    now_us: u64,
) -> CauseState {
    if observation.loop_flags.intersects(raising_loop_flags(code))
        || observation.compensator.intersects(raising_compensator_flags(code))
    {
        return Present;
    }
    let thresholds = &supervisor.thresholds;
    let any_current = |test: &dyn Fn(f32) -> bool| {
        observation.phase_currents_a.is_some_and(|currents| currents.into_iter().any(test))
    };
    CauseState::present_if(match code {
        Code::CommandTimeout => supervisor.command_is_late(now_us),
        Code::HeartbeatLost => observation.heartbeat_lost,
        Code::CanBusOff => observation.can == CanState::Off,
        Code::CanErrorPassive => observation.can == CanState::Passive,
        Code::Overcurrent => any_current(&|current| current.abs() >= thresholds.overcurrent_a),
        Code::CurrentSensorInvalid => any_current(&|current| !current.is_finite()),
        Code::PhaseLost => supervisor.is_driving() && phase_is_open(thresholds, observation),
        Code::GateDriverFault => observation.gate_driver_fault,
        Code::EncoderLost => observation.turns_unseen,
        Code::MotorAgainst => supervisor.is_driving() && observation.motor_against,
        Code::MotorStands => supervisor.is_driving() && observation.motor_stands,
        Code::PositionUnknown => observation.position_missing,
        Code::FollowingError => observation.following_error,
        Code::Stalled => observation.stalled,
        Code::BrakeTestFailed => observation.brake_test_failed,
        Code::EncoderMagnet => observation.magnet_fault,
        Code::OverCompensated => observation.over_compensated,
        Code::RadialForceStuck => observation.radial_force_stuck,
        Code::PressureStuck => observation.pressure_stuck,
        Code::SystemBreak => observation.system_break,
        Code::TorqueOff => observation.enclosure.is_torque_off,
        Code::TorqueOffChannels => observation.enclosure.do_channels_differ,
        Code::Leak => observation.enclosure.leak_stops,
        Code::LeakReported => observation.enclosure.leak_is_reported,
        Code::HousingHumid => observation.enclosure.is_humid,
        Code::HousingPressure => observation.enclosure.is_pressure_outside,
        Code::EnclosureUnknown => observation.enclosure.is_sensor_invalid,
        Code::AdcTimeout => conversions_are_missing(thresholds, observation),
        Code::LoopOverrun => supervisor.overruns_in_a_row >= thresholds.overruns_in_a_row,
        Code::LoopLate => supervisor.overrun_since_observed,
        Code::StackOverflow => !observation.stack_intact,
        Code::VelocityInvalid => {
            observation.compensator.contains(Flags::VELOCITY_INVALID | Flags::REFERENCE_INVALID)
        }
        Code::TemperatureUnknown => temperature_is_unknown(observation),
        Code::CurrentOffset
        | Code::BusOvervoltage
        | Code::BusUndervoltage
        | Code::BridgeOvertemperature
        | Code::MotorOvertemperature
        | Code::Overspeed
        | Code::Derated => return compare_with_levels(supervisor, code, observation),
        Code::ModelOutOfBand => match observation.model_in_band {
            Some(in_band) => !in_band,
            None => return Unchanged,
        },
        Code::StoreDamaged
        | Code::SelfTestFailed
        | Code::WatchdogReset
        | Code::PanicBeforeReset
        | Code::ParametersDefault
        | Code::ParametersRefused
        | Code::NotCommissioned
        | Code::StoreReduced => return Reported,
        // Raised by flags alone.
        Code::EncoderJump
        | Code::ModelNotFinite
        | Code::Internal
        | Code::VoltageLimited
        | Code::CurrentLimited
        | Code::CurrentImbalance
        | Code::BrakingLimited
        | Code::EncoderCoasting
        | Code::SetpointInvalid
        | Code::CompensationLimited
        | Code::CompensationSlewed
        | Code::RadialForceStale
        | Code::PressureStale
        | Code::TemperatureStale
        | Code::OtherInputStale => false,
    })
}

/// Evaluates the codes that have a raise level and a clear level.
fn compare_with_levels(
    supervisor: &Supervisor,
    code: Code,
    observation: &Observation,
) -> CauseState {
    let thresholds = &supervisor.thresholds;
    let temperature = |value: Option<f32>, raise: f32| {
        value.map_or(Absent, |value| {
            above(value, raise, raise - thresholds.temperature_hysteresis_c)
        })
    };
    match code {
        Code::CurrentOffset => current_offset(supervisor, observation),
        Code::BusOvervoltage => observation.bus_voltage_v.map_or(Absent, |voltage| {
            above(voltage, thresholds.bus_overvoltage_v, thresholds.bus_overvoltage_clear_v)
        }),
        Code::BusUndervoltage => observation.bus_voltage_v.map_or(Absent, |voltage| {
            above(-voltage, -thresholds.bus_undervoltage_v, -thresholds.bus_undervoltage_clear_v)
        }),
        Code::BridgeOvertemperature => {
            temperature(observation.bridge_temperature_c, thresholds.bridge_trip_c)
        }
        Code::MotorOvertemperature => {
            temperature(observation.motor_temperature_c, thresholds.motor_trip_c)
        }
        Code::Overspeed => {
            let level = thresholds.overspeed_rad_s;
            above(observation.velocity_rad_s.abs(), level, 0.9 * level)
        }
        Code::Derated => {
            let states = [
                temperature(observation.bridge_temperature_c, thresholds.bridge_derate_c),
                temperature(observation.motor_temperature_c, thresholds.motor_derate_c),
                temperature(observation.winding_temperature_c, thresholds.winding_derate_c),
            ];
            if states.contains(&Present) {
                Present
            } else if states.into_iter().all(|state| state == Absent) {
                Absent
            } else {
                Unchanged
            }
        }
        _ => Unchanged,
    }
}

/// Evaluates the current offset. With the bridge off no current flows, so any reading is an offset. While armed, an
/// offset cannot be distinguished from a current.
fn current_offset(supervisor: &Supervisor, observation: &Observation) -> CauseState {
    let Some(currents) = observation.phase_currents_a else { return Absent };
    if supervisor.is_driving() || observation.bridge_shorted {
        return Unchanged;
    }
    let largest =
        currents.into_iter().fold(0.0, |largest: f32, current| largest.max(current.abs()));
    let level = supervisor.thresholds.current_offset_a;
    above(largest, level, 0.5 * level)
}

/// Returns true if one phase carries no current and the set-point is not reached.
///
/// An open phase carries nothing, and the current in the two others cannot follow the rotor. A sound phase may also be at
/// 0 at some rotor angles, but then the set-point is reached.
fn phase_is_open(thresholds: &Thresholds, observation: &Observation) -> bool {
    let Some(currents) = observation.phase_currents_a else { return false };
    let setpoint = observation.current_setpoint_a.abs();
    let missing = (observation.current_setpoint_a - observation.current_a).abs();
    setpoint >= thresholds.phase_check_a
        && missing >= 0.5 * setpoint
        && currents.into_iter().any(|current| current.abs() < thresholds.phase_dead_a)
}

/// Returns true if the latest conversion is too old or the bus voltage is not finite.
fn conversions_are_missing(thresholds: &Thresholds, observation: &Observation) -> bool {
    observation.sample_age_us.is_some_and(|age_us| age_us >= thresholds.sample_timeout_us)
        || observation.bus_voltage_v.is_some_and(|voltage| !voltage.is_finite())
}

/// Returns true if a temperature sensor gives no valid value.
fn temperature_is_unknown(observation: &Observation) -> bool {
    [observation.bridge_temperature_c, observation.motor_temperature_c]
        .into_iter()
        .flatten()
        .any(|temperature| !temperature.is_finite())
}

/// Returns the share of the current limit that the temperatures allow, from 0 to 1.
///
/// It is 1 up to the derating level and falls linearly to 0 at the trip level. A sensor without a valid value leaves half.
pub(super) fn current_share(thresholds: &Thresholds, observation: &Observation) -> f32 {
    let share = |temperature: Option<f32>, derate: f32, trip: f32| match temperature {
        None => 1.0,
        Some(value) if !value.is_finite() => 0.5,
        Some(value) => ((trip - value) / (trip - derate)).clamp(0.0, 1.0),
    };
    let Thresholds { bridge_derate_c, bridge_trip_c, motor_derate_c, motor_trip_c, .. } =
        *thresholds;
    let winding = share(
        observation.winding_temperature_c,
        thresholds.winding_derate_c,
        thresholds.winding_max_c,
    );
    let bridge = share(observation.bridge_temperature_c, bridge_derate_c, bridge_trip_c);
    bridge.min(winding).min(share(observation.motor_temperature_c, motor_derate_c, motor_trip_c))
}

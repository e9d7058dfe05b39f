//! What each code sees in an observation.
//!
//! Nothing is remembered here: a look says whether a cause is there now. Between a level and the one
//! it is left at there is neither; [`super::Supervisor`] holds what was, and lets delays pass.

use super::{CanState, Code, Observation, Supervisor, Thresholds};
use crate::control::LoopFlags;
use compensator_core::Flags;

/// What was seen of a cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sight {
    /// It is there.
    Bad,
    /// It is not.
    Good,
    /// It stays what it was.
    Between,
    /// No observation shows it: it is told by a call of its own.
    Reported,
}

impl Sight {
    fn bad_if(bad: bool) -> Self {
        if bad { Self::Bad } else { Self::Good }
    }
}

/// Bad from one level up, good from the other down. NaN is neither: a code of its own sees it.
fn above(value: f32, bad: f32, good: f32) -> Sight {
    if value >= bad {
        Sight::Bad
    } else if value <= good {
        Sight::Good
    } else {
        Sight::Between
    }
}

/// Looks for the cause of a code.
pub(super) fn look(supervisor: &Supervisor, code: Code, seen: &Observation, now_us: u64) -> Sight {
    use Sight::{Good, Reported};
    let thresholds = &supervisor.thresholds;
    let flag = |flags: LoopFlags| seen.loop_flags.intersects(flags);
    let compensator = |flags: Flags| Sight::bad_if(seen.compensator.intersects(flags));
    let temperature = |value: Option<f32>, bad: f32| {
        value.map_or(Good, |value| above(value, bad, bad - thresholds.temperature_hysteresis_c))
    };
    let any_current = |test: &dyn Fn(f32) -> bool| {
        seen.phase_currents_a.is_some_and(|currents| currents.into_iter().any(test))
    };
    match code {
        Code::CommandTimeout => Sight::bad_if(supervisor.command_is_late(now_us)),
        Code::HeartbeatLost => Sight::bad_if(seen.heartbeat_lost),
        Code::CanBusOff => Sight::bad_if(seen.can == CanState::Off),
        Code::Overcurrent => {
            let over = any_current(&|current| current.abs() >= thresholds.overcurrent_a);
            Sight::bad_if(over || flag(LoopFlags::OVERCURRENT))
        }
        Code::CurrentSensorInvalid => {
            let unsound = any_current(&|current| !current.is_finite());
            Sight::bad_if(unsound || flag(LoopFlags::CURRENT_INVALID))
        }
        Code::CurrentOffset => current_offset(supervisor, seen),
        Code::PhaseLost => Sight::bad_if(supervisor.armed && phase_is_dead(thresholds, seen)),
        Code::BusOvervoltage if flag(LoopFlags::BUS_OVERVOLTAGE) => Sight::Bad,
        Code::BusOvervoltage => seen.bus_voltage_v.map_or(Good, |voltage| {
            above(voltage, thresholds.bus_overvoltage_v, thresholds.bus_overvoltage_clear_v)
        }),
        Code::BusUndervoltage if flag(LoopFlags::BUS_UNDERVOLTAGE) => Sight::Bad,
        Code::BusUndervoltage => seen.bus_voltage_v.map_or(Good, |voltage| {
            above(-voltage, -thresholds.bus_undervoltage_v, -thresholds.bus_undervoltage_clear_v)
        }),
        Code::GateDriverFault => Sight::bad_if(seen.gate_driver_fault),
        Code::MotorAgainst => Sight::bad_if(supervisor.armed && seen.motor_against),
        Code::MotorStands => Sight::bad_if(supervisor.armed && seen.motor_stands),
        Code::Stalled => Sight::bad_if(seen.stalled),
        Code::OverCompensated => Sight::bad_if(seen.over_compensated),
        Code::RadialForceStuck => Sight::bad_if(seen.radial_force_stuck),
        Code::PressureStuck => Sight::bad_if(seen.pressure_stuck),
        Code::SystemBreak => Sight::bad_if(seen.system_break),
        Code::BridgeOvertemperature => {
            temperature(seen.bridge_temperature_c, thresholds.bridge_trip_c)
        }
        Code::MotorOvertemperature => {
            temperature(seen.motor_temperature_c, thresholds.motor_trip_c)
        }
        Code::EncoderLost => Sight::bad_if(flag(LoopFlags::ENCODER_LOST)),
        Code::EncoderJump => Sight::bad_if(flag(LoopFlags::ENCODER_IMPLAUSIBLE)),
        Code::AdcTimeout => {
            let late = seen.sample_age_us.is_some_and(|age| age >= thresholds.sample_timeout_us);
            let unsound = seen.bus_voltage_v.is_some_and(|voltage| !voltage.is_finite());
            Sight::bad_if(late || unsound || flag(LoopFlags::BUS_UNKNOWN))
        }
        Code::Overspeed if flag(LoopFlags::OVERSPEED) => Sight::Bad,
        Code::Overspeed => {
            let level = thresholds.overspeed_rad_s;
            above(seen.velocity_rad_s.abs(), level, 0.9 * level)
        }
        Code::LoopOverrun => {
            Sight::bad_if(supervisor.overruns_in_a_row >= thresholds.overruns_in_a_row)
        }
        Code::ModelNotFinite => compensator(Flags::MODEL_NOT_FINITE),
        Code::StackOverflow => Sight::bad_if(!seen.stack_intact),
        Code::Internal => Sight::bad_if(flag(LoopFlags::NOT_FINITE)),
        Code::StoreDamaged
        | Code::SelfTestFailed
        | Code::WatchdogReset
        | Code::PanicBeforeReset
        | Code::ParametersDefault
        | Code::ParametersRefused
        | Code::NotCommissioned
        | Code::StoreReduced => Reported,
        Code::LoopLate => Sight::bad_if(supervisor.overrun_since_observed),
        Code::VelocityInvalid => Sight::bad_if(
            seen.compensator.contains(Flags::VELOCITY_INVALID | Flags::REFERENCE_INVALID),
        ),
        Code::CanErrorPassive => Sight::bad_if(seen.can == CanState::Passive),
        Code::VoltageLimited => Sight::bad_if(flag(LoopFlags::VOLTAGE_LIMITED)),
        Code::CurrentLimited => Sight::bad_if(
            flag(LoopFlags::CURRENT_LIMITED) || seen.compensator.intersects(Flags::CURRENT_LIMITED),
        ),
        Code::CurrentImbalance => Sight::bad_if(flag(LoopFlags::CURRENT_IMBALANCE)),
        Code::Derated => {
            let bridge = temperature(seen.bridge_temperature_c, thresholds.bridge_derate_c);
            let motor = temperature(seen.motor_temperature_c, thresholds.motor_derate_c);
            let winding = temperature(seen.winding_temperature_c, thresholds.winding_derate_c);
            let all = [bridge, motor, winding];
            if all.contains(&Sight::Bad) {
                Sight::Bad
            } else if all.into_iter().all(|sight| sight == Good) {
                Good
            } else {
                Sight::Between
            }
        }
        Code::TemperatureUnknown => Sight::bad_if(temperature_is_unknown(seen)),
        Code::EncoderCoasting => {
            Sight::bad_if(flag(LoopFlags::ENCODER_COASTING | LoopFlags::ENCODER_INVALID))
        }
        Code::SetpointInvalid => Sight::bad_if(
            flag(LoopFlags::SETPOINT_INVALID)
                || seen.compensator.intersects(Flags::COMMAND_INVALID),
        ),
        Code::CompensationLimited => compensator(Flags::TORQUE_LIMITED),
        Code::CompensationSlewed => compensator(Flags::SLEW_LIMITED),
        Code::RadialForceStale => {
            compensator(Flags::RADIAL_FORCE_STALE | Flags::RADIAL_FORCE_INVALID)
        }
        Code::PressureStale => compensator(Flags::PRESSURE_STALE | Flags::PRESSURE_INVALID),
        Code::TemperatureStale => {
            compensator(Flags::TEMPERATURE_STALE | Flags::TEMPERATURE_INVALID)
        }
        Code::OtherInputStale => compensator(
            Flags::POSITION_STALE
                | Flags::POSITION_INVALID
                | Flags::ACCELERATION_STALE
                | Flags::ACCELERATION_INVALID
                | Flags::LOAD_TORQUE_STALE
                | Flags::LOAD_TORQUE_INVALID
                | Flags::AUXILIARY_STALE
                | Flags::AUXILIARY_INVALID
                | Flags::CAMPAIGN_TIME_INVALID,
        ),
        Code::ModelOutOfBand => match seen.model_in_band {
            Some(in_band) => Sight::bad_if(!in_band),
            None => Sight::Between,
        },
    }
}

/// With the bridge off no current flows, so what is measured is offset; with it on nobody can tell.
fn current_offset(supervisor: &Supervisor, seen: &Observation) -> Sight {
    let Some(currents) = seen.phase_currents_a else { return Sight::Good };
    if supervisor.armed {
        return Sight::Between;
    }
    let most = currents.into_iter().fold(0.0, |most: f32, current| most.max(current.abs()));
    let level = supervisor.thresholds.current_offset_a;
    above(most, level, 0.5 * level)
}

/// An open phase carries nothing, and the current in the two others cannot turn with the rotor. A phase
/// may well be at 0 where the rotor stands so; then the set-point is met.
fn phase_is_dead(thresholds: &Thresholds, seen: &Observation) -> bool {
    let Some(currents) = seen.phase_currents_a else { return false };
    let wanted = seen.current_setpoint_a.abs();
    let missing = (seen.current_setpoint_a - seen.current_a).abs();
    wanted >= thresholds.phase_check_a
        && missing >= 0.5 * wanted
        && currents.into_iter().any(|current| current.abs() < thresholds.phase_dead_a)
}

fn temperature_is_unknown(seen: &Observation) -> bool {
    [seen.bridge_temperature_c, seen.motor_temperature_c]
        .into_iter()
        .flatten()
        .any(|temperature| !temperature.is_finite())
}

/// Share of the current limit that temperature leaves: all of it up to the derating level, then a
/// straight line to nothing at the trip; half of it where a sensor gives no number.
pub(super) fn current_share(thresholds: &Thresholds, seen: &Observation) -> f32 {
    let left = |temperature: Option<f32>, derate: f32, trip: f32| match temperature {
        None => 1.0,
        Some(value) if !value.is_finite() => 0.5,
        Some(value) => ((trip - value) / (trip - derate)).clamp(0.0, 1.0),
    };
    let Thresholds { bridge_derate_c, bridge_trip_c, motor_derate_c, motor_trip_c, .. } =
        *thresholds;
    let winding =
        left(seen.winding_temperature_c, thresholds.winding_derate_c, thresholds.winding_max_c);
    let bridge = left(seen.bridge_temperature_c, bridge_derate_c, bridge_trip_c);
    bridge.min(winding).min(left(seen.motor_temperature_c, motor_derate_c, motor_trip_c))
}

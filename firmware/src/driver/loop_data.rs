//! What the driver and its current loop exchange.
//!
//! The current loop runs in an interrupt and owns its state. The driver runs in the background and owns the bus.
//! They exchange whole values: [`LoopCommands`] to the loop once a millisecond, and a [`LoopReport`] back every
//! [`REPORT_PERIOD_S`]. Nothing is shared, so no value is read half-written. [`crate::loop_link`] has the queues.

use crate::control::probe::{ProbeCommand, ProbeReport};
use crate::control::{Covariates, LoopFlags, Setpoint};
use crate::scope::ScopeOrder;
use compensator_core::Flags;
use compensator_core::adaptation::Gains;
use compensator_core::network::Factors;

/// Time between two reports of the current loop, s.
pub const REPORT_PERIOD_S: f32 = 1e-3;

with_defaults! {
/// Commands to the current loop, valid until the next ones.
#[derive(Clone, Copy, Debug)]
pub struct LoopCommands {
    /// Set-point of the joint.
    pub setpoint: Setpoint = Setpoint::NONE,
    /// Covariates: what is measured of the joint besides its encoder.
    pub covariates: Covariates = Covariates::MISSING,
    /// True if the bridge may be on.
    pub bridge: bool,
    /// True if the low sides may be shorted when the bridge stops.
    pub brake: bool,
    /// True if friction may be compensated.
    pub compensation: bool,
    /// Share of the current limit that the temperature permits, 0..=1.
    pub current_share: f32 = 1.0,
    /// Share of the compensation in use, 0..=1. It is less than 1 if the model was found to have more friction
    /// than the joint.
    pub compensation_share: f32 = 1.0,
    /// Factors of a network for the law's levels and stiffness; `None` for the law's constants.
    pub factors: Option<Factors<f32>>,
    /// Counts requests to put the gate driver to sleep, which clears a latched fault.
    pub gate_resets: u8,
    /// Counts parameter sets: when it changes, the loop receives the parts of the new set.
    pub set_number: u32,
    /// Home position that was set last.
    pub home: Home,
    /// Measurement of the motor: a voltage along a field replaces the current loop. It also ends with the age of
    /// the set-point.
    pub probe: Option<ProbeCommand>,
    /// What the scope records.
    pub scope: ScopeOrder = ScopeOrder::OFF,
}
/// Commands before the first ones are received: everything is off.
}

/// What a tick gives to the current loop.
#[derive(Clone, Copy, Debug)]
pub struct LoopOutput {
    /// Commands, with the factors of a network.
    pub commands: LoopCommands,
    /// Gains that the adaptation has learnt; `None` for a driver without one.
    pub gains: Option<NumberedGains>,
}

/// Learnt gains on the sizes of the model.
#[derive(Clone, Copy, Debug)]
pub struct NumberedGains {
    /// Changes with the gains, so that the loop receives each once.
    pub number: u32,
    /// The gains.
    pub gains: Gains<f32>,
}

/// Position of the joint, set by a caller who knows it. An encoder on the motor gives the angle within a motor
/// turn only.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Home {
    /// Position at the time it was set, rad.
    pub position_rad: f32,
    /// Counts the calls that set it: when it changes, the joint is at this position now.
    pub number: u32,
}

/// Edges of the touch probe's input: the rotor's angle in the period before the first rise and the first fall, 2^-32 turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TouchEdges {
    /// At the rise.
    pub rise: Option<u32>,
    /// At the fall.
    pub fall: Option<u32>,
}

with_defaults! {
    /// Report of the current loop and its board since the last report.
    #[derive(Clone, Copy, Debug)]
    pub struct LoopReport {
        /// Bus voltage, V; `None` if it is not measured.
        pub bus_voltage_v: Option<f32>,
        /// Phase currents, A; `None` if they are not measured.
        pub phase_currents_a: Option<[f32; 3]>,
        /// Torque-producing current, A.
        pub current_a: f32,
        /// Current along the magnet, A; about 0 unless it weakens the field or burns braking power.
        pub current_d_a: f32,
        /// Reference of the torque-producing current, A.
        pub current_reference_a: f32,
        /// Voltage along q, V, in the motor's sign; 0 with the bridge open.
        pub voltage_q_v: f32,
        /// Joint velocity, rad/s.
        pub velocity_rad_s: f32,
        /// Joint position, rad; NaN if whole turns are unknown.
        pub position_rad: f32 = f32::NAN,
        /// Joint position from an arbitrary zero, rad; valid as long as the encoder is.
        pub turned_rad: f32,
        /// Rotor's mechanical angle at this position, 2^-32 turns.
        pub rotor_angle: u32,
        /// Torque of the measured current at the joint, Nm.
        pub motor_torque_nm: f32 = f32::NAN,
        /// Friction torque of the model, Nm.
        pub friction_torque_nm: f32,
        /// Compensation current, A.
        pub feed_forward_current_a: f32,
        /// Residual torque that the model does not explain, Nm.
        pub residual_torque_nm: f32 = f32::NAN,
        /// Torque held by the model's deflected bristles, Nm.
        pub bristle_torque_nm: f32,
        /// All flags of the loop since the last report.
        pub loop_flags: LoopFlags,
        /// All flags of the compensator since the last report.
        pub flags: Flags = Flags::DISABLED,
        /// Temperature of the bridge, deg C; `None` if it is not measured.
        pub bridge_temperature_c: Option<f32>,
        /// Temperature of the motor, deg C; `None` if it is not measured.
        pub motor_temperature_c: Option<f32>,
        /// Age of the latest conversion, us.
        pub sample_age_us: Option<u32>,
        /// The gate driver reports a fault.
        pub gate_driver_fault: bool,
        /// The chip opened the bridge by itself: supply, clock, memory or processor.
        pub system_break: bool,
        /// The encoder reports that its magnet is too weak, too strong or misplaced.
        pub magnet_fault: bool,
        /// The low sides are shorted: the phase currents are those of the braking motor.
        pub bridge_shorted: bool,
        /// The guard below the stack is intact.
        pub stack_intact: bool = true,
        /// Maximum number of consecutive overruns since the last report.
        pub overruns_in_a_row: u32,
        /// Edges of the touch probe's input since the last report.
        pub touch: TouchEdges,
        /// Result of the last block of a motor measurement.
        pub probe: ProbeReport,
        /// The last report once more, because no new one has come: it shows its age, and controllers make no step with it.
        pub is_repeated: bool,
    }
    /// Nothing is measured and there are no faults.
}

with_defaults! {
    /// Values of one period: the first part of a report. The interrupt sends a report in parts, each in a period of its own.
    /// Its fields are those of [`LoopReport`]. What was invalid in this period is NaN.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct PeriodValues {
        pub bus_voltage_v: f32 = f32::NAN,
        pub phase_currents_a: [f32; 3] = [f32::NAN; 3],
        pub current_a: f32,
        pub current_d_a: f32,
        pub current_reference_a: f32,
        pub voltage_q_v: f32,
        pub velocity_rad_s: f32,
        pub turned_rad: f32,
        pub rotor: ReportedAngle,
        pub motor_torque_nm: f32 = f32::NAN,
        pub friction_torque_nm: f32,
        pub feed_forward_current_a: f32,
        pub residual_torque_nm: f32 = f32::NAN,
        /// Gain on the levels of the tuned set in use.
        pub level_gain: f32 = 1.0,
    }
    /// Before the first report.
}

/// Angle of the rotor, and whether whole turns are known: its lowest bit. The values of a period are copied in the interrupt,
/// by a call instead of in place if they take more than 64 bytes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ReportedAngle(u32);

impl ReportedAngle {
    #[inline(always)]
    pub(crate) const fn new(angle: u32, is_referenced: bool) -> Self {
        Self(angle & !1 | is_referenced as u32)
    }

    const fn angle(self) -> u32 {
        self.0 & !1
    }

    const fn is_referenced(self) -> bool {
        self.0 & 1 != 0
    }
}

const _: () = assert!(size_of::<PeriodValues>() <= 64, "copied by a call");

/// Flags and counts since the last report: the last part of a report. Its fields are those of [`LoopReport`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReportStatus {
    pub loop_flags: LoopFlags,
    pub flags: Flags,
    pub bristle_torque_nm: f32,
    pub overruns_in_a_row: u32,
    pub touch: TouchEdges,
    pub gate_driver_fault: bool,
    pub system_break: bool,
    pub magnet_fault: bool,
    pub bridge_shorted: bool,
    /// A part with the result of a motor measurement was sent between the two.
    pub has_probe: bool,
}

impl LoopReport {
    /// Returns the report of these parts, with a sample of this instant.
    pub(crate) fn join(values: &PeriodValues, status: &ReportStatus, probe: ProbeReport) -> Self {
        let position_rad = if values.rotor.is_referenced() { values.turned_rad } else { f32::NAN };
        Self {
            bus_voltage_v: Some(values.bus_voltage_v),
            phase_currents_a: Some(values.phase_currents_a),
            current_a: values.current_a,
            current_d_a: values.current_d_a,
            current_reference_a: values.current_reference_a,
            voltage_q_v: values.voltage_q_v,
            velocity_rad_s: values.velocity_rad_s,
            position_rad,
            turned_rad: values.turned_rad,
            rotor_angle: values.rotor.angle(),
            motor_torque_nm: values.motor_torque_nm,
            friction_torque_nm: values.friction_torque_nm,
            feed_forward_current_a: values.feed_forward_current_a,
            residual_torque_nm: values.residual_torque_nm,
            bristle_torque_nm: status.bristle_torque_nm,
            loop_flags: status.loop_flags,
            flags: status.flags,
            sample_age_us: Some(0),
            gate_driver_fault: status.gate_driver_fault,
            system_break: status.system_break,
            magnet_fault: status.magnet_fault,
            bridge_shorted: status.bridge_shorted,
            overruns_in_a_row: status.overruns_in_a_row,
            touch: status.touch,
            probe,
            ..Self::default()
        }
    }
}

//! The plant as a power stage: the hardware that the current loop's interrupt sees.
//!
//! Two shunts, a 14-bit encoder, and duty cycles that act one period late. Sensors are ideal except for the plant's noise,
//! or those of the driver's board ([`BoardSensors`]). An interrupt may be late or missing; the timer then continues with
//! its present duty cycles.

use super::RigFaults;
use super::board::BoardSensors;
use firmware::control::{
    BridgeFault, PERIOD_S, PowerStage, StageSample, ValidChannels, encoder_angle,
};
use firmware::sensors::biss;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use simulated_machines::joint_plant::JointPlant;
use std::collections::VecDeque;

/// Processor cycles of a PWM period at 170 MHz, and of the current loop in it.
pub const PERIOD_CYCLES: u32 = 8500;
const LOOP_CYCLES: u32 = 3000;

/// Resolution of the encoder, bits.
const ENCODER_BITS: u32 = 14;

/// Timing of an interrupt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InterruptTiming {
    /// At the start of the period.
    #[default]
    OnTime,
    /// Late by this number of cycles.
    Late(u32),
    /// Missing.
    Missed,
}

/// Largest true values, not measurements, since the last call of [`Stage::take_extremes`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageExtremes {
    /// Phase current, A.
    pub current_a: f64,
    /// Bus voltage, V.
    pub bus_v: f64,
    /// Joint speed, rad/s.
    pub speed_rad_s: f64,
    /// Periods in which the bridge was driven.
    pub driven_periods: u32,
}

/// The plant, seen as a power stage.
pub struct Stage {
    /// The plant.
    pub plant: JointPlant,
    /// Sensors of the driver's board; `None` for ideal sensors.
    pub board: Option<BoardSensors>,
    /// Timing of the next interrupts; on time if empty.
    pub interrupts: VecDeque<InterruptTiming>,
    /// Phases b and c are swapped at the motor.
    pub phases_swapped: bool,
    /// The gate driver reports a fault and drives no phase.
    pub gate_fault: bool,
    /// Range of the joint's position in which its touch probe is touched, rad.
    pub touched_rad: Option<[f64; 2]>,
    applied: Option<[f64; 3]>,
    pending: Option<[f64; 3]>,
    is_awake: bool,
    extremes: StageExtremes,
    cycles: u32,
    /// Delay of the present interrupt, cycles.
    delay: u32,
    /// Share of the encoder readings that fail, from 0 to 1.
    encoder_lost: f64,
    random: Pcg64,
}

impl Stage {
    /// Returns a stage with its bridge open.
    pub fn new(plant: JointPlant, faults: &RigFaults) -> Self {
        Self {
            plant,
            board: None,
            interrupts: VecDeque::new(),
            phases_swapped: false,
            gate_fault: false,
            touched_rad: None,
            applied: None,
            pending: None,
            is_awake: true,
            extremes: StageExtremes::default(),
            cycles: 0,
            delay: 0,
            encoder_lost: faults.encoder_lost,
            random: Pcg64::seed_from_u64(faults.seed),
        }
    }

    /// Returns the delay of this period's interrupt, cycles; `None` if it is missed.
    pub fn next_interrupt(&mut self) -> Option<u32> {
        let delay = match self.interrupts.pop_front().unwrap_or_default() {
            InterruptTiming::OnTime => Some(0),
            InterruptTiming::Late(cycles) => Some(cycles),
            InterruptTiming::Missed => None,
        };
        self.delay = delay.unwrap_or(0);
        delay
    }

    /// Simulates one period.
    pub fn step_period(&mut self) {
        let is_enabled = self.is_awake && !self.gate_fault;
        let applied = self.applied.filter(|_| is_enabled);
        self.plant.period(f64::from(PERIOD_S), applied);
        self.record_extremes(applied.is_some());
        // Duty cycles written after the top take effect at the next one.
        if self.delay + LOOP_CYCLES <= PERIOD_CYCLES {
            self.applied = self.pending;
        }
        self.cycles = self.cycles.wrapping_add(PERIOD_CYCLES);
    }

    /// Returns the words of the encoder at the joint's side, latched now; `None` without one.
    pub fn output_words(&self) -> Option<[u16; biss::WORDS]> {
        self.board.as_ref().and_then(|board| board.output_words(&self.plant))
    }

    /// Simulates this time with these duties of a timer outside of the rig, s; `None` is an open bridge.
    pub fn run_driven(&mut self, seconds: f64, duty: Option<[f64; 3]>) {
        let is_swapped = self.phases_swapped;
        self.applied = duty.map(|[a, b, c]| if is_swapped { [a, c, b] } else { [a, b, c] });
        self.plant.period(seconds, self.applied);
        // Parts of a period count once.
        self.record_extremes(duty.is_some() && seconds > 0.5 * f64::from(PERIOD_S));
    }

    /// Simulates this time without a processor, s: the bridge keeps these duty cycles, or is open.
    pub fn run_without_processor(&mut self, seconds: f64, duty: Option<[f64; 3]>) {
        self.plant.period(seconds, duty);
        self.record_extremes(duty.is_some());
    }

    fn record_extremes(&mut self, is_driven: bool) {
        let extremes = &mut self.extremes;
        extremes.current_a = extremes.current_a.max(std::mem::take(&mut self.plant.peak_a));
        extremes.current_a = self
            .plant
            .phase_currents_a()
            .into_iter()
            .fold(extremes.current_a, |m, a| m.max(a.abs()));
        extremes.bus_v = extremes.bus_v.max(self.plant.bus_v());
        extremes.speed_rad_s = extremes.speed_rad_s.max(self.plant.velocity_rad_s().abs());
        extremes.driven_periods += u32::from(is_driven);
    }

    /// Takes the extremes since the last call.
    pub fn take_extremes(&mut self) -> StageExtremes {
        std::mem::take(&mut self.extremes)
    }

    /// Returns true if the touch probe is touched at the present position.
    pub fn has_touched(&self) -> bool {
        let at_rad = self.plant.position_rad();
        self.touched_rad.is_some_and(|[from, to]| (from..to).contains(&at_rad))
    }

    /// Returns the levels of the Hall sensors; 0 without the driver's board.
    pub fn hall_levels(&self) -> u8 {
        self.board.as_ref().map_or(0, |board| board.hall_levels(self.plant.motor_turns()))
    }

    /// Duty cycles in effect; `None` with the bridge open.
    pub fn applied_duty(&self) -> Option<[f64; 3]> {
        self.applied
    }

    /// Processor cycles at the start of the period.
    pub fn cycles(&self) -> u32 {
        self.cycles
    }
}

impl PowerStage for Stage {
    fn sample(&mut self) -> StageSample {
        if let Some(board) = &mut self.board {
            return board.sample(&mut self.plant, self.phases_swapped);
        }
        let measured = self.plant.measure();
        let mut valid = ValidChannels::CURRENT_A
            | ValidChannels::CURRENT_B
            | ValidChannels::BUS
            | ValidChannels::ENCODER;
        if self.encoder_lost > 0.0 && self.random.random_bool(self.encoder_lost) {
            valid -= ValidChannels::ENCODER;
        }
        StageSample {
            currents_a: measured.currents_a.map(|current| current as f32),
            bus_v: measured.bus_v as f32,
            encoder: encoder_angle(measured.encoder, ENCODER_BITS),
            valid,
        }
    }

    fn bridge_fault(&mut self) -> Option<BridgeFault> {
        if self.gate_fault {
            return Some(BridgeFault::GateDriver);
        }
        self.plant.is_tripped.then_some(BridgeFault::Overcurrent)
    }

    fn has_magnet_fault(&self) -> bool {
        self.board.as_ref().is_some_and(BoardSensors::has_magnet_fault)
    }

    fn is_touched(&self) -> bool {
        self.has_touched()
    }

    fn set_awake(&mut self, is_awake: bool) {
        self.is_awake = is_awake;
    }

    fn drive(&mut self, duty: [f32; 3]) {
        let [a, b, c] = duty.map(f64::from);
        self.pending = Some(if self.phases_swapped { [a, c, b] } else { [a, b, c] });
    }

    fn off(&mut self) {
        (self.pending, self.applied) = (None, None);
        self.plant.is_tripped = false;
    }

    fn brake(&mut self) {
        self.pending = Some([0.0; 3]);
    }

    fn cycles(&self) -> u32 {
        self.cycles.wrapping_add(self.delay + LOOP_CYCLES)
    }
}

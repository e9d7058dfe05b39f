//! The rig: the current loop on the simulated plant.
//!
//! Currents have 12 bits, the encoder has 14 bits. Duties act one period after the loop computes them.

use super::no_compensation::NoCompensation;
use super::plant::{Machine, Plant};
use compensator_core::LawKind;
use firmware::control::{
    Bridge, BridgeFault, Compensate, Covariates, CurrentLoop, CycleResult, JointCompensator,
    LoopFlags, MotorParameters, PowerStage, Setpoint, StageSample, ValidChannels, encoder_angle,
};
use std::f64::consts::TAU;

pub use firmware::control::PERIOD_S;

/// Returns the number of cycles in a time, s.
pub fn cycles(seconds: f64) -> usize {
    (seconds / f64::from(PERIOD_S)).round() as usize
}

/// The plant as a power stage.
pub struct Stage {
    pub plant: Plant,
    /// Duties of this period; `None` with the bridge open.
    active_duty: Option<[f64; 3]>,
    /// Duties of the next period.
    pending_duty: Option<[f64; 3]>,
    /// Channels that the stage measures.
    pub valid: ValidChannels,
    /// Time from the encoder's sample to that of the currents, s.
    pub encoder_age_s: f64,
    /// Replaces the next sample.
    pub injected_sample: Option<StageSample>,
    /// Angle that a hanging encoder repeats.
    pub frozen_encoder: Option<u32>,
    /// The encoder reports a fault of its magnet.
    pub magnet_fault: bool,
    /// Number of calls of `off`.
    pub off_count: usize,
    /// Fault that the hardware reports for the bridge.
    pub fault: Option<BridgeFault>,
    /// True if the gate driver holds its fault until its enable input is low.
    pub has_latched_fault: bool,
    /// True if the gate driver's enable input is high.
    pub is_awake: bool,
    /// Number of periods with the gate driver disabled.
    pub disabled_periods: usize,
    /// Offset of each phase's current measurement, A.
    pub shunt_offset_a: [f64; 3],
    /// Value of the processor's cycle counter at the start of the period.
    pub cycles: u32,
}

/// Processor cycles of a period.
pub const PERIOD_CYCLES: u32 = 8500;
/// Processor cycles of the loop in a period.
const LOOP_CYCLES: u32 = 3000;

/// Resolution of a 12-bit converter over +-60 A, A.
const CURRENT_STEP_A: f64 = 120.0 / 4096.0;

impl Stage {
    pub fn new(machine: Machine) -> Self {
        Self {
            plant: Plant::new(machine),
            active_duty: None,
            pending_duty: None,
            // A stage with two shunts.
            valid: ValidChannels::CURRENT_A
                | ValidChannels::CURRENT_B
                | ValidChannels::BUS
                | ValidChannels::ENCODER,
            encoder_age_s: 0.0,
            injected_sample: None,
            frozen_encoder: None,
            magnet_fault: false,
            off_count: 0,
            fault: None,
            has_latched_fault: false,
            is_awake: true,
            disabled_periods: 0,
            shunt_offset_a: [0.0; 3],
            cycles: 0,
        }
    }

    /// Returns the sample of a stage without faults.
    pub fn measure(&self) -> StageSample {
        let quantised = |current: f64| ((current / CURRENT_STEP_A).round() * CURRENT_STEP_A) as f32;
        let motor = &self.plant.machine;
        let lag_rad = self.plant.velocity() * motor.gear * self.encoder_age_s;
        let turns = (self.plant.motor_angle() - lag_rad) / TAU;
        StageSample {
            currents_a: std::array::from_fn(|phase| {
                quantised(self.plant.phase_currents()[phase] + self.shunt_offset_a[phase])
            }),
            bus_v: ((self.plant.machine.bus / 0.02).round() * 0.02) as f32,
            encoder: self
                .frozen_encoder
                .unwrap_or_else(|| encoder_angle(((turns - turns.floor()) * 16384.0) as u32, 14)),
            valid: self.valid,
        }
    }

    /// Simulates one period.
    pub fn advance(&mut self) {
        self.plant.advance(f64::from(PERIOD_S), self.active_duty);
        self.active_duty = self.pending_duty;
        self.cycles = self.cycles.wrapping_add(PERIOD_CYCLES);
    }

    /// Returns the power that the bridge takes from the bus in this period, W; negative while it charges the bus.
    pub fn bus_power_w(&self) -> f64 {
        let duty = self.active_duty.unwrap_or_default();
        let currents_a = self.plant.phase_currents();
        let bus_a: f64 = duty.iter().zip(currents_a).map(|(share, a)| share * a).sum();
        bus_a * self.plant.machine.bus
    }

    /// Returns true if the bridge is switching.
    pub fn is_on(&self) -> bool {
        self.active_duty.is_some() && !self.is_shorted()
    }

    /// Returns true if all low sides are closed.
    pub fn is_shorted(&self) -> bool {
        self.active_duty == Some([0.0; 3])
    }
}

impl PowerStage for Stage {
    fn sample(&mut self) -> StageSample {
        self.injected_sample.take().unwrap_or_else(|| self.measure())
    }
    fn bridge_fault(&mut self) -> Option<BridgeFault> {
        self.fault
    }
    fn has_magnet_fault(&self) -> bool {
        self.magnet_fault
    }
    fn set_awake(&mut self, awake: bool) {
        if !awake {
            self.disabled_periods += 1;
        }
        self.is_awake = awake;
        if self.has_latched_fault && !awake {
            (self.has_latched_fault, self.fault) = (false, None);
        }
    }
    fn drive(&mut self, duty: [f32; 3]) {
        // A disabled gate driver keeps the switches open.
        self.pending_duty = self.is_awake.then(|| duty.map(f64::from));
    }
    fn off(&mut self) {
        self.off_count += 1;
        // The switches open at once, not after the PWM's delay.
        (self.pending_duty, self.active_duty) = (None, None);
    }
    fn brake(&mut self) {
        self.drive([0.0; 3]);
    }
    fn cycles(&self) -> u32 {
        self.cycles.wrapping_add(LOOP_CYCLES)
    }
}

/// A current loop and its inputs, connected to the plant.
pub struct Rig<C> {
    pub stage: Stage,
    pub control: CurrentLoop<C>,
    pub setpoint: Setpoint,
    pub covariates: Covariates,
}

pub fn no_compensation() -> NoCompensation {
    NoCompensation { current_limit_a: 26.0, torque_constant_nm_per_a: 1.0 }
}

/// Returns the LuGre compensator of the reference joint. Its parameters approximate the plant's seal.
pub fn lugre(scale: f32) -> JointCompensator<f32> {
    let mut joint = firmware::reference_joint::configuration(LawKind::Lugre, &[]);
    joint.compensator.scale = scale;
    joint.compensator.torque_constant_nm_per_a = 0.98;
    JointCompensator::build(&joint, PERIOD_S).expect("the joint is valid")
}

/// Returns the motor parameters, with the plant's inertia.
pub fn parameters() -> MotorParameters {
    MotorParameters { inertia_kg_m2: 0.25, ..MotorParameters::default() }
}

impl<C: Compensate> Rig<C> {
    /// Returns a rig with a settled observer and an enabled bridge.
    pub fn settled(machine: Machine, motor: MotorParameters, compensator: C) -> Self {
        let motor = motor.build(PERIOD_S).expect("the motor is valid");
        let mut rig = Self {
            stage: Stage::new(machine),
            control: CurrentLoop::new(motor, compensator),
            setpoint: Setpoint { current_a: 0.0, velocity_reference_rad_s: 0.0, age_s: 0.0 },
            covariates: Covariates::MISSING,
        };
        rig.control.set_driving(true);
        let cycle = rig.run(cycles(0.05));
        assert!(!cycle.flags.intersects(LoopFlags::FAULTS), "{:?}", cycle.flags);
        rig
    }

    /// Runs one cycle of the loop and the period after it.
    pub fn cycle(&mut self) -> CycleResult {
        let sample = self.stage.sample();
        let cycle = self.control.step(&sample, &self.setpoint, &self.covariates);
        self.stage.apply(cycle.bridge);
        if let Bridge::Drive(duty) = cycle.bridge {
            assert!(duty.iter().all(|share| (0.0..=1.0).contains(share)), "{duty:?}");
        }
        self.stage.advance();
        cycle
    }

    /// Runs `count` cycles and returns the last result.
    pub fn run(&mut self, count: usize) -> CycleResult {
        let mut last = self.cycle();
        for _ in 1..count {
            last = self.cycle();
        }
        last
    }
}

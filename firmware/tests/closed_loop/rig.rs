//! The loop at the plant's bridge: 12-bit currents, 14-bit encoder, duties that act a period late.

use crate::plant::{Machine, Plant};
use compensator_core::LawKind;
use firmware::control::{
    Bridge, Broke, Compensate, Covariates, CurrentLoop, Cycle, JointCompensator, LoopFlags,
    MotorParameters, NoCompensation, PowerStage, Setpoint, StageSample, Valid, encoder_angle,
};
use std::f64::consts::TAU;

pub use firmware::control::PERIOD_S;

/// Cycles in so many seconds.
pub fn cycles(seconds: f64) -> usize {
    (seconds / f64::from(PERIOD_S)).round() as usize
}

/// The plant as a power stage.
pub struct Stage {
    pub plant: Plant,
    /// What acts in this period, and what was set for the next.
    acting: Option<[f64; 3]>,
    pending: Option<[f64; 3]>,
    pub valid: Valid,
    /// How long before the currents the encoder is read, s.
    pub encoder_age: f64,
    /// Put in the place of a sample, to see what the loop makes of it.
    pub forged: Option<StageSample>,
    pub offs: usize,
    /// What the hardware says of the bridge.
    pub broke: Option<Broke>,
    /// The gate driver holds its fault until it has slept.
    pub latched_fault: bool,
    pub awake: bool,
    /// Periods the gate driver slept.
    pub sleeps: usize,
    /// Added to what the shunts of phases a and b show, A.
    pub drift: [f64; 3],
    /// The processor's cycle counter at the start of the period.
    pub cycles: u32,
}

/// Cycles of a period, and of the loop in it.
pub const PERIOD_CYCLES: u32 = 8500;
const LOOP_CYCLES: u32 = 3000;

/// Amperes in a step of a 12-bit converter over +-60 A.
const CURRENT_STEP: f64 = 120.0 / 4096.0;

impl Stage {
    pub fn new(machine: Machine) -> Self {
        Self {
            plant: Plant::new(machine),
            acting: None,
            pending: None,
            // Two shunts.
            valid: Valid::CURRENT_A | Valid::CURRENT_B | Valid::BUS | Valid::ENCODER,
            encoder_age: 0.0,
            forged: None,
            offs: 0,
            broke: None,
            latched_fault: false,
            awake: true,
            sleeps: 0,
            drift: [0.0; 3],
            cycles: 0,
        }
    }

    /// What an honest stage would measure now.
    pub fn measured(&self) -> StageSample {
        let quantised = |current: f64| ((current / CURRENT_STEP).round() * CURRENT_STEP) as f32;
        let motor = &self.plant.machine;
        let since = self.plant.velocity() * motor.gear * self.encoder_age;
        let turns = (self.plant.motor_angle() - since) / TAU;
        StageSample {
            currents_a: std::array::from_fn(|phase| {
                quantised(self.plant.phases()[phase] + self.drift[phase])
            }),
            bus_v: ((self.plant.machine.bus / 0.02).round() * 0.02) as f32,
            encoder: encoder_angle(((turns - turns.floor()) * 16384.0) as u32, 14),
            valid: self.valid,
        }
    }

    /// The period passes.
    pub fn pass(&mut self) {
        self.plant.period(f64::from(PERIOD_S), self.acting);
        self.acting = self.pending;
        self.cycles = self.cycles.wrapping_add(PERIOD_CYCLES);
    }

    /// Whether the bridge acts.
    pub fn is_on(&self) -> bool {
        self.acting.is_some()
    }
}

impl PowerStage for Stage {
    fn sample(&mut self) -> StageSample {
        self.forged.take().unwrap_or_else(|| self.measured())
    }
    fn broke(&mut self) -> Option<Broke> {
        self.broke
    }
    fn wake(&mut self, awake: bool) {
        if !awake {
            self.sleeps += 1;
        }
        self.awake = awake;
        if self.latched_fault && !awake {
            (self.latched_fault, self.broke) = (false, None);
        }
    }
    fn drive(&mut self, duty: [f32; 3]) {
        // A gate driver that sleeps switches nothing.
        self.pending = self.awake.then(|| duty.map(f64::from));
    }
    fn off(&mut self) {
        self.offs += 1;
        // Switches open at once.
        (self.pending, self.acting) = (None, None);
    }
    fn cycles(&self) -> u32 {
        self.cycles.wrapping_add(LOOP_CYCLES)
    }
}

/// A joint on the bench.
pub struct Rig<C> {
    pub stage: Stage,
    pub control: CurrentLoop<C>,
    pub setpoint: Setpoint,
    pub covariates: Covariates,
}

pub fn none() -> NoCompensation {
    NoCompensation { current_limit_a: 26.0, torque_constant_nm_per_a: 1.0 }
}

/// The default joint's LuGre, as an identification of the plant's seal would give it.
pub fn lugre(scale: f32) -> JointCompensator<f32> {
    let mut joint = firmware::reference_joint::configuration(LawKind::Lugre, &[]);
    joint.compensator.scale = scale;
    joint.compensator.torque_constant_nm_per_a = 0.98;
    JointCompensator::build(&joint, PERIOD_S).expect("the joint is legal")
}

pub fn parameters() -> MotorParameters {
    MotorParameters { inertia_kg_m2: 0.25, ..MotorParameters::default() }
}

impl<C: Compensate> Rig<C> {
    /// A rig whose observer has settled, bridge allowed.
    pub fn settled(machine: Machine, written: MotorParameters, compensator: C) -> Self {
        let motor = written.build(PERIOD_S).expect("the motor is legal");
        let mut rig = Self {
            stage: Stage::new(machine),
            control: CurrentLoop::new(motor, compensator),
            setpoint: Setpoint { current_a: 0.0, velocity_reference_rad_s: 0.0, age_s: 0.0 },
            covariates: Covariates::none(),
        };
        rig.control.set_driving(true);
        let cycle = rig.run(cycles(0.05));
        assert!(!cycle.flags.intersects(LoopFlags::FAULTS), "{:?}", cycle.flags);
        rig
    }

    /// One cycle and the period after it.
    pub fn cycle(&mut self) -> Cycle {
        let sample = self.stage.sample();
        let cycle = self.control.step(&sample, &self.setpoint, &self.covariates);
        self.stage.apply(cycle.bridge);
        if let Bridge::Drive(duty) = cycle.bridge {
            assert!(duty.iter().all(|share| (0.0..=1.0).contains(share)), "{duty:?}");
        }
        self.stage.pass();
        cycle
    }

    /// So many cycles; gives the last.
    pub fn run(&mut self, count: usize) -> Cycle {
        let mut last = self.cycle();
        for _ in 1..count {
            last = self.cycle();
        }
        last
    }
}

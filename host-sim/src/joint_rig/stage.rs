//! The plant as a power stage: what the current loop's interrupt is connected to.
//!
//! Two shunts, a 14-bit encoder, duties that act a period late. Sensors are ideal but for the plant's noise, or those of the
//! driver's board ([`BoardSensors`]). The interrupt may come late or not at all; the timer then goes on with the
//! duties it has.

use super::Faults;
use super::board::BoardSensors;
use firmware::control::{Broke, PERIOD_S, PowerStage, StageSample, Valid, encoder_angle};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use simulated_machines::joint_plant::JointPlant;
use std::collections::VecDeque;

/// Cycles of a period at 170 MHz, and of the loop in it.
pub const PERIOD_CYCLES: u32 = 8500;
const LOOP_CYCLES: u32 = 3000;

/// Bits of the encoder.
const ENCODER_BITS: u32 = 14;

/// How the interrupt comes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interrupt {
    /// At once.
    #[default]
    InTime,
    /// So many cycles late.
    Late(u32),
    /// Not at all.
    Missed,
}

/// The most that was seen since it was last asked for: of what flows, not of what is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extremes {
    /// Phase current, A.
    pub current_a: f64,
    /// Bus voltage, V.
    pub bus_v: f64,
    /// Joint speed, rad/s.
    pub speed_rad_s: f64,
    /// Periods in which the bridge drove.
    pub driven: u32,
}

const NOTHING: Extremes = Extremes { current_a: 0.0, bus_v: 0.0, speed_rad_s: 0.0, driven: 0 };

/// The plant as a power stage.
pub struct Stage {
    /// The plant.
    pub plant: JointPlant,
    /// Sensors of the driver's board; without, ideal ones.
    pub board: Option<BoardSensors>,
    /// How the next interrupts come; in time where it is empty.
    pub interrupts: VecDeque<Interrupt>,
    /// Phases b and c are swapped at the motor.
    pub swapped: bool,
    /// The gate driver says that it has a fault, and drives nothing.
    pub gate_fault: bool,
    acting: Option<[f64; 3]>,
    pending: Option<[f64; 3]>,
    awake: bool,
    extremes: Extremes,
    cycles: u32,
    /// Cycles the interrupt under way began late.
    late: u32,
    /// Share of the encoder's readings that fail, 0..=1.
    encoder_lost: f64,
    random: Pcg64,
}

impl Stage {
    /// A stage with its bridge open.
    pub fn new(plant: JointPlant, faults: &Faults) -> Self {
        Self {
            plant,
            board: None,
            interrupts: VecDeque::new(),
            swapped: false,
            gate_fault: false,
            acting: None,
            pending: None,
            awake: true,
            extremes: NOTHING,
            cycles: 0,
            late: 0,
            encoder_lost: faults.encoder_lost,
            random: Pcg64::seed_from_u64(faults.seed),
        }
    }

    /// Whether there is an interrupt in this period, and how late it comes, cycles.
    pub fn interrupt(&mut self) -> Option<u32> {
        let late = match self.interrupts.pop_front().unwrap_or_default() {
            Interrupt::InTime => Some(0),
            Interrupt::Late(cycles) => Some(cycles),
            Interrupt::Missed => None,
        };
        self.late = late.unwrap_or(0);
        late
    }

    /// The period passes.
    pub fn pass(&mut self) {
        let closed = self.awake && !self.gate_fault;
        let acting = self.acting.filter(|_| closed);
        self.plant.period(f64::from(PERIOD_S), acting);
        self.note(acting.is_some());
        // Duties written after the top count from the next one on.
        if self.late + LOOP_CYCLES <= PERIOD_CYCLES {
            self.acting = self.pending;
        }
        self.cycles = self.cycles.wrapping_add(PERIOD_CYCLES);
    }

    /// Time passes without a processor, s: the switches under these duties, or open.
    pub fn alone(&mut self, seconds: f64, duty: Option<[f64; 3]>) {
        self.plant.period(seconds, duty);
        self.note(duty.is_some());
    }

    fn note(&mut self, driven: bool) {
        let most = &mut self.extremes;
        most.current_a = most.current_a.max(self.plant.take_peak_a());
        most.current_a =
            self.plant.phase_currents_a().into_iter().fold(most.current_a, |m, a| m.max(a.abs()));
        most.bus_v = most.bus_v.max(self.plant.bus_v());
        most.speed_rad_s = most.speed_rad_s.max(self.plant.velocity_rad_s().abs());
        most.driven += u32::from(driven);
    }

    /// The most since the last call.
    pub fn take_extremes(&mut self) -> Extremes {
        std::mem::replace(&mut self.extremes, NOTHING)
    }

    /// The duties that act; none with the bridge open.
    pub fn acting(&self) -> Option<[f64; 3]> {
        self.acting
    }

    /// The processor's cycles at the start of the period.
    pub fn cycles(&self) -> u32 {
        self.cycles
    }
}

impl PowerStage for Stage {
    fn sample(&mut self) -> StageSample {
        if let Some(board) = &mut self.board {
            return board.sample(&mut self.plant, self.swapped);
        }
        let measured = self.plant.measure();
        let mut valid = Valid::CURRENT_A | Valid::CURRENT_B | Valid::BUS | Valid::ENCODER;
        if self.encoder_lost > 0.0 && self.random.random_bool(self.encoder_lost) {
            valid -= Valid::ENCODER;
        }
        StageSample {
            currents_a: measured.currents_a.map(|current| current as f32),
            bus_v: measured.bus_v as f32,
            encoder: encoder_angle(measured.encoder, ENCODER_BITS),
            valid,
        }
    }

    fn broke(&mut self) -> Option<Broke> {
        if self.gate_fault {
            return Some(Broke::GateDriver);
        }
        self.plant.overcurrent_broke().then_some(Broke::Overcurrent)
    }

    fn wake(&mut self, awake: bool) {
        self.awake = awake;
    }

    fn drive(&mut self, duty: [f32; 3]) {
        let [a, b, c] = duty.map(f64::from);
        self.pending = Some(if self.swapped { [a, c, b] } else { [a, b, c] });
    }

    fn off(&mut self) {
        (self.pending, self.acting) = (None, None);
        self.plant.forget_break();
    }

    fn cycles(&self) -> u32 {
        self.cycles.wrapping_add(self.late + LOOP_CYCLES)
    }
}

//! The plant as a power stage: what the current loop's interrupt is connected to.
//!
//! Two shunts, a 14-bit encoder, duties that act a period late, a gate driver that never complains.

use super::Faults;
use firmware::control::{Broke, PERIOD_S, PowerStage, StageSample, Valid, encoder_angle};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use simulated_machines::joint_plant::JointPlant;

/// Cycles of a period at 170 MHz, and of the loop in it.
pub const PERIOD_CYCLES: u32 = 8500;
const LOOP_CYCLES: u32 = 3000;

/// Bits of the encoder.
const ENCODER_BITS: u32 = 14;

/// The plant as a power stage.
pub struct Stage {
    /// The plant.
    pub plant: JointPlant,
    acting: Option<[f64; 3]>,
    pending: Option<[f64; 3]>,
    cycles: u32,
    /// Share of the encoder's readings that fail, 0..=1.
    encoder_lost: f64,
    random: Pcg64,
}

impl Stage {
    /// A stage with its bridge open.
    pub fn new(plant: JointPlant, faults: &Faults) -> Self {
        let random = Pcg64::seed_from_u64(faults.seed);
        let encoder_lost = faults.encoder_lost;
        Self { plant, acting: None, pending: None, cycles: 0, encoder_lost, random }
    }

    /// The period passes.
    pub fn pass(&mut self) {
        self.plant.period(f64::from(PERIOD_S), self.acting);
        self.acting = self.pending;
        self.cycles = self.cycles.wrapping_add(PERIOD_CYCLES);
    }

    /// The processor's cycles at the start of the period.
    pub fn cycles(&self) -> u32 {
        self.cycles
    }
}

impl PowerStage for Stage {
    fn sample(&mut self) -> StageSample {
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
        None
    }

    fn wake(&mut self, _: bool) {}

    fn drive(&mut self, duty: [f32; 3]) {
        self.pending = Some(duty.map(f64::from));
    }

    fn off(&mut self) {
        (self.pending, self.acting) = (None, None);
    }

    fn cycles(&self) -> u32 {
        self.cycles.wrapping_add(LOOP_CYCLES)
    }
}

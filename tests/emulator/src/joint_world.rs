//! The joint around the chip: what its converters, encoders, comparators and sensors show of a simulated stage.
//!
//! The stage is that of a [`joint_rig`], with the plant, the bridge and the sensors of the board. The currents are sampled at the
//! trigger of the converters. An encoder that latches later shows the motor's way since then. Counts follow from the wiring.

use crate::chip::bme280::HousingAir;
use crate::chip::comparators::BreakLevels;
use crate::chip::ms5837::Water;
use crate::chip::timer20::Edges;
use crate::chip::wiring::{Quantity, Wiring};
use crate::world::{Bridge, World};
use firmware::background::BoardState;
use firmware::sensors::thermistor::Thermistor;
use joint_rig::{InterruptTiming, LineEdges, PERIOD_CYCLES, Stage};
use simulated_machines::joint_plant::Measured;

/// Longest block of instructions between two looks at the events of the chip, cycles. A missed interrupt is held for as much
/// longer, so that the trigger of the next period can hold it too.
const BLOCK_CYCLES: u32 = 400;

/// Counts of a full turn of the encoder.
const ENCODER_COUNTS: f64 = 16384.0;
/// Material constant B of all thermistors, K.
const THERMISTOR_BETA_K: f32 = 3435.0;
/// Temperature of a thermistor for which none is given, deg C.
const ROOM_C: f32 = 25.0;
/// Pressure inside the joint, Pa (see the board's scales.rs).
const INSIDE_PA: f64 = 101_325.0;
/// Range of the strain gauge amplifier, N, around half of the converter's range.
const FORCE_RANGE_N: f64 = 2000.0;

/// The joint around the chip.
pub struct JointWorld {
    /// The joint, its bridge, and the sensors of the board.
    pub stage: Stage,
    sampled: Measured,
    sampled_turns: f64,
    /// Position of the joint's side at the last sample, rad.
    sampled_rad: f64,
    is_low_side_on: [bool; 2],
    /// State of the board.
    pub state: BoardState,
    /// Thermistors of bridge and motor.
    thermistors: [ShownThermistor; 2],
    /// The pressure sensor is connected.
    pub has_pressure_sensor: bool,
    wiring: &'static Wiring,
}

impl JointWorld {
    /// Returns the surroundings of a chip with this wiring, without a pressure sensor.
    pub fn new(mut stage: Stage, wiring: &'static Wiring) -> Self {
        if let Some(board) = &mut stage.board {
            board.set_scales(wiring.currents, wiring.volts_per_count);
        }
        let sampled = stage.plant.measure();
        Self {
            sampled_turns: stage.plant.motor_turns(),
            sampled_rad: stage.plant.position_rad(),
            stage,
            sampled,
            is_low_side_on: [true; 2],
            state: BoardState::default(),
            thermistors: [None, None].map(|shown_c| ShownThermistor::new(wiring, shown_c)),
            has_pressure_sensor: false,
            wiring,
        }
    }

    /// Angle of the motor's shaft, turns, `seconds` after the last sample.
    fn shaft_turns(&self, seconds: f64) -> f64 {
        self.sampled_turns + self.stage.plant.motor_turns_in(seconds)
    }

    fn thermistor(&mut self, place: usize, temperature_c: Option<f32>) -> u16 {
        let shown = &mut self.thermistors[place];
        if shown.temperature_c != temperature_c {
            *shown = ShownThermistor::new(self.wiring, temperature_c);
        }
        shown.counts
    }
}

impl World for JointWorld {
    fn wiring(&self) -> &'static Wiring {
        self.wiring
    }

    fn advance(&mut self, seconds: f64, bridge: Bridge) {
        let duty = match bridge {
            Bridge::Driven(duty) if !self.stage.gate_fault => Some(duty),
            _ => None,
        };
        self.stage.run_driven(seconds, duty);
    }

    fn set_brake_output(&mut self, is_high: bool) {
        self.stage.plant.energise_brake(is_high);
    }

    fn sample(&mut self, is_low_side_on: [bool; 2]) {
        self.sampled = self.stage.plant.measure();
        self.sampled_turns = self.stage.plant.motor_turns();
        self.sampled_rad = self.stage.plant.position_rad();
        if self.stage.phases_swapped {
            self.sampled.currents_a.swap(1, 2);
        }
        self.is_low_side_on = is_low_side_on;
    }

    fn analog(&mut self, converter: usize, channel: u32) -> u16 {
        let Some(board) = &self.stage.board else { return 0 };
        let phases = board.phase_counts(self.sampled.currents_a, self.is_low_side_on);
        match self.wiring.quantity(converter, channel) {
            Some(Quantity::Phase(phase)) => phases[phase],
            Some(Quantity::Bus) => board.bus_counts(self.sampled.bus_v),
            Some(Quantity::Leak) => counts(self.state.enclosure.leak_share.unwrap_or(1.0).into()),
            Some(Quantity::Thermistor(place)) => {
                let state = &self.state;
                let shown = [state.bridge_temperature_c, state.motor_temperature_c];
                self.thermistor(place, shown[place])
            }
            Some(Quantity::Force) => {
                counts(0.5 + self.stage.plant.show().radial_force_n / FORCE_RANGE_N)
            }
            None => 0,
        }
    }

    fn shunts(&mut self) -> [u16; 3] {
        let Some(board) = &self.stage.board else { return [0; 3] };
        let inputs = &self.wiring.overcurrent;
        if let Some(chain) = inputs.chain {
            // The low side of phase c conducts, as at the top of the PWM.
            let is_on = [self.is_low_side_on[0], self.is_low_side_on[1], true];
            let currents_a = self.sampled.currents_a;
            return std::array::from_fn(|phase| {
                chain.counts(if is_on[phase] { currents_a[phase] } else { 0.0 })
            });
        }
        let phases = board.phase_counts(self.sampled.currents_a, self.is_low_side_on);
        let [first, second] = inputs.phases.map(|phase| phases[phase]);
        [first, second, first.midpoint(second)]
    }

    fn encoder(&mut self, word: u16, seconds: f64) -> u16 {
        let advance = self.stage.plant.motor_turns_in(seconds) * ENCODER_COUNTS;
        let angle = (f64::from(self.sampled.encoder) + advance).round() as i32 as u16;
        self.stage.board.as_ref().map_or(0xFFFF, |board| board.exchange_encoder_word(word, angle))
    }

    fn edges(&mut self, seconds: f64) -> Edges {
        let turns = self.shaft_turns(seconds);
        let Some(board) = &self.stage.board else { return Edges::default() };
        let LineEdges { shown, at_index } = board.edges(turns);
        Edges { count: shown, index: at_index, has_double_edge: false }
    }

    fn biss_frame(&mut self, seconds: f64) -> Option<u64> {
        let turns = self.shaft_turns(seconds);
        self.stage.board.as_ref().and_then(|board| board.serial_frame(turns))
    }

    fn joint_frame(&mut self, seconds: f64) -> Option<u64> {
        let position_rad = self.sampled_rad + self.stage.plant.velocity_rad_s() * seconds;
        self.stage.board.as_ref().and_then(|board| board.output_frame(position_rad))
    }

    fn hall_levels(&mut self, seconds: f64) -> Option<u8> {
        let turns = self.shaft_turns(seconds);
        self.stage.board.as_ref().map(|board| board.hall_levels(turns))
    }

    fn water(&self) -> Option<Water> {
        let plant = &self.stage.plant;
        self.has_pressure_sensor.then(|| Water {
            pressure_pa: plant.around.pressure_diff_pa + INSIDE_PA,
            temperature_c: plant.seal.shown_temperature_c(),
        })
    }

    fn air(&self) -> Option<HousingAir> {
        let air = self.state.enclosure.air?;
        Some(HousingAir {
            pressure_pa: air.pressure_pa.into(),
            temperature_c: air.temperature_c.into(),
            humidity_percent: air.humidity_percent.into(),
        })
    }

    fn torque_allowed(&self) -> [bool; 2] {
        self.state.enclosure.torque_allowed.unwrap_or([true; 2])
    }

    fn is_touched(&self) -> bool {
        self.stage.has_touched()
    }

    fn has_gate_fault(&self) -> bool {
        self.stage.gate_fault
    }

    fn set_break_levels(&mut self, levels: BreakLevels) {
        let inputs = &self.wiring.overcurrent;
        let chain = inputs.chain.unwrap_or(self.wiring.currents);
        let levels_a = std::array::from_fn(|signal| {
            // A positive current lowers the counts. The mean of two phases shows half of their sum.
            let scale = if signal == 2 && inputs.has_mean { 2.0 } else { 1.0 };
            let at = inputs.phases.get(signal).copied().unwrap_or(signal);
            let [below, above] = levels[at].map(|level| level.map(|level| chain.current_a(level)));
            [
                above.map_or(f64::NEG_INFINITY, |level_a| scale * level_a),
                below.map_or(f64::INFINITY, |level_a| scale * level_a),
            ]
        });
        self.stage.plant.set_break_levels(levels_a);
    }

    fn is_overcurrent(&self) -> bool {
        self.stage.plant.is_tripped
    }

    fn clear_break(&mut self) {
        self.stage.plant.is_tripped = false;
    }

    fn interrupt_delay(&mut self) -> u32 {
        match self.stage.interrupts.pop_front().unwrap_or_default() {
            InterruptTiming::OnTime => 0,
            InterruptTiming::Late(cycles) => cycles,
            InterruptTiming::Missed => PERIOD_CYCLES + BLOCK_CYCLES,
        }
    }
}

/// Returns the converter's counts for a share of its range.
fn counts(share: f64) -> u16 {
    (share * 4096.0).round().clamp(0.0, 4095.0) as u16
}

/// A thermistor, and the counts that its temperature takes long to compute.
#[derive(Clone, Copy)]
struct ShownThermistor {
    /// Its temperature, deg C; `None` if it is not given.
    temperature_c: Option<f32>,
    counts: u16,
}

impl ShownThermistor {
    fn new(wiring: &Wiring, temperature_c: Option<f32>) -> Self {
        let counts = thermistor_counts(wiring, temperature_c.unwrap_or(ROOM_C));
        Self { temperature_c, counts }
    }
}

/// Returns the converter's counts for a temperature, deg C.
fn thermistor_counts(wiring: &Wiring, temperature_c: f32) -> u16 {
    let thermistor =
        Thermistor { ratio_at_25: wiring.thermistor_ratio_at_25, beta_k: THERMISTOR_BETA_K };
    let is_colder =
        |counts: u16| thermistor.temperature_c(f32::from(counts) / 4096.0) < temperature_c;
    // The temperature changes in one direction with the counts.
    let (mut low, mut high) = (1u16, 4094u16);
    let falls = thermistor.temperature_c(0.9) < thermistor.temperature_c(0.1);
    while low < high {
        let middle = low.midpoint(high);
        if is_colder(middle) == falls { high = middle } else { low = middle + 1 }
    }
    if wiring.is_thermistor_above { 4096 - low } else { low }
}

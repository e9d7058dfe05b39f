//! Simulated sensors of the driver's own board: low-side shunts in counts, and an encoder over SPI.
//!
//! The simulation ends at the converter's counts and at the encoder's SPI words. The firmware's own code
//! (`sensors::shunt`, `sensors::as504x`) turns them into current and angle, including the offsets found at start-up.
//! The encoder answers each SPI frame with the angle at the end of the frame before. Two frames are exchanged in a period,
//! so that a sample is 6 us old. The noise and
//! the lag of the amplifiers are part of the plant.

use crate::incremental::{HallFault, Incremental, LineEdges, LineFault};
use firmware::control::{PERIOD_S, StageSample, ValidChannels};
use firmware::loop_parts::StageTraits;
use firmware::parameter_set::ParameterSet;
use firmware::sensors::as504x::FramePairs;
use firmware::sensors::biss;
use firmware::sensors::encoder::{EncoderInputs, EncoderKind, MotorEncoder};
use firmware::sensors::quadrature::Quadrature;
use firmware::sensors::shunt::{
    CONVERTER_RANGE_COUNTS, OFFSET_SAMPLES, OffsetFinder, OffsetRange, Shunt,
};
use firmware::start_values::StartValues;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use simulated_machines::joint_plant::{JointPlant, OutputEncoder, SerialEncoder, SerialFault};
use std::cell::RefCell;

/// A chain that shows a phase current as counts: a current into the motor lowers them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentChain {
    /// Scale.
    pub amperes_per_count: f64,
    /// Counts without a current.
    pub zero_counts: f64,
}

impl CurrentChain {
    /// Returns the phase current that these counts show, A, without the offset of the amplifiers.
    pub fn current_a(&self, counts: u16) -> f64 {
        (self.zero_counts - f64::from(counts)) * self.amperes_per_count
    }

    /// Returns the counts of a phase current, A.
    pub fn counts(&self, current_a: f64) -> u16 {
        let counts = self.zero_counts - current_a / self.amperes_per_count;
        counts.round().clamp(0.0, f64::from(CONVERTER_RANGE_COUNTS - 1)) as u16
    }
}

/// Scales of a board's shunts and of its bus divider, with the traits of its stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardScales {
    /// Shunts and amplifiers.
    pub currents: CurrentChain,
    /// Offsets of the amplifiers that the board accepts.
    pub offsets: OffsetRange,
    /// Resolution of the bus voltage, V.
    pub volts_per_count: f64,
    /// Traits of the stage.
    pub traits: StageTraits,
}

/// The driver's board: shunts of 1 mohm, amplified by 20, on 12 bits of 3.3 V; 68 k over 3.3 k.
pub const DRIVER_SCALES: BoardScales = BoardScales {
    currents: CurrentChain {
        amperes_per_count: 3.3 / (4096.0 * 0.001 * 20.0),
        zero_counts: (CONVERTER_RANGE_COUNTS / 2) as f64,
    },
    offsets: OffsetRange::CENTRAL,
    volts_per_count: 3.3 / 4096.0 * (68.0 + 3.3) / 3.3,
    traits: BOARD_TRAITS,
};

/// The B-G431B-ESC1: shunts of 3 mohm behind 1.5 k, with 2.2 k to ground and 22 k to 3.3 V, amplified by 16; 169 k over 18 k.
/// The offsets may be from 1.5 to 2.3 V.
pub const ESC1_SCALES: BoardScales = {
    let [shunt, ground, supply] = [1.0 / 1.5, 1.0 / 2.2, 1.0 / 22.0];
    let sum = shunt + ground + supply;
    let amperes_per_count = 3.3 / (4096.0 * 0.003 * 16.0 * shunt / sum);
    let offsets = OffsetRange { above: 1861, below: 2854 };
    BoardScales {
        currents: CurrentChain { amperes_per_count, zero_counts: 4096.0 * 16.0 * supply / sum },
        offsets,
        volts_per_count: 3.3 / 4096.0 * (169.0 + 18.0) / 18.0,
        traits: StageTraits {
            encoder_age_s: 0.0,
            biss_age_s: 0.0,
            current_max_a: offsets.measurable_a(amperes_per_count as f32),
            ..BOARD_TRAITS
        },
    }
};

/// Time from the end of the first frame of a period, when the encoder latches the angle, to the top of the PWM, s: 1060
/// cycles at 170 MHz (see the board's encoder.rs).
const LATCH_BEFORE_TOP_S: f32 = 1060.0 / 170e6;

/// Time from the first rising edge of a BiSS frame's clock to the top of the PWM, s: 1649 cycles at 170 MHz.
const BISS_BEFORE_TOP_S: f32 = 1649.0 / 170e6;

/// Time from the top of the PWM to the latch of the encoder at the joint's side, s: conversion and interrupt, 28 us, then the
/// background wakes. On the board no commands come while a report is sent. Here they delay it by two periods.
const AWAKE_AFTER_S: f64 = 28e-6 - 2.0 * PERIOD_S as f64;

/// Stage traits of the board: dead time 0.5 us, amplifier settling 1.5 us, and the encoder age at the top of the
/// period, which is the time since the end of the first encoder frame.
pub const BOARD_TRAITS: StageTraits = StageTraits {
    encoder_age_s: LATCH_BEFORE_TOP_S,
    biss_age_s: BISS_BEFORE_TOP_S,
    current_max_a: OffsetRange::CENTRAL.measurable_a((3.3 / (4096.0 * 0.001 * 20.0)) as f32),
    modulation_max: StageTraits::max_modulation(PERIOD_S, 0.5e-6, 1.5e-6),
};

/// A fault of the encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum EncoderFault {
    /// No fault.
    #[default]
    None,
    /// Valid frames, but the angle stays at its value when the fault began.
    Frozen,
    /// The magnet is off its shaft: the angle stands, and its noise goes on.
    Detached,
    /// The encoder counts down while the motor turns in its phase sequence.
    Reversed,
    /// The angle is off by this number of counts, as where the magnet has slipped.
    Jump(u16),
    /// Data line shorted to ground: every word is 0.
    Low,
    /// Data line open and pulled up: every word is all ones.
    High,
    /// Weak magnet: standard deviation of the angle, in counts of 14 bits.
    Weak(f64),
    /// Share of words with one wrong bit, from 0 to 1.
    Disturbed(f64),
}

#[derive(Debug)]
struct EncoderState {
    angle: u16,
    answer: u16,
    fault: EncoderFault,
    frozen_angle: Option<u16>,
    random: Pcg64,
}

const DATA_MASK: u16 = 0x3FFF;
const ANGLE_REGISTER: u16 = 0x3FFF;
const DIAGNOSTICS_REGISTER: u16 = 0x3FFC;
const MAGNET_TOO_WEAK: u16 = 1 << 11;

fn with_even_parity(word: u16) -> u16 {
    word | (((word.count_ones() & 1) as u16) << 15)
}

/// Noise of a healthy encoder, counts, one standard deviation: 0.068 degrees (AS5047P, data sheet).
const ENCODER_NOISE_COUNTS: f64 = 3.1;

impl EncoderState {
    fn noisy_angle(&mut self, angle: u16, deviation: f64) -> u16 {
        let noise: f64 = StandardNormal.sample(&mut self.random);
        angle.wrapping_add((deviation * noise).round() as i16 as u16) & DATA_MASK
    }

    fn exchange(&mut self, command: u16) -> u16 {
        let answer = self.answer;
        // The error register is always empty.
        let shown = match self.fault {
            EncoderFault::Detached => *self.frozen_angle.get_or_insert(self.angle),
            EncoderFault::Reversed => self.angle.wrapping_neg(),
            EncoderFault::Jump(counts) => self.angle.wrapping_add(counts),
            _ => self.angle,
        };
        let angle = match self.fault {
            EncoderFault::Frozen => *self.frozen_angle.get_or_insert(self.angle),
            EncoderFault::Weak(deviation) => self.noisy_angle(shown, deviation),
            _ => self.noisy_angle(shown, ENCODER_NOISE_COUNTS),
        };
        self.answer = with_even_parity(match (command & DATA_MASK, self.fault) {
            (ANGLE_REGISTER, _) => angle,
            (DIAGNOSTICS_REGISTER, EncoderFault::Weak(_)) => MAGNET_TOO_WEAK,
            _ => 0,
        });
        match self.fault {
            EncoderFault::Low => 0,
            EncoderFault::High => 0xFFFF,
            EncoderFault::Disturbed(share) if self.random.random_bool(share) => {
                answer ^ (1 << self.random.random_range(0..16))
            }
            _ => answer,
        }
    }
}

/// What the encoder's code reads in a period of the rig.
struct PeriodInputs<'a> {
    state: &'a mut EncoderState,
    commands: &'a mut [u16; 2],
    incremental: &'a mut Incremental,
    serial: &'a mut SerialEncoder,
    /// Angle that an AS504x latches, counts; that which an encoder with BiSS C latches, and the present one, turns.
    latched: u16,
    serial_turns: f64,
    /// The last frame of BiSS C.
    serial_frame: &'a mut u64,
    turns: f64,
}

impl EncoderInputs for PeriodInputs<'_> {
    fn frames(&mut self) -> Option<[u16; 2]> {
        self.state.angle = self.latched & DATA_MASK;
        Some(self.commands.map(|command| self.state.exchange(command)))
    }

    fn set_commands(&mut self, commands: [u16; 2]) {
        *self.commands = commands;
    }

    fn quadrature(&mut self) -> Quadrature {
        self.incremental.turn_to(self.turns);
        self.incremental.read()
    }

    fn hall(&mut self) -> u8 {
        self.incremental.levels(self.turns)
    }

    fn biss(&mut self) -> Option<[u16; biss::WORDS]> {
        let frame = self.serial.frame(self.serial_turns);
        *self.serial_frame = frame;
        Some(words_of(frame))
    }
}

/// Returns the first words of a frame of BiSS C.
fn words_of<const N: usize>(frame: u64) -> [u16; N] {
    let word = |at: usize| frame << (at as u32 * biss::WORD_BITS) >> (64 - biss::WORD_BITS);
    std::array::from_fn(|at| word(at) as u16)
}

/// Shunts and encoder of the board.
#[derive(Debug)]
pub struct BoardSensors {
    shunts: [Option<Shunt>; 2],
    encoder: MotorEncoder,
    commands: [u16; 2],
    state: RefCell<EncoderState>,
    incremental: RefCell<Incremental>,
    serial: RefCell<SerialEncoder>,
    is_serial: bool,
    /// The last frame of BiSS C.
    serial_frame: u64,
    /// Encoder at the joint's side of the gear; without one its line is open.
    output: RefCell<OutputEncoder>,
    has_output: bool,
    /// Drift of the amplifiers of phases a and b since start-up, A.
    pub drift_a: [f64; 2],
    scales: BoardScales,
}

impl BoardSensors {
    /// Starts the sensors with an open bridge, and the encoder of this set; finds the offsets of the shunts.
    pub fn start(
        plant: &mut JointPlant,
        set: &ParameterSet,
        scales: BoardScales,
        seed: u64,
    ) -> Self {
        let values = StartValues::of(set);
        let state = RefCell::new(EncoderState {
            angle: 0,
            answer: 0,
            fault: EncoderFault::None,
            frozen_angle: None,
            random: Pcg64::seed_from_u64(seed ^ 0xe4c0),
        });
        let mut sensors = Self {
            shunts: [None; 2],
            encoder: MotorEncoder::new(&values),
            commands: FramePairs::FIRST_COMMANDS,
            state,
            incremental: RefCell::new(Incremental::new(plant.pole_pairs(), seed)),
            serial: RefCell::new(SerialEncoder::new(seed)),
            serial_frame: 0,
            is_serial: values.kind() == EncoderKind::Biss,
            output: RefCell::new(OutputEncoder::new(seed)),
            has_output: values.has_joint_encoder(),
            drift_a: [0.0; 2],
            scales,
        };
        let mut finders = [OffsetFinder::default(); 2];
        for _ in 0..OFFSET_SAMPLES {
            let measured = plant.measure();
            for (phase, finder) in finders.iter_mut().enumerate() {
                finder.add_sample(sensors.counts(phase, measured.currents_a[phase]));
            }
        }
        sensors.shunts = finders
            .map(|finder| finder.shunt(scales.offsets, -scales.currents.amperes_per_count as f32));
        sensors
    }

    /// Sets the scales of another board's shunts and bus divider, for a driver outside of the rig.
    pub fn set_scales(&mut self, currents: CurrentChain, volts_per_count: f64) {
        (self.scales.currents, self.scales.volts_per_count) = (currents, volts_per_count);
    }

    /// Returns true if the encoder reports a fault of its magnet.
    pub fn has_magnet_fault(&self) -> bool {
        self.encoder.has_warning()
    }

    /// Starts the evaluation of the encoder anew, as after a reset of the driver.
    pub fn restart_encoder(&mut self, values: &StartValues) {
        self.encoder = MotorEncoder::new(values);
        self.commands = FramePairs::FIRST_COMMANDS;
    }

    /// Sets the fault of the encoder with BiSS C from now on.
    pub fn set_serial(&mut self, fault: SerialFault) {
        self.serial.borrow_mut().set_fault(fault);
    }

    /// Returns the levels that an encoder with BiSS C shows at the rising edges of its clock if it latches this angle, turns;
    /// `None` if an AS504x is connected.
    pub fn serial_frame(&self, turns: f64) -> Option<u64> {
        self.is_serial.then(|| self.serial.borrow_mut().frame(turns))
    }

    /// Returns the first words of the last frame of BiSS C; `None` if an AS504x is connected.
    pub fn biss_words(&self) -> Option<[u16; biss::TURN_WORDS]> {
        self.is_serial.then(|| words_of(self.serial_frame))
    }

    /// The encoder at the joint's side of the gear, for its errors and faults.
    pub fn output_encoder(&mut self) -> &mut OutputEncoder {
        self.output.get_mut()
    }

    /// Returns the levels of the line of the encoder at the joint's side if it latches this position, rad; `None` without one.
    pub fn output_frame(&self, position_rad: f64) -> Option<u64> {
        self.has_output.then(|| self.output.borrow_mut().frame(position_rad))
    }

    /// Returns the words that the driver reads of the encoder at the joint's side when a report has come.
    pub fn output_words(&self, plant: &JointPlant) -> Option<[u16; biss::WORDS]> {
        let position_rad = plant.position_rad() + AWAKE_AFTER_S * plant.velocity_rad_s();
        self.output_frame(position_rad).map(words_of)
    }

    /// Sets the fault of the quadrature encoder from now on.
    pub fn set_lines(&mut self, fault: LineFault) {
        self.incremental.borrow_mut().set_line_fault(fault);
    }

    /// Sets the fault of the Hall sensors from now on.
    pub fn set_hall(&mut self, fault: HallFault) {
        self.incremental.borrow_mut().set_hall_fault(fault);
    }

    /// Returns the edges of the quadrature encoder at this angle, turns.
    pub fn edges(&self, turns: f64) -> LineEdges {
        let mut incremental = self.incremental.borrow_mut();
        incremental.turn_to(turns);
        incremental.take_edges()
    }

    /// Returns the levels of the Hall sensors at this angle, turns.
    pub fn hall_levels(&self, turns: f64) -> u8 {
        self.incremental.borrow_mut().levels(turns)
    }

    /// Sets the fault of the encoder from now on.
    pub fn set_encoder(&mut self, fault: EncoderFault) {
        let mut state = self.state.borrow_mut();
        (state.fault, state.frozen_angle) = (fault, None);
    }

    /// Returns the converter's counts for a phase current. A current into the motor lowers the counts. The amplifiers have
    /// initial offsets of about 0.1 A.
    fn counts(&self, phase: usize, current_a: f64) -> u16 {
        let offset_a = [0.1, -0.07][phase] + self.drift_a[phase];
        self.scales.currents.counts(current_a + offset_a)
    }

    /// Returns the converter's counts for phases a and b. A phase whose low side does not conduct shows no current.
    pub fn phase_counts(&self, currents_a: [f64; 3], is_low_side_on: [bool; 2]) -> [u16; 2] {
        std::array::from_fn(|phase| {
            let current_a = if is_low_side_on[phase] { currents_a[phase] } else { 0.0 };
            self.counts(phase, current_a)
        })
    }

    /// Returns the converter's counts for a bus voltage.
    pub fn bus_counts(&self, bus_v: f64) -> u16 {
        let counts = (bus_v / self.scales.volts_per_count).floor();
        counts.clamp(0.0, f64::from(CONVERTER_RANGE_COUNTS - 1)) as u16
    }

    /// Exchanges an SPI word with the encoder, which shows this angle, in its counts.
    pub fn exchange_encoder_word(&self, word: u16, angle: u16) -> u16 {
        let mut state = self.state.borrow_mut();
        state.angle = angle & DATA_MASK;
        state.exchange(word)
    }

    /// Returns one sample for the current loop. `phases_swapped` swaps phases b and c, as at a miswired motor.
    pub fn sample(&mut self, plant: &mut JointPlant, phases_swapped: bool) -> StageSample {
        let mut measured = plant.measure();
        if phases_swapped {
            measured.currents_a.swap(1, 2);
        }
        // The angle at the end of the first frame, which the second one answers.
        let advance =
            plant.motor_turns_in(-f64::from(LATCH_BEFORE_TOP_S)) * f64::from(DATA_MASK + 1);
        let shown = (f64::from(measured.encoder) + advance).round() as i32 as u16;
        let angle = self.encoder.angle(&mut PeriodInputs {
            state: self.state.get_mut(),
            commands: &mut self.commands,
            incremental: self.incremental.get_mut(),
            serial: self.serial.get_mut(),
            serial_turns: plant.motor_turns() + plant.motor_turns_in(-f64::from(BISS_BEFORE_TOP_S)),
            serial_frame: &mut self.serial_frame,
            latched: shown,
            turns: plant.motor_turns(),
        });
        let [a, b] = std::array::from_fn(|phase| {
            let counts = self.counts(phase, measured.currents_a[phase]);
            self.shunts[phase].and_then(|shunt| shunt.current_a(counts))
        });
        let step_v = self.scales.volts_per_count;
        let mut valid = ValidChannels::BUS;
        valid.set(ValidChannels::CURRENT_A, a.is_some());
        valid.set(ValidChannels::CURRENT_B, b.is_some());
        valid.set(ValidChannels::ENCODER, angle.is_some());
        StageSample {
            currents_a: [a.unwrap_or(0.0), b.unwrap_or(0.0), 0.0],
            bus_v: (((measured.bus_v / step_v).floor() + 0.5) * step_v) as f32,
            encoder: angle.unwrap_or(0),
            valid,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use simulated_machines::joint_plant::{Load, Parameters};

    /// At a motor speed of 600 rad/s a microsecond is 1.6 counts; noise of 3.1 counts leaves 0.05 in the mean of 4000.
    #[test]
    fn board_encoder_at_speed_has_age_of_traits() {
        let mut plant = JointPlant::new(&Parameters::default(), Load::Free, 1);
        let mut sensors =
            BoardSensors::start(&mut plant, &ParameterSet::default(), DRIVER_SCALES, 1);
        while plant.velocity_rad_s() < 12.0 {
            plant.period_at_current(f64::from(PERIOD_S), 20.0);
        }
        let (mut age_s, mut count) = (0.0, 0.0);
        for period in 0..4000 {
            let sample = sensors.sample(&mut plant, false);
            let truth = plant.position_rad() * 51.0 / std::f64::consts::TAU;
            let measured = f64::from(sample.encoder) / 4_294_967_296.0;
            let lag = (truth - measured + 0.5).rem_euclid(1.0) - 0.5;
            // The encoder rounds its reading down to a count.
            let lag = lag - 0.5 / 16384.0;
            if period > 0 {
                age_s += lag / (plant.velocity_rad_s() * 51.0 / std::f64::consts::TAU);
                count += 1.0;
            }
            plant.period_at_current(f64::from(PERIOD_S), 3.0);
        }
        let age_us = 1e6 * age_s / count;
        let expected_us = f64::from(BOARD_TRAITS.encoder_age_s) * 1e6;
        assert!((age_us - expected_us).abs() < 0.7, "{age_us} us, expected {expected_us} us");
    }
}

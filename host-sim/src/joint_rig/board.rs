//! Sensors of a power stage as on the driver's own board: low-side shunts in counts, and an encoder over SPI.
//!
//! Counts and words become current and angle by the firmware's own code (`sensors::shunt`, `sensors::as504x`), offsets
//! found at the start included; what is simulated here ends at the converter and at the encoder's pins. An encoder answers
//! a frame with the angle it had at the frame before: 48 us of age at the sample. Noise and lag of the amplifiers are the
//! plant's.

use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use firmware::control::{PERIOD_S, StageSample, Valid, encoder_angle};
use firmware::loop_parts::StageTraits;
use firmware::sensors::as504x::{ANGLE_BITS, As504x};
use firmware::sensors::shunt::{OFFSET_SAMPLES, OffsetFinder, RANGE, Shunt};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use simulated_machines::joint_plant::JointPlant;
use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;

/// Shunts of 1 mohm, amplified by 20, on 12 bits of 3.3 V.
const AMPERES_PER_COUNT: f64 = 3.3 / (4096.0 * 0.001 * 20.0);

/// An encoder's frame begins so long after the top, s.
const FRAME_AFTER_TOP_S: f32 = 2e-6;

/// The stage's traits as the board's table makes them: dead time 0.5 us, amplifiers settled after 1.5 us, and an angle as old
/// as the frame before is at the top.
pub const TRAITS: StageTraits = StageTraits {
    encoder_age_s: PERIOD_S - FRAME_AFTER_TOP_S,
    modulation_max: StageTraits::modulation_for(PERIOD_S, 0.5e-6, 1.5e-6),
};

/// What is wrong with the encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum EncoderFault {
    /// Nothing.
    #[default]
    None,
    /// It answers properly, and always with the angle it had then.
    Frozen,
    /// Its line lies low: every word is 0.
    Low,
    /// Its line is open and pulled up: every word is ones.
    High,
    /// Its magnet is weak: so much noise on the angle, counts of 14 bits, one standard deviation.
    Weak(f64),
    /// This share of its words comes with a wrong bit.
    Disturbed(f64),
}

#[derive(Debug)]
struct Pins {
    angle: u16,
    answer: u16,
    fault: EncoderFault,
    frozen: Option<u16>,
    random: Pcg64,
}

/// The encoder's end of the wire.
#[derive(Clone, Debug)]
struct Encoder(Rc<RefCell<Pins>>);

const DATA: u16 = 0x3FFF;

fn even(word: u16) -> u16 {
    word | (((word.count_ones() & 1) as u16) << 15)
}

/// Noise of a sound encoder, counts, one standard deviation: 0.068 degrees (AS5047P, data sheet).
const NOISE: f64 = 3.1;

impl Pins {
    fn noisy(&mut self, deviation: f64) -> u16 {
        let noise: f64 = StandardNormal.sample(&mut self.random);
        self.angle.wrapping_add((deviation * noise).round() as i16 as u16) & DATA
    }

    fn frame(&mut self, command: u16) -> u16 {
        let answer = self.answer;
        // A read of the angle, or of the errors: none of its own.
        let angle = match self.fault {
            EncoderFault::Frozen => *self.frozen.get_or_insert(self.angle),
            EncoderFault::Weak(deviation) => self.noisy(deviation),
            _ => self.noisy(NOISE),
        };
        self.answer = even(if command & DATA == DATA { angle } else { 0 });
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

impl ErrorType for Encoder {
    type Error = Infallible;
}

impl SpiDevice<u16> for Encoder {
    fn transaction(&mut self, operations: &mut [Operation<'_, u16>]) -> Result<(), Infallible> {
        let mut pins = self.0.borrow_mut();
        for operation in operations {
            if let Operation::TransferInPlace(words) = operation {
                words.iter_mut().for_each(|word| *word = pins.frame(*word));
            }
        }
        Ok(())
    }
}

/// Shunts and encoder.
#[derive(Debug)]
pub struct BoardSensors {
    shunts: [Option<Shunt>; 2],
    encoder: As504x<Encoder>,
    pins: Rc<RefCell<Pins>>,
    /// How far the amplifiers of phases a and b have drifted since the start, A.
    pub drift_a: [f64; 2],
    /// Bus voltage is measured in steps of so many volts.
    bus_step_v: f64,
}

impl BoardSensors {
    /// Sensors at the start, the bridge open: offsets are found.
    pub fn start(plant: &mut JointPlant, seed: u64) -> Self {
        let pins = Rc::new(RefCell::new(Pins {
            angle: 0,
            answer: 0,
            fault: EncoderFault::None,
            frozen: None,
            random: Pcg64::seed_from_u64(seed ^ 0xe4c0),
        }));
        let mut sensors = Self {
            shunts: [None; 2],
            encoder: As504x::new(Encoder(Rc::clone(&pins))),
            pins,
            drift_a: [0.0; 2],
            bus_step_v: 3.3 / 4096.0 * (68.0 + 3.3) / 3.3,
        };
        let mut finders = [OffsetFinder::default(); 2];
        for _ in 0..OFFSET_SAMPLES {
            let measured = plant.measure();
            for (phase, finder) in finders.iter_mut().enumerate() {
                finder.take(sensors.counts(phase, measured.currents_a[phase]));
            }
        }
        sensors.shunts = finders.map(|finder| finder.shunt(-AMPERES_PER_COUNT as f32));
        sensors
    }

    /// From now on this is wrong with the encoder.
    pub fn set_encoder(&mut self, fault: EncoderFault) {
        let mut pins = self.pins.borrow_mut();
        (pins.fault, pins.frozen) = (fault, None);
    }

    /// What a converter gives: a current into the motor pulls the shunt down; amplifiers a tenth of an ampere off the
    /// middle to begin with.
    fn counts(&self, phase: usize, current_a: f64) -> u16 {
        let offset_a = [0.1, -0.07][phase] + self.drift_a[phase];
        let counts = f64::from(RANGE / 2) - (current_a + offset_a) / AMPERES_PER_COUNT;
        counts.round().clamp(0.0, f64::from(RANGE - 1)) as u16
    }

    /// What the current loop is given; phases b and c may be swapped at the motor.
    pub fn sample(&mut self, plant: &mut JointPlant, swapped: bool) -> StageSample {
        let mut measured = plant.measure();
        if swapped {
            measured.currents_a.swap(1, 2);
        }
        // What the magnet shows when the frame begins; the answer is that of the frame before.
        let later = plant.motor_turns_in(f64::from(FRAME_AFTER_TOP_S)) * f64::from(DATA + 1);
        let shown = (f64::from(measured.encoder) + later).round() as i32;
        self.pins.borrow_mut().angle = shown as u16 & DATA;
        let angle = self.encoder.angle().ok();
        let [a, b] = std::array::from_fn(|phase| {
            let counts = self.counts(phase, measured.currents_a[phase]);
            self.shunts[phase].and_then(|shunt| shunt.current_a(counts))
        });
        let mut valid = Valid::BUS;
        valid.set(Valid::CURRENT_A, a.is_some());
        valid.set(Valid::CURRENT_B, b.is_some());
        valid.set(Valid::ENCODER, angle.is_some());
        StageSample {
            currents_a: [a.unwrap_or(0.0), b.unwrap_or(0.0), 0.0],
            bus_v: (((measured.bus_v / self.bus_step_v).floor() + 0.5) * self.bus_step_v) as f32,
            encoder: angle.map_or(0, |angle| encoder_angle(u32::from(angle), ANGLE_BITS)),
            valid,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use simulated_machines::joint_plant::{Load, Parameters};

    /// At 600 rad/s of the motor a microsecond is 1.6 counts; noise of 3.1 counts leaves 0.05 in the mean of 4000.
    #[test]
    fn an_angle_is_as_old_as_the_traits_say() {
        let mut plant = JointPlant::new(&Parameters::default(), Load::Free, 1);
        let mut sensors = BoardSensors::start(&mut plant, 1);
        while plant.velocity_rad_s() < 12.0 {
            plant.period_at_current(f64::from(PERIOD_S), 20.0);
        }
        let (mut age_s, mut count) = (0.0, 0.0);
        for period in 0..4000 {
            let sample = sensors.sample(&mut plant, false);
            let truth = plant.position_rad() * 51.0 / std::f64::consts::TAU;
            let seen = f64::from(sample.encoder) / 4_294_967_296.0;
            let behind = (truth - seen + 0.5).rem_euclid(1.0) - 0.5;
            // The reading is rounded down to a count.
            let behind = behind - 0.5 / 16384.0;
            if period > 0 {
                age_s += behind / (plant.velocity_rad_s() * 51.0 / std::f64::consts::TAU);
                count += 1.0;
            }
            plant.period_at_current(f64::from(PERIOD_S), 3.0);
        }
        let age_us = 1e6 * age_s / count;
        let said_us = f64::from(TRAITS.encoder_age_s) * 1e6;
        assert!((age_us - said_us).abs() < 0.7, "{age_us} us, said to be {said_us} us");
    }
}

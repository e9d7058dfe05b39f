//! Runs whose output bits must agree between a PC and a Cortex-M4F.
//!
//! Replay on a PC is an equality check, not a tolerance, only if the same step gives the same bits
//! everywhere. Each run here feeds 10,000 samples to a model and takes the CRC-32 of every output
//! word; the PC and QEMU print the same eight digits or the comparison fails. The samples come from
//! an integer generator and exactly rounded operations alone, so that a difference is the step's.
//! They rest, preslide, slide both ways, pass the Stribeck range, leave the envelope and are now and
//! then not a number. One bit of one step anywhere changes the fingerprint.

use crate::control::PERIOD_S;
use crate::reference_joint::configuration;
use compensator_core::compensator::Reading;
use compensator_core::model::{Sample, State};
use compensator_core::network::{NetworkState, reference as reference_network};
use compensator_core::{Compensator, Fixed, Inputs, LawKind, Real, TermKind};

/// Samples in a run.
pub const STEPS: usize = 10_000;

const CRC: crc::Crc<u32, crc::NoTable> = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);

#[cfg(feature = "terms")]
const TERMS: &[TermKind] = &[
    TermKind::TemperatureViscous,
    TermKind::PositionRipple,
    TermKind::GravityImbalance,
    TermKind::DwellTimeStatic,
    TermKind::Backlash,
    TermKind::ChannelDelay,
];

#[cfg(feature = "terms")]
const UNKNOWN: &[TermKind] = &[TermKind::LookupTable];

/// The runs: name and fingerprint, in the order they are printed.
pub fn all() -> impl Iterator<Item = (&'static str, u32)> {
    let runs = [
        ("lugre f32", (|| run::<f32>(LawKind::Lugre, &[])) as fn() -> u32),
        ("lugre Fixed", || run::<Fixed>(LawKind::Lugre, &[])),
        ("improved-lugre f32", || run::<f32>(LawKind::ImprovedLugre, &[])),
        ("improved-lugre Fixed", || run::<Fixed>(LawKind::ImprovedLugre, &[])),
        #[cfg(feature = "terms")]
        ("improved-lugre + 6 terms f32", || run::<f32>(LawKind::ImprovedLugre, TERMS)),
        #[cfg(feature = "terms")]
        ("improved-lugre + 6 terms Fixed", || run::<Fixed>(LawKind::ImprovedLugre, TERMS)),
        #[cfg(feature = "terms")]
        ("improved-lugre + unknown f32", || run::<f32>(LawKind::ImprovedLugre, UNKNOWN)),
        #[cfg(feature = "terms")]
        ("improved-lugre + unknown Fixed", || run::<Fixed>(LawKind::ImprovedLugre, UNKNOWN)),
        ("lugre-lstm f32", run_network::<f32>),
        ("lugre-lstm Fixed", run_network::<Fixed>),
    ];
    runs.into_iter().map(|(name, run)| (name, run()))
}

/// The output bits of a number.
pub trait Bits: Real<Setting = f32> {
    /// All of them.
    fn bits(self) -> u32;
}

impl Bits for f32 {
    fn bits(self) -> u32 {
        self.to_bits()
    }
}

impl Bits for Fixed {
    fn bits(self) -> u32 {
        self.to_bits() as u32
    }
}

/// Runs a compensator and its sum over the samples; 0 where the joint is refused.
fn run<T: Bits>(law: LawKind, terms: &[TermKind]) -> u32 {
    let configuration = configuration(law, terms);
    let Ok(mut compensator) = Compensator::<T>::build(&configuration, PERIOD_S) else {
        return 0;
    };
    compensator.set_enabled(true);
    // The bare model as well: it sees the velocities the compensator's guards keep from it.
    let Ok(model) = configuration.model.build::<T>(PERIOD_S) else {
        return 0;
    };
    let mut state = State::default();
    let mut digest = CRC.digest();
    let mut samples = Samples::new();
    for _ in 0..STEPS {
        let inputs = samples.inputs::<T>();
        let output = compensator.step(&inputs);
        let (current, flags) = compensator.sum(T::from_f64(0.5), &output);
        let sample = Sample { velocity_rad_s: inputs.velocity_rad_s.value, ..Sample::default() };
        for word in [
            output.friction_torque_nm.bits(),
            output.feed_forward_current_a.bits(),
            current.bits(),
            flags.bits(),
            model.step(&mut state, &sample).bits(),
        ] {
            digest.update(&word.to_le_bytes());
        }
    }
    digest.finalize()
}

/// Steps of the law from one evaluation of the network to the next.
const STEPS_AN_EVALUATION: usize = 4;

/// Runs a network and the law it supplies over the samples; 0 where the law is refused.
fn run_network<T: Bits>() -> u32 {
    let network = reference_network::network::<T>();
    let Some(law) = reference_network::law::<T>(PERIOD_S) else {
        return 0;
    };
    let mut state = NetworkState::default();
    let mut held = T::zero();
    let mut digest = CRC.digest();
    let mut samples = Samples::new();
    for step in 0..STEPS {
        let inputs = samples.inputs::<T>();
        let velocity = inputs.velocity_rad_s.value;
        if step % STEPS_AN_EVALUATION == 0 {
            network.evaluate(&mut state, &[inputs.auxiliary.value, velocity, held]);
            for factor in state.factors.to_array() {
                digest.update(&factor.bits().to_le_bytes());
            }
            digest.update(&state.outside_count.to_le_bytes());
        }
        let torque = law.step(&mut held, velocity, &state.factors);
        digest.update(&torque.bits().to_le_bytes());
    }
    digest.finalize()
}

/// A source of samples: a generator and the slow signals it moves.
struct Samples {
    generator: u32,
    step: u32,
    velocity: f32,
}

impl Samples {
    fn new() -> Self {
        Self { generator: 0x2545_F491, step: 0, velocity: 0.0 }
    }

    /// Xorshift (Marsaglia 2003), as a number in -1..1 with 16 bits: exact in every type.
    fn noise(&mut self) -> f32 {
        self.generator ^= self.generator << 13;
        self.generator ^= self.generator >> 17;
        self.generator ^= self.generator << 5;
        f32::from((self.generator >> 16) as u16 as i16) / 32768.0
    }

    fn inputs<T: Real>(&mut self) -> Inputs<T> {
        // Every 512 samples another speed: rest, creeping, about v_s, fast; and now and then what
        // no joint does.
        const SPEEDS: [f32; 8] = [0.0, 1e-4, -0.02, 0.1, -0.3, 1.5, -8.0, 20.0];
        let speed = SPEEDS[(self.step / 512) as usize % SPEEDS.len()];
        self.velocity += (speed - self.velocity) * 0.03125 + self.noise() * 0.0009765625 * speed;
        let measured = match self.step % 997 {
            500 => f32::NAN,
            501 => f32::INFINITY,
            502 => -0.0,
            _ => self.velocity,
        };
        let slow = (self.step % 4096) as f32 / 4096.0;
        let fresh = |value: f32| Reading::fresh(T::from_f64(f64::from(value)));
        let heard = self.step % 1000 < 900;
        let or_missing = |reading| if heard { reading } else { Reading::missing() };
        self.step += 1;
        Inputs {
            velocity_rad_s: fresh(measured),
            velocity_reference_rad_s: or_missing(fresh(speed.clamp(-10.0, 10.0))),
            position_rad: fresh(slow * 12.0),
            acceleration_rad_s2: fresh(self.noise() * 10.0),
            radial_force_n: or_missing(fresh(40.0 + 30.0 * slow + self.noise())),
            pressure_diff_mpa: or_missing(fresh(0.3 * slow)),
            temperature_c: fresh(5.0 + 20.0 * slow),
            load_torque_nm: fresh(self.noise() * 5.0),
            auxiliary: fresh(slow),
            campaign_time_h: T::from_f64(f64::from(self.step as f32) / 4096.0),
        }
    }
}

#[cfg(test)]
mod tests {

    use super::*;

    #[test]
    fn every_run_is_accepted_and_unlike_the_others() {
        let prints: Vec<u32> = all().map(|(_, print)| print).collect();
        for (index, print) in prints.iter().enumerate() {
            assert_ne!(*print, 0);
            assert!(!prints[..index].contains(print));
        }
    }
}

//! Runs whose output bits must agree between a PC and a Cortex-M4F.
//!
//! Replay on a PC is an equality check, not a tolerance. It needs the same bits from the same step on every
//! processor. Each run here passes 10,000 samples to a model and takes the CRC-32 of every output word. PC and
//! QEMU must print the same eight digits. The samples come from an integer generator and exactly rounded
//! operations, so that only the step can cause a difference. They cover rest, presliding, sliding in both
//! directions, the Stribeck range, values outside the envelope, and NaN. One different bit in any step changes
//! the fingerprint.

use compensator_core::compensator::Reading;
use compensator_core::model::{ModelState, Sample};
use compensator_core::network::{NetworkState, reference as reference_network};
use compensator_core::{Compensator, Fixed, Inputs, LawKind, Real, TermKind};
use firmware::control::PERIOD_S;
use firmware::reference_joint::configuration;

/// Samples per run.
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
const LOOKUP_TABLE: &[TermKind] = &[TermKind::LookupTable];

/// Returns the runs: name and fingerprint, in the order of printing.
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
        ("improved-lugre + unknown f32", || run::<f32>(LawKind::ImprovedLugre, LOOKUP_TABLE)),
        #[cfg(feature = "terms")]
        ("improved-lugre + unknown Fixed", || run::<Fixed>(LawKind::ImprovedLugre, LOOKUP_TABLE)),
        ("lugre-lstm f32", run_network::<f32>),
        ("lugre-lstm Fixed", run_network::<Fixed>),
    ];
    runs.into_iter().map(|(name, run)| (name, run()))
}

/// A number type with access to its bits.
pub trait Bits: Real<Setting = f32> {
    /// Returns all bits.
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

/// Runs a compensator and its sum over the samples; returns 0 if the configuration is refused.
fn run<T: Bits>(law: LawKind, terms: &[TermKind]) -> u32 {
    let configuration = configuration(law, terms);
    let Ok(mut compensator) = Compensator::<T>::build(&configuration, PERIOD_S) else {
        return 0;
    };
    compensator.set_enabled(true);
    // Run the bare model as well, on the velocities that the compensator's guards replace.
    let Ok(model) = configuration.model.build::<T>(PERIOD_S) else {
        return 0;
    };
    let mut state = ModelState::default();
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

/// Steps of the law per evaluation of the network.
const STEPS_PER_EVALUATION: usize = 4;

/// Runs a network and the law it supplies over the samples; returns 0 if the law is refused.
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
        if step % STEPS_PER_EVALUATION == 0 {
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

/// Source of samples: a random generator and the slow signals derived from it.
struct Samples {
    generator: u32,
    step: u32,
    velocity: f32,
}

impl Samples {
    fn new() -> Self {
        Self { generator: 0x2545_F491, step: 0, velocity: 0.0 }
    }

    /// Returns a number in -1..1 with 16 bits, exact in every type (xorshift, Marsaglia 2003).
    fn noise(&mut self) -> f32 {
        self.generator ^= self.generator << 13;
        self.generator ^= self.generator >> 17;
        self.generator ^= self.generator << 5;
        f32::from((self.generator >> 16) as u16 as i16) / 32768.0
    }

    fn inputs<T: Real>(&mut self) -> Inputs<T> {
        // The speed changes every 512 samples: rest, creeping, about v_s, fast. Some samples are invalid.
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
        let is_received = self.step % 1000 < 900;
        let or_missing = |reading| if is_received { reading } else { Reading::missing() };
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
    fn all_runs_have_distinct_nonzero_fingerprints() {
        let prints: Vec<u32> = all().map(|(_, print)| print).collect();
        for (index, print) in prints.iter().enumerate() {
            assert_ne!(*print, 0);
            assert!(!prints[..index].contains(print));
        }
    }

    /// The table has the fingerprints of the emulated Cortex-M4F as well; `tests/cost/run` compares those with it.
    #[test]
    fn fingerprints_on_this_pc_match_table_of_target() {
        let table = include_str!("../../cost/core-cost.tsv");
        let (_, rows) = table.split_once("# Fingerprints").expect("a section");
        let mut count = 0;
        for (name, value) in all() {
            let row = format!("{name}\t{value:08x}\t{value:08x}");
            assert!(rows.lines().any(|line| line == row), "not in tests/cost/core-cost.tsv: {row}");
            count += 1;
        }
        assert_eq!(count, 10, "runs");
    }
}

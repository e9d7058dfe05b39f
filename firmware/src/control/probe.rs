//! Measurement of an unknown motor: applies a known voltage vector and reports the current that results.
//!
//! The current loop needs resistance, inductance and rotor angle, so it cannot be used to find them. During
//! commissioning ([`crate::driver::commissioning`]) the interrupt applies a *voltage* to the winding instead.
//! The voltage lies along a field that stands or turns as commanded, independent of the encoder. Means over
//! [`BLOCK_PERIODS`] are reported:
//!
//! ```text
//! along, across        the current seen from the field: R and the induced voltage are in it
//! square, response     superposed square wave of voltage, along or across, and the current at the ends of its halves: L
//! encoder, field       both angles at the end of the block: relation of rotor and field
//! ```
//! Half of the square wave takes five periods. A block holds two whole waves, so the wave cancels in the mean
//! current. This module takes no decisions except one: a current above `trip_a` opens the bridge in the same
//! period, for the rest of the run.

use super::Bridge;
use super::dead_time::charged_share;
use super::space_vector::{MAX_VECTOR_PER_BUS_V, duties, limit};
use super::transform::{Rotating, Rotation, Stationary, inverse_clarke};

/// Periods in a block: the length of a mean.
pub const BLOCK_PERIODS: u32 = 20;

/// Periods of half a square wave.
pub const HALF_WAVE_PERIODS: u32 = 5;

/// Maximum modulation. Every power stage leaves its shunts more time than this needs.
const MAX_MODULATION: f32 = 0.8;

/// Half waves in a block.
const HALF_WAVES_PER_BLOCK: u32 = BLOCK_PERIODS / HALF_WAVE_PERIODS;

/// Command to the bridge. Voltages are from a phase to the star point, angles electrical, 2^32 for a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeCommand {
    /// Counts runs: a new number resets field and trip.
    pub run: u8,
    /// Voltage along the field, V.
    pub along_v: f32,
    /// Amplitude of the square wave along and across the field, V.
    pub square_v: [f32; 2],
    /// Angle of the field per period; positive in the phase sequence a, b, c.
    pub turn_per_period: i32,
    /// Voltage that the dead time takes from a phase, V, against its current. It is added back: otherwise it
    /// would distort the current six times per turn of the field, and the angle between current and voltage with
    /// it.
    pub dead_v: f32,
    /// Phase current at which half of this voltage is lost, A; positive.
    pub dead_a: f32,
    /// Length of the current vector at which the bridge opens, A.
    pub trip_a: f32,
}

/// Result of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeReport {
    /// The run that it belongs to.
    pub run: u8,
    /// Counts blocks: the same number means the same block.
    pub number: u32,
    /// A current exceeded `trip_a`: the bridge is open.
    pub tripped: bool,
    /// Voltage along the field, V, after the limit to the circle.
    pub along_v: f32,
    /// Mean current along the field, A.
    pub along_a: f32,
    /// Mean current a quarter turn ahead of the field, A.
    pub across_a: f32,
    /// Half the peak-to-peak current response to the square wave, along and across, A.
    pub response_a: [f32; 2],
    /// Raw encoder angle at the last sample of the block.
    pub encoder: u32,
    /// Angle of the field at that time.
    pub field: u32,
    /// Offsets subtracted from the currents of phases a and b, A.
    pub offset_a: [f32; 2],
}

/// State of a measurement in the interrupt.
#[derive(Clone, Copy, Debug, Default)]
pub struct Probe {
    run: u8,
    field: u32,
    /// Periods since the start of the block.
    at: u32,
    tripped: bool,
    sum: Rotating,
    response: Rotating,
    report: ProbeReport,
}

impl Probe {
    /// Runs one period with the sampled encoder angle, the current vector and the bus voltage, V.
    // Not inlined: a board may leave it in slow memory, because a period of a measurement computes no compensation.
    #[cold]
    #[inline(never)]
    pub fn step(
        &mut self,
        command: &ProbeCommand,
        encoder: u32,
        measured: Stationary,
        bus_v: f32,
    ) -> Bridge {
        if command.run != self.run {
            *self = Self { run: command.run, ..Self::default() };
        }
        let square = measured.alpha * measured.alpha + measured.beta * measured.beta;
        // NaN counts as an exceeded limit.
        let bounded = square <= command.trip_a * command.trip_a && bus_v > 0.0;
        self.tripped |= !bounded;
        let current = Rotation::at(self.field).park(measured);
        self.add_sample(command, encoder, current);
        self.field = self.field.wrapping_add(command.turn_per_period as u32);
        if self.tripped {
            return Bridge::Off;
        }
        let sign = if self.at % (2 * HALF_WAVE_PERIODS) < HALF_WAVE_PERIODS { 1.0 } else { -1.0 };
        let [along_v, across_v] = command.square_v;
        let demand = Rotating { d: command.along_v + sign * along_v, q: sign * across_v };
        let (applied, _) = limit(demand, bus_v * MAX_VECTOR_PER_BUS_V * MAX_MODULATION);
        // The voltage acts from the next sample to the one after.
        let then = Rotation::at(self.field.wrapping_add((command.turn_per_period / 2) as u32));
        let flows = inverse_clarke(then.inverse_park(current));
        let per_a = 1.0 / command.dead_a;
        let taken_v = |phase_a: f32| {
            let lost_v = command.dead_v * charged_share(phase_a.abs() * per_a);
            if phase_a < 0.0 { -lost_v } else { lost_v }
        };
        let [a, b, c] = inverse_clarke(then.inverse_park(applied));
        let [x, y, z] = flows.map(taken_v);
        Bridge::Drive(duties([a + x, b + y, c + z], bus_v))
    }

    /// Returns the result of the last complete block.
    pub const fn report(&self) -> ProbeReport {
        self.report
    }

    fn add_sample(&mut self, command: &ProbeCommand, encoder: u32, current: Rotating) {
        self.sum.d += current.d;
        self.sum.q += current.q;
        // The voltage of the period that has just ended.
        let seen = (self.at + BLOCK_PERIODS - 1) % BLOCK_PERIODS;
        if seen % HALF_WAVE_PERIODS == HALF_WAVE_PERIODS - 1 {
            let sign = if seen % (2 * HALF_WAVE_PERIODS) < HALF_WAVE_PERIODS { 1.0 } else { -1.0 };
            self.response.d += sign * current.d;
            self.response.q += sign * current.q;
        }
        self.at += 1;
        if self.at < BLOCK_PERIODS && !self.tripped {
            return;
        }
        let (mean, ends) = (1.0 / BLOCK_PERIODS as f32, 1.0 / HALF_WAVES_PER_BLOCK as f32);
        self.report = ProbeReport {
            run: self.run,
            number: self.report.number.wrapping_add(1),
            tripped: self.tripped,
            along_v: command.along_v,
            along_a: self.sum.d * mean,
            across_a: self.sum.q * mean,
            response_a: [self.response.d * ends, self.response.q * ends],
            encoder,
            field: self.field,
            offset_a: [0.0; 2],
        };
        self.at = 0;
        (self.sum, self.response) = (Rotating::default(), Rotating::default());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::PERIOD_S;
    use crate::control::transform::{UNITS_PER_RAD, clarke};

    const BUS_V: f32 = 48.0;

    fn command() -> ProbeCommand {
        ProbeCommand {
            run: 1,
            along_v: 1.0,
            square_v: [0.0; 2],
            turn_per_period: 0,
            dead_v: 0.0,
            dead_a: 1.0,
            trip_a: 12.0,
        }
    }

    /// Simulates a winding at rest under the duties of the previous period, exact over a period; returns the
    /// last block.
    fn blocks(command: &ProbeCommand, ohm: f32, henry: f32, count: u32) -> ProbeReport {
        let (mut probe, mut current) = (Probe::default(), Stationary::default());
        let kept = (-ohm * PERIOD_S / henry).exp();
        let mut acting = [0.5; 3];
        for _ in 0..count * BLOCK_PERIODS {
            let next = probe.step(command, 0, current, BUS_V);
            let voltage = clarke(acting.map(|duty| duty * BUS_V));
            let share = (1.0 - kept) / ohm;
            current.alpha = kept * current.alpha + share * voltage.alpha;
            current.beta = kept * current.beta + share * voltage.beta;
            acting = match next {
                Bridge::Drive(duty) => duty,
                Bridge::Off | Bridge::Shorted => panic!("it tripped"),
            };
        }
        probe.report()
    }

    #[test]
    fn probe_of_a_winding_reports_resistance_and_inductance_on_both_axes() {
        let (ohm, henry) = (0.2, 120e-6);
        let block = blocks(&command(), ohm, henry, 20);
        assert!((block.along_a - 5.0).abs() < 0.02, "{block:?}");
        assert!(block.across_a.abs() < 0.02 && block.number == 20 && !block.tripped, "{block:?}");
        for axis in 0..2 {
            let mut command = command();
            command.square_v[axis] = 0.8;
            let block = blocks(&command, ohm, henry, 20);
            let x = 0.8 / ohm * (ohm * HALF_WAVE_PERIODS as f32 * PERIOD_S / (2.0 * henry)).tanh();
            let seen = block.response_a[axis];
            assert!((seen / x - 1.0).abs() < 5e-3, "{axis}: {seen} for {x}");
            assert!(block.response_a[1 - axis].abs() < 0.01 * x, "{block:?}");
            // The wave does not change the mean.
            assert!((block.along_a - 5.0).abs() < 0.02, "{block:?}");
        }
    }

    #[test]
    fn probe_with_turning_field_reports_the_impedance() {
        let (ohm, henry) = (0.2, 120e-6);
        let speed = 300.0;
        let command = ProbeCommand {
            turn_per_period: (speed * PERIOD_S * UNITS_PER_RAD) as i32,
            ..command()
        };
        let block = blocks(&command, ohm, henry, 50);
        // v = (R + j w L) i, in the frame of the field.
        let square = ohm * ohm + (speed * henry) * (speed * henry);
        assert!((block.along_a - ohm / square).abs() < 0.02, "{block:?}");
        assert!((block.across_a + speed * henry / square).abs() < 0.02, "{block:?}");
    }

    #[test]
    fn probe_with_excess_current_opens_the_bridge_until_the_next_run() {
        let mut probe = Probe::default();
        let much = Stationary { alpha: 9.0, beta: -9.0 };
        for none in [much, Stationary { alpha: f32::NAN, beta: 0.0 }] {
            let mut probe = Probe::default();
            assert!(matches!(
                probe.step(&command(), 0, Stationary::default(), BUS_V),
                Bridge::Drive(_)
            ));
            assert_eq!(probe.step(&command(), 0, none, BUS_V), Bridge::Off);
            assert_eq!(probe.step(&command(), 0, Stationary::default(), BUS_V), Bridge::Off);
            assert!(probe.report().tripped);
        }
        assert_eq!(probe.step(&command(), 0, much, BUS_V), Bridge::Off);
        let again = ProbeCommand { run: 2, ..command() };
        assert!(matches!(probe.step(&again, 0, Stationary::default(), BUS_V), Bridge::Drive(_)));
        assert_eq!(probe.step(&again, 0, Stationary::default(), 0.0), Bridge::Off, "no bus");
    }
}

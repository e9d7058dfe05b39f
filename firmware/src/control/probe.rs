//! A motor that nobody knows yet: a voltage vector of known length and angle, and what current comes of it.
//!
//! The current loop needs resistance, inductance and the rotor's angle; to find them it must not be asked. So while the driver
//! commissions itself ([`crate::driver::commissioning`]) the interrupt puts a *voltage* on the winding, along a field
//! that stands or turns as ordered, whatever the encoder says, and gives means over a [`BLOCK`] of periods:
//!
//! ```text
//! along, across        the current seen from the field: R and the induced voltage are in it
//! square, response     a square wave of voltage on top, along or across, and the current at the ends of its halves: L
//! encoder, field       both angles at the end of the block: how the rotor goes with the field
//! ```
//! Half of the square wave is five periods: two whole waves in a block, so the direct current falls out. Nothing here decides
//! what to do; but a current beyond `trip_a` opens the bridge in the period it is seen in, for as long as this run lasts.

use super::Bridge;
use super::space_vector::{CIRCLE, clamp, duties, limit};
use super::transform::{Rotating, Rotation, Stationary, clarke, inverse_clarke};

/// Periods a mean is taken over.
pub const BLOCK: u32 = 20;

/// Periods of half a square wave.
pub const HALF_WAVE: u32 = 5;

/// Share of the longest voltage vector in use: every stage leaves its shunts more time than this needs.
const MODULATION: f32 = 0.8;

/// A phase current whose sign is clear, A: three times its noise.
const SIGN_CLEAR_A: f32 = 0.15;

/// Ends of half waves in a block.
const ENDS: u32 = BLOCK / HALF_WAVE;

/// What the bridge is to do. Voltages are of a phase to the star point, angles electrical, 2^32 for a turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeOrder {
    /// Counts runs: another number forgets field and trip.
    pub run: u8,
    /// Voltage along the field, V.
    pub along_v: f32,
    /// Height of the square wave along and across the field, V.
    pub square_v: [f32; 2],
    /// How far the field turns in a period; phases a, b, c follow each other where it is positive.
    pub turn: i32,
    /// What the dead time takes of a phase's voltage, V, against its current: given back, or it would bend the current six
    /// times a turn of the field, and with it the angle between current and voltage.
    pub dead_v: f32,
    /// Length of the current vector that opens the bridge, A.
    pub trip_a: f32,
}

/// What came of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeReport {
    /// The run it is of.
    pub run: u8,
    /// Counts blocks: the same again is the same block.
    pub number: u32,
    /// A current was beyond `trip_a`: the bridge is open.
    pub tripped: bool,
    /// Voltage along the field, V, after the circle.
    pub along_v: f32,
    /// Mean current along the field, A.
    pub along_a: f32,
    /// Mean current a quarter turn ahead of it, A.
    pub across_a: f32,
    /// Half of what the square wave makes of the current from end to end, along and across, A.
    pub response_a: [f32; 2],
    /// The encoder's angle at the block's last sample, as it is read.
    pub encoder: u32,
    /// The field's angle there.
    pub field: u32,
    /// Offsets taken off the currents of phases a and b, A.
    pub offset_a: [f32; 2],
}

/// The interrupt's end of a commissioning.
#[derive(Clone, Copy, Debug, Default)]
pub struct Probe {
    run: u8,
    field: u32,
    /// Periods into the block.
    at: u32,
    tripped: bool,
    sum: Rotating,
    response: Rotating,
    report: ProbeReport,
}

impl Probe {
    /// One period: the encoder's angle and the currents that were sampled, and the bus voltage to go by, V.
    pub fn step(
        &mut self,
        order: &ProbeOrder,
        encoder: u32,
        measured: Stationary,
        bus_v: f32,
    ) -> Bridge {
        if order.run != self.run {
            *self = Self { run: order.run, ..Self::default() };
        }
        let square = measured.alpha * measured.alpha + measured.beta * measured.beta;
        // Not a number is no current to go on with.
        let bounded = square <= order.trip_a * order.trip_a && bus_v > 0.0;
        self.tripped |= !bounded;
        let current = Rotation::at(self.field).park(measured);
        self.take(order, encoder, current);
        self.field = self.field.wrapping_add(order.turn as u32);
        if self.tripped {
            return Bridge::Off;
        }
        let sign = if self.at % (2 * HALF_WAVE) < HALF_WAVE { 1.0 } else { -1.0 };
        let [along_v, across_v] = order.square_v;
        let wanted = Rotating { d: order.along_v + sign * along_v, q: sign * across_v };
        let (given, _) = limit(wanted, bus_v * CIRCLE * MODULATION);
        // It acts from the next sample on until the one after.
        let then = Rotation::at(self.field.wrapping_add((order.turn / 2) as u32));
        let given = then.inverse_park(given);
        let flows = inverse_clarke(then.inverse_park(current));
        let taken =
            clarke(flows.map(|phase_a| order.dead_v * clamp(phase_a * (1.0 / SIGN_CLEAR_A), 1.0)));
        let (alpha, beta) = (given.alpha + taken.alpha, given.beta + taken.beta);
        Bridge::Drive(duties(Stationary { alpha, beta }, bus_v))
    }

    /// What the last whole block showed.
    pub const fn report(&self) -> ProbeReport {
        self.report
    }

    fn take(&mut self, order: &ProbeOrder, encoder: u32, current: Rotating) {
        self.sum.d += current.d;
        self.sum.q += current.q;
        // The voltage of the period that has just ended.
        let seen = (self.at + BLOCK - 1) % BLOCK;
        if seen % HALF_WAVE == HALF_WAVE - 1 {
            let sign = if seen % (2 * HALF_WAVE) < HALF_WAVE { 1.0 } else { -1.0 };
            self.response.d += sign * current.d;
            self.response.q += sign * current.q;
        }
        self.at += 1;
        if self.at < BLOCK && !self.tripped {
            return;
        }
        let (mean, ends) = (1.0 / BLOCK as f32, 1.0 / ENDS as f32);
        self.report = ProbeReport {
            run: self.run,
            number: self.report.number.wrapping_add(1),
            tripped: self.tripped,
            along_v: order.along_v,
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
    use crate::control::transform::UNITS_PER_RAD;

    const BUS_V: f32 = 48.0;

    fn order() -> ProbeOrder {
        ProbeOrder { run: 1, along_v: 1.0, square_v: [0.0; 2], turn: 0, dead_v: 0.0, trip_a: 12.0 }
    }

    /// A winding at rest under the duties of the period before, exact over a period; gives the last block.
    fn blocks(order: &ProbeOrder, ohm: f32, henry: f32, count: u32) -> ProbeReport {
        let (mut probe, mut current) = (Probe::default(), Stationary::default());
        let kept = (-ohm * PERIOD_S / henry).exp();
        let mut acting = [0.5; 3];
        for _ in 0..count * BLOCK {
            let next = probe.step(order, 0, current, BUS_V);
            let voltage = clarke(acting.map(|duty| duty * BUS_V));
            let share = (1.0 - kept) / ohm;
            current.alpha = kept * current.alpha + share * voltage.alpha;
            current.beta = kept * current.beta + share * voltage.beta;
            acting = match next {
                Bridge::Drive(duty) => duty,
                Bridge::Off => panic!("it tripped"),
            };
        }
        probe.report()
    }

    #[test]
    fn a_winding_shows_its_resistance_and_both_ways_of_the_square_wave_its_inductance() {
        let (ohm, henry) = (0.2, 120e-6);
        let block = blocks(&order(), ohm, henry, 20);
        assert!((block.along_a - 5.0).abs() < 0.02, "{block:?}");
        assert!(block.across_a.abs() < 0.02 && block.number == 20 && !block.tripped, "{block:?}");
        for axis in 0..2 {
            let mut order = order();
            order.square_v[axis] = 0.8;
            let block = blocks(&order, ohm, henry, 20);
            let x = 0.8 / ohm * (ohm * HALF_WAVE as f32 * PERIOD_S / (2.0 * henry)).tanh();
            let seen = block.response_a[axis];
            assert!((seen / x - 1.0).abs() < 5e-3, "{axis}: {seen} for {x}");
            assert!(block.response_a[1 - axis].abs() < 0.01 * x, "{block:?}");
            // The wave leaves the mean alone.
            assert!((block.along_a - 5.0).abs() < 0.02, "{block:?}");
        }
    }

    #[test]
    fn a_field_that_turns_is_where_it_is_said_to_be() {
        let (ohm, henry) = (0.2, 120e-6);
        let speed = 300.0;
        let order = ProbeOrder { turn: (speed * PERIOD_S * UNITS_PER_RAD) as i32, ..order() };
        let block = blocks(&order, ohm, henry, 50);
        // v = (R + j w L) i, seen from the field.
        let square = ohm * ohm + (speed * henry) * (speed * henry);
        assert!((block.along_a - ohm / square).abs() < 0.02, "{block:?}");
        assert!((block.across_a + speed * henry / square).abs() < 0.02, "{block:?}");
    }

    #[test]
    fn too_much_current_opens_the_bridge_until_another_run() {
        let mut probe = Probe::default();
        let much = Stationary { alpha: 9.0, beta: -9.0 };
        for none in [much, Stationary { alpha: f32::NAN, beta: 0.0 }] {
            let mut probe = Probe::default();
            assert!(matches!(
                probe.step(&order(), 0, Stationary::default(), BUS_V),
                Bridge::Drive(_)
            ));
            assert_eq!(probe.step(&order(), 0, none, BUS_V), Bridge::Off);
            assert_eq!(probe.step(&order(), 0, Stationary::default(), BUS_V), Bridge::Off);
            assert!(probe.report().tripped);
        }
        assert_eq!(probe.step(&order(), 0, much, BUS_V), Bridge::Off);
        let again = ProbeOrder { run: 2, ..order() };
        assert!(matches!(probe.step(&again, 0, Stationary::default(), BUS_V), Bridge::Drive(_)));
        assert_eq!(probe.step(&again, 0, Stationary::default(), 0.0), Bridge::Off, "no bus");
    }
}

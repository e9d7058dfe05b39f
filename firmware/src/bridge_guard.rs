//! The sequence before a bridge may close, and the second way to open it.
//!
//! *Second way to open.* After a trip opens the switches by the timer, the gate driver is put to sleep as well,
//! so that no single register can keep a bridge on. Sleep also clears a fault that the gate driver latches, so a
//! fault can be cleared over the bus. (Drivers of the DRV83xx kind latch it until their enable input was low for
//! a millisecond.)
//!
//! *Offset trim.* Amplifiers drift with temperature: a drift of 0.26 A is an error of 0.21 A in the torque
//! current. Each time the bridge is commanded on, the shunt readings with all switches open are taken as the new
//! zero.
//!
//! ```text
//! trip or request -> Asleep (1.2 ms, and while the trip lasts) -> Waking (5 ms) -> Ready
//! Ready, commanded on -> Trimming (12.8 ms) -> Closed;   commanded off -> Ready
//! ```

use crate::control::{StageSample, ValidChannels};

/// Periods of sleep that clear a latched fault of the gate driver, 1.2 ms. The data sheet requires at most 1 ms.
pub const SLEEP_PERIODS: u32 = 24;
/// Periods that the amplifiers need to wake up, 5 ms.
pub const WAKE_PERIODS: u32 = 100;
/// Periods of the offset mean, 12.8 ms. It is shorter than the 20 ms after which a missing current is a lost
/// phase.
pub const TRIM_PERIODS: u32 = 256;
/// Maximum offset, A. Amplifiers of this class drift by 0.3 A over their temperature range. A larger offset
/// means a defective amplifier, or a motor that is turned so fast that its induced voltage exceeds the bus
/// voltage.
pub const MAX_OFFSET_DRIFT_A: f32 = 1.0;
/// Maximum spread of the samples of an offset, A: noise is 0.1 A; a real current spreads more.
pub const MAX_OFFSET_SPREAD_A: f32 = 2.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Asleep,
    Waking,
    Ready,
    Trimming,
    /// The offset could not be determined; the bridge stays open until it is commanded off.
    Untrimmed,
    Closed,
}

/// What is permitted in a period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BridgePermission {
    /// The gate driver must be awake.
    pub awake: bool,
    /// The gate driver has been awake long enough for its fault signal to be valid.
    pub settled: bool,
    /// The bridge may close.
    pub may_close: bool,
}

with_defaults! {
    /// State of the guard.
    #[derive(Clone, Copy, Debug)]
    pub struct BridgeGuard {
        state: State = State::Ready,
        /// Periods since the state was entered.
        periods: u32,
        /// Number of the last reset request.
        resets: u8,
        offset_a: [f32; 3],
        sum_a: [f32; 3],
        min_a: [f32; 3],
        max_a: [f32; 3],
    }
}

impl BridgeGuard {
    /// Runs one period and subtracts the offsets from the sample. `is_commanded`: the bridge is commanded on.
    /// `stopped`: a trip holds it off. `resets` counts requests to put the gate driver to sleep.
    #[inline]
    pub fn step(
        &mut self,
        sample: &mut StageSample,
        is_commanded: bool,
        stopped: bool,
        resets: u8,
    ) -> BridgePermission {
        self.periods = self.periods.saturating_add(1);
        if stopped || resets != self.resets {
            self.resets = resets;
            self.enter(State::Asleep);
        }
        // The period that ends the trim is long. The first one that drives is the next.
        let was_closed = self.state == State::Closed;
        match self.state {
            State::Asleep if self.periods >= SLEEP_PERIODS => self.enter(State::Waking),
            State::Waking if self.periods >= WAKE_PERIODS => self.enter(State::Ready),
            State::Ready if is_commanded => {
                self.enter(State::Trimming);
                self.sum_a = [0.0; 3];
                (self.min_a, self.max_a) = (sample.currents_a, sample.currents_a);
            }
            State::Trimming | State::Untrimmed | State::Closed if !is_commanded => {
                self.enter(State::Ready);
            }
            State::Trimming => self.trim(sample),
            _ => {}
        }
        let settled = !matches!(self.state, State::Asleep | State::Waking);
        if !settled {
            // All switches are open, and amplifiers that sleep give invalid readings.
            sample.currents_a = [0.0; 3];
            sample.valid |= ValidChannels::CURRENT_A | ValidChannels::CURRENT_B;
        } else {
            // Written out, because a loop over three values costs the interrupt 60 cycles more.
            let ([a, b, c], [of_a, of_b, of_c]) = (sample.currents_a, self.offset_a);
            sample.currents_a = [a - of_a, b - of_b, c - of_c];
        }
        if self.state == State::Untrimmed {
            sample.valid -= ValidChannels::CURRENT_A | ValidChannels::CURRENT_B;
        }
        BridgePermission {
            awake: self.state != State::Asleep,
            settled,
            may_close: was_closed && self.state == State::Closed,
        }
    }

    /// Returns the offsets that are subtracted from the currents, A.
    pub const fn offset_a(&self) -> [f32; 3] {
        self.offset_a
    }

    fn enter(&mut self, state: State) {
        self.state = state;
        self.periods = 0;
    }

    fn trim(&mut self, sample: &StageSample) {
        let places = self.sum_a.iter_mut().zip(&mut self.min_a).zip(&mut self.max_a);
        for (((sum, min), max), current_a) in places.zip(sample.currents_a) {
            *sum += current_a;
            *min = min.min(current_a);
            *max = max.max(current_a);
        }
        if self.periods < TRIM_PERIODS {
            return;
        }
        let offset_a = self.sum_a.map(|sum| sum * (1.0 / TRIM_PERIODS as f32));
        let is_in_range = |offset: f32| offset.abs() <= MAX_OFFSET_DRIFT_A;
        let is_steady = |(min, max): (f32, f32)| max - min <= MAX_OFFSET_SPREAD_A;
        let is_valid = offset_a.into_iter().all(is_in_range)
            && self.min_a.into_iter().zip(self.max_a).all(is_steady)
            && sample.valid.contains(ValidChannels::CURRENT_A | ValidChannels::CURRENT_B);
        if is_valid {
            self.offset_a = offset_a;
        }
        self.enter(if is_valid { State::Closed } else { State::Untrimmed });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALID: ValidChannels = ValidChannels::CURRENT_A.union(ValidChannels::CURRENT_B);

    fn sample(currents_a: [f32; 3]) -> StageSample {
        StageSample { currents_a, bus_v: 48.0, encoder: 0, valid: VALID }
    }

    struct Bench {
        guard: BridgeGuard,
        currents_a: [f32; 3],
        seen: StageSample,
    }

    impl Bench {
        fn new(currents_a: [f32; 3]) -> Self {
            Self { guard: BridgeGuard::default(), currents_a, seen: sample([0.0; 3]) }
        }

        fn step(&mut self, is_commanded: bool, stopped: bool, resets: u8) -> BridgePermission {
            self.seen = sample(self.currents_a);
            self.guard.step(&mut self.seen, is_commanded, stopped, resets)
        }

        /// Returns the number of periods before the bridge may close; `None` if it does not close within half a
        /// second.
        fn periods_to_close(&mut self) -> Option<u32> {
            (0..10_000).find(|_| self.step(true, false, 0).may_close)
        }
    }

    #[test]
    fn guard_with_offset_drift_subtracts_it_before_the_bridge_closes() {
        let mut bench = Bench::new([0.3, -0.26, 0.0]);
        assert_eq!(bench.periods_to_close(), Some(TRIM_PERIODS + 1));
        bench.step(true, false, 0);
        for current_a in bench.seen.currents_a {
            assert!(current_a.abs() < 1e-4, "{current_a}");
        }
        // A current on top of the offset is kept.
        bench.currents_a = [10.3, -5.26, -5.0];
        bench.step(true, false, 0);
        assert!((bench.seen.currents_a[0] - 10.0).abs() < 1e-3);
        // At the next closing the offset may differ.
        bench.step(false, false, 0);
        bench.currents_a = [-0.2, 0.1, 0.0];
        assert_eq!(bench.periods_to_close(), Some(TRIM_PERIODS + 1));
        bench.step(true, false, 0);
        assert!(bench.seen.currents_a[0].abs() < 1e-4);
    }

    #[test]
    fn guard_with_excess_offset_or_spread_keeps_the_bridge_open() {
        for (a, b) in [(1.1, 0.0), (0.0, -1.1), (f32::NAN, 0.0)] {
            let mut bench = Bench::new([a, b, 0.0]);
            assert_eq!(bench.periods_to_close(), None, "{a} {b}");
            assert!(!bench.seen.valid.intersects(VALID), "reported as invalid currents");
            assert_eq!(bench.guard.offset_a(), [0.0; 3]);
        }
        assert_eq!(Bench::new([0.99, -0.99, 0.0]).periods_to_close(), Some(TRIM_PERIODS + 1));
        // A motor turned by hand has an alternating current with mean 0.
        let mut bench = Bench::new([0.0; 3]);
        let closed = (0..1000).any(|at| {
            bench.currents_a[0] = if at % 20 < 10 { 1.2 } else { -1.2 };
            bench.step(true, false, 0).may_close
        });
        assert!(!closed);
        // After the command off and on, the trim is repeated.
        bench.step(false, false, 0);
        bench.currents_a = [0.0; 3];
        assert!(bench.periods_to_close().is_some());
    }

    #[test]
    fn guard_after_trip_puts_the_gate_driver_to_sleep_long_enough_to_clear_its_fault() {
        let mut bench = Bench::new([0.0; 3]);
        bench.periods_to_close();
        assert_eq!(
            bench.step(true, true, 0),
            BridgePermission { awake: false, settled: false, may_close: false }
        );
        for _ in 0..1000 {
            assert!(!bench.step(true, true, 0).awake, "it lasts as long as the trip");
        }
        // 1.2 ms more, then 5 ms in which the amplifiers give invalid readings.
        let asleep = (0..1000).take_while(|_| !bench.step(false, false, 0).awake).count() as u32;
        assert!((SLEEP_PERIODS - 1..=SLEEP_PERIODS).contains(&asleep), "{asleep}");
        bench.currents_a = [40.0, f32::NAN, 0.0];
        let waking = (0..1000).take_while(|_| !bench.step(false, false, 0).settled).count() as u32;
        assert!((WAKE_PERIODS - 2..=WAKE_PERIODS).contains(&waking), "{waking}");
        assert!(bench.seen.currents_a[0] == 40.0);
    }

    #[test]
    fn guard_with_reset_request_sleeps_once_per_request() {
        let mut bench = Bench::new([0.0; 3]);
        assert!(bench.step(false, false, 0).awake);
        let slept = |bench: &mut Bench, resets| {
            (0..500).filter(|_| !bench.step(false, false, resets).awake).count() as u32
        };
        assert_eq!(slept(&mut bench, 1), SLEEP_PERIODS);
        assert_eq!(slept(&mut bench, 1), 0);
        assert_eq!(slept(&mut bench, 2), SLEEP_PERIODS);
    }
}

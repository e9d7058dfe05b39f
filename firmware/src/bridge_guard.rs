//! What has to happen before a bridge may close, and what opens it a second time.
//!
//! *Second way off.* A trip opens the switches by the timer; then the gate driver is put to sleep as well, so that no
//! single register keeps a bridge on. Its sleep is also what clears a fault that it holds (drivers of the DRV83xx kind
//! keep theirs until their enable input was low for a millisecond), so a fault can be cleared over the bus.
//! *Offsets anew.* Amplifiers drift with temperature: 0.26 A of drift is 0.21 A of torque current in the wrong place. So
//! every time the bridge is ordered on, what the shunts show with all switches open is taken as their zero first.
//!
//! ```text
//! trip, or asked -> Asleep (1.2 ms, and as long as it lasts) -> Waking (5 ms) -> Ready
//! Ready, ordered on -> Trimming (12.8 ms) -> Closed;   ordered off -> Ready
//! ```

use crate::control::{StageSample, Valid};

/// Periods of sleep that clear a fault the gate driver holds, 1.2 ms: its data sheet asks for 1 ms at most.
pub const SLEEP: u32 = 24;
/// Periods its amplifiers have to wake up, 5 ms.
pub const WAKE: u32 = 100;
/// Periods an offset is the mean of, 12.8 ms: below the 20 ms after which a missing current is a lost phase.
pub const TRIM: u32 = 256;
/// Farthest an offset may have gone since the start, A. Amplifiers of this class drift by 0.3 A over their range of
/// temperature; farther is a broken one, or a motor that is being turned faster than the bus can hold.
pub const DRIFT_MAX_A: f32 = 1.0;
/// Farthest two samples may lie apart while an offset is found, A: noise is 0.1 A, a current that flows is more.
pub const SPREAD_MAX_A: f32 = 2.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Asleep,
    Waking,
    Ready,
    Trimming,
    /// No offset could be found: nothing to drive by until it is ordered off.
    Untrimmed,
    Closed,
}

/// What is allowed in a period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Permission {
    /// The gate driver is to be awake.
    pub awake: bool,
    /// It is, for long enough that what it says of itself counts.
    pub settled: bool,
    /// The bridge may close.
    pub may_close: bool,
}

/// The guard's state.
#[derive(Clone, Copy, Debug)]
pub struct BridgeGuard {
    state: State,
    /// Periods in the state.
    periods: u32,
    /// Number of the last sleep that was asked for.
    resets: u8,
    offset_a: [f32; 3],
    sum_a: [f32; 3],
    least_a: [f32; 3],
    most_a: [f32; 3],
}

impl Default for BridgeGuard {
    fn default() -> Self {
        Self {
            state: State::Ready,
            periods: 0,
            resets: 0,
            offset_a: [0.0; 3],
            sum_a: [0.0; 3],
            least_a: [0.0; 3],
            most_a: [0.0; 3],
        }
    }
}

impl BridgeGuard {
    /// One period: takes the offsets off the sample. `ordered`: the bridge is ordered on; `stopped`: a trip holds it
    /// off; `resets` counts the times somebody asked for the gate driver's sleep.
    #[inline]
    pub fn step(
        &mut self,
        sample: &mut StageSample,
        ordered: bool,
        stopped: bool,
        resets: u8,
    ) -> Permission {
        self.periods = self.periods.saturating_add(1);
        if stopped || resets != self.resets {
            self.resets = resets;
            self.enter(State::Asleep);
        }
        match self.state {
            State::Asleep if self.periods >= SLEEP => self.enter(State::Waking),
            State::Waking if self.periods >= WAKE => self.enter(State::Ready),
            State::Ready if ordered => {
                self.enter(State::Trimming);
                self.sum_a = [0.0; 3];
                (self.least_a, self.most_a) = (sample.currents_a, sample.currents_a);
            }
            State::Trimming | State::Untrimmed | State::Closed if !ordered => {
                self.enter(State::Ready);
            }
            State::Trimming => self.trim(sample),
            _ => {}
        }
        let settled = !matches!(self.state, State::Asleep | State::Waking);
        if !settled {
            // All switches are open, and amplifiers that sleep show anything.
            sample.currents_a = [0.0; 3];
            sample.valid |= Valid::CURRENT_A | Valid::CURRENT_B;
        } else {
            for (current_a, offset_a) in sample.currents_a.iter_mut().zip(self.offset_a) {
                *current_a -= offset_a;
            }
        }
        if self.state == State::Untrimmed {
            sample.valid -= Valid::CURRENT_A | Valid::CURRENT_B;
        }
        Permission {
            awake: self.state != State::Asleep,
            settled,
            may_close: self.state == State::Closed,
        }
    }

    /// What is taken off the currents, A.
    pub const fn offset_a(&self) -> [f32; 3] {
        self.offset_a
    }

    fn enter(&mut self, state: State) {
        self.state = state;
        self.periods = 0;
    }

    fn trim(&mut self, sample: &StageSample) {
        let places = self.sum_a.iter_mut().zip(&mut self.least_a).zip(&mut self.most_a);
        for (((sum, least), most), current_a) in places.zip(sample.currents_a) {
            *sum += current_a;
            *least = least.min(current_a);
            *most = most.max(current_a);
        }
        if self.periods < TRIM {
            return;
        }
        let offset_a = self.sum_a.map(|sum| sum * (1.0 / TRIM as f32));
        let near = |offset: f32| offset.abs() <= DRIFT_MAX_A;
        let calm = |(least, most): (f32, f32)| most - least <= SPREAD_MAX_A;
        let sound = offset_a.into_iter().all(near)
            && self.least_a.into_iter().zip(self.most_a).all(calm)
            && sample.valid.contains(Valid::CURRENT_A | Valid::CURRENT_B);
        if sound {
            self.offset_a = offset_a;
        }
        self.enter(if sound { State::Closed } else { State::Untrimmed });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VALID: Valid = Valid::CURRENT_A.union(Valid::CURRENT_B);

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

        fn step(&mut self, ordered: bool, stopped: bool, resets: u8) -> Permission {
            self.seen = sample(self.currents_a);
            self.guard.step(&mut self.seen, ordered, stopped, resets)
        }

        /// Periods until the bridge may close; `None` where it does not within half a second.
        fn periods_to_close(&mut self) -> Option<u32> {
            (0..10_000).find(|_| self.step(true, false, 0).may_close)
        }
    }

    #[test]
    fn a_drift_of_a_third_of_an_ampere_is_taken_off_before_the_bridge_closes() {
        let mut bench = Bench::new([0.3, -0.26, 0.0]);
        assert_eq!(bench.periods_to_close(), Some(TRIM));
        bench.step(true, false, 0);
        for current_a in bench.seen.currents_a {
            assert!(current_a.abs() < 1e-4, "{current_a}");
        }
        // What flows on top of it is current, and stays.
        bench.currents_a = [10.3, -5.26, -5.0];
        bench.step(true, false, 0);
        assert!((bench.seen.currents_a[0] - 10.0).abs() < 1e-3);
        // And at the next time it may be another.
        bench.step(false, false, 0);
        bench.currents_a = [-0.2, 0.1, 0.0];
        assert_eq!(bench.periods_to_close(), Some(TRIM));
        bench.step(true, false, 0);
        assert!(bench.seen.currents_a[0].abs() < 1e-4);
    }

    #[test]
    fn a_broken_amplifier_or_a_current_that_flows_closes_nothing() {
        for (a, b) in [(1.1, 0.0), (0.0, -1.1), (f32::NAN, 0.0)] {
            let mut bench = Bench::new([a, b, 0.0]);
            assert_eq!(bench.periods_to_close(), None, "{a} {b}");
            assert!(!bench.seen.valid.intersects(VALID), "told as currents that are not valid");
            assert_eq!(bench.guard.offset_a(), [0.0; 3]);
        }
        assert_eq!(Bench::new([0.99, -0.99, 0.0]).periods_to_close(), Some(TRIM));
        // A motor that is turned by hand shows a current that comes and goes, 0 on average.
        let mut bench = Bench::new([0.0; 3]);
        let closed = (0..1000).any(|at| {
            bench.currents_a[0] = if at % 20 < 10 { 1.2 } else { -1.2 };
            bench.step(true, false, 0).may_close
        });
        assert!(!closed);
        // Ordered off and on again it is tried again.
        bench.step(false, false, 0);
        bench.currents_a = [0.0; 3];
        assert!(bench.periods_to_close().is_some());
    }

    #[test]
    fn a_trip_puts_the_gate_driver_to_sleep_for_as_long_as_it_clears_a_fault() {
        let mut bench = Bench::new([0.0; 3]);
        bench.periods_to_close();
        assert_eq!(
            bench.step(true, true, 0),
            Permission { awake: false, settled: false, may_close: false }
        );
        for _ in 0..1000 {
            assert!(!bench.step(true, true, 0).awake, "it lasts as long as the trip");
        }
        // 1.2 ms more, then 5 ms in which its amplifiers show anything.
        let asleep = (0..1000).take_while(|_| !bench.step(false, false, 0).awake).count() as u32;
        assert!((SLEEP - 1..=SLEEP).contains(&asleep), "{asleep}");
        bench.currents_a = [40.0, f32::NAN, 0.0];
        let waking = (0..1000).take_while(|_| !bench.step(false, false, 0).settled).count() as u32;
        assert!((WAKE - 2..=WAKE).contains(&waking), "{waking}");
        assert!(bench.seen.currents_a[0] == 40.0);
    }

    #[test]
    fn it_sleeps_when_asked_once_for_each_time() {
        let mut bench = Bench::new([0.0; 3]);
        assert!(bench.step(false, false, 0).awake);
        let slept = |bench: &mut Bench, resets| {
            (0..500).filter(|_| !bench.step(false, false, resets).awake).count() as u32
        };
        assert_eq!(slept(&mut bench, 1), SLEEP);
        assert_eq!(slept(&mut bench, 1), 0);
        assert_eq!(slept(&mut bench, 2), SLEEP);
    }
}

//! Overcurrent comparators at the low-side shunts of a power stage. They are hardware, independent of the processor.
//!
//! A shunt carries the phase current while the low side conducts, around the start and the end of a PWM period. Its
//! amplifier has one pole. Three signals are compared with an upper and a lower level each: two amplifiers, and the sum
//! of both, which represents the third phase. If one stays beyond a level for the filter time, the bridge opens after
//! a delay. The time step is a microsecond, so the comparators are simulated only near the level.

use super::parameters::Parameters;

/// Steps per period near the level: one per microsecond of a 50 us period.
pub const STEPS_PER_PERIOD: usize = 50;

/// Share of the level above which a period is simulated in microsecond steps.
///
/// A current cannot rise from there to the level within a period: 48 V on 88 uH give 0.36 A/us, 18 A per period.
pub const SIMULATION_THRESHOLD: f64 = 0.5;

/// Outputs of the amplifiers, and the time they have been beyond the level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparators {
    /// Lower and upper level of each signal, A.
    levels_a: [[f64; 2]; 3],
    lag_s: f64,
    filter_s: f64,
    delay_s: f64,
    dead_time_s: f64,
    /// Amplifier outputs of phases a and b, A.
    shown_a: [f64; 2],
    /// Time that each of the three signals has been beyond its level, s.
    beyond_s: [f64; 3],
    /// Time since the filter passed an overcurrent, s.
    passed_s: Option<f64>,
}

impl Comparators {
    /// Creates comparators with the highest level within their tolerance.
    pub fn of(p: &Parameters) -> Self {
        let level_a = p.break_level_a + p.break_error_a;
        Self {
            levels_a: [[-level_a, level_a]; 3],
            lag_s: p.shunt_lag_s,
            filter_s: p.break_filter_s,
            delay_s: p.break_delay_s,
            dead_time_s: p.dead_time_s,
            shown_a: [0.0; 2],
            beyond_s: [0.0; 3],
            passed_s: None,
        }
    }

    /// Sets the nominal lower and upper level of phase a, of phase b, and of their sum, A. An infinite one never acts.
    pub fn set_levels(&mut self, levels_a: [[f64; 2]; 3], p: &Parameters) {
        self.levels_a =
            levels_a.map(|[lower, upper]| [lower - p.break_error_a, upper + p.break_error_a]);
    }

    /// Returns true if these currents require a simulation in microsecond steps.
    pub fn is_near(&self, currents_a: [f64; 3]) -> bool {
        self.passed_s.is_some()
            || currents_a.iter().any(|a| a.abs() > SIMULATION_THRESHOLD * self.nearest_level_a())
    }

    /// Returns the smallest current at a level, A; 0 if a level is on the wrong side of zero.
    fn nearest_level_a(&self) -> f64 {
        let levels = self.levels_a.iter();
        levels.fold(f64::INFINITY, |least, [lower, upper]| least.min(-lower).min(*upper)).max(0.0)
    }

    /// Simulates a step of `dt` (s), `since_s` after the start of the period. Returns true if the bridge opens.
    pub fn step(
        &mut self,
        dt: f64,
        since_s: f64,
        period_s: f64,
        duty: [f64; 3],
        currents_a: [f64; 3],
    ) -> bool {
        let middle_s = since_s + 0.5 * dt;
        let from_turning_s = middle_s.min(period_s - middle_s);
        let follows = 1.0 - (-dt / self.lag_s).exp();
        for ((shown, duty), current) in self.shown_a.iter_mut().zip(duty).zip(currents_a) {
            let conducts = from_turning_s < 0.5 * ((1.0 - duty) * period_s - self.dead_time_s);
            *shown += follows * (if conducts { current } else { 0.0 } - *shown);
        }
        let [a, b] = self.shown_a;
        let signals = [a, b, a + b].into_iter().zip(self.levels_a);
        for (beyond, (shown, [lower, upper])) in self.beyond_s.iter_mut().zip(signals) {
            *beyond = if shown < lower || shown > upper { *beyond + dt } else { 0.0 };
        }
        let passes = self.beyond_s.iter().any(|beyond| *beyond >= self.filter_s);
        self.passed_s = self.passed_s.map(|ago| ago + dt).or(passes.then_some(0.0));
        self.passed_s.is_some_and(|ago| ago >= self.delay_s)
    }

    /// Resets the comparators after the bridge has opened.
    pub fn reset(&mut self) {
        (self.beyond_s, self.passed_s, self.shown_a) = ([0.0; 3], None, [0.0; 2]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 50e-6;

    /// Returns the time until these currents open the bridge with these duties, us. It simulates two periods.
    fn time_to_open(duty: [f64; 3], currents_a: [f64; 3]) -> Option<usize> {
        let mut comparators = Comparators::of(&Parameters::default());
        (0..100).find(|at| {
            let since_s = (at % 50) as f64 * 1e-6;
            comparators.step(1e-6, since_s, PERIOD_S, duty, currents_a)
        })
    }

    #[test]
    fn step_with_overcurrent_in_any_phase_opens_the_bridge() {
        for place in 0..3 {
            for sign in [1.0, -1.0] {
                let currents = |level: f64| {
                    let mut currents = [-0.5 * sign * level; 3];
                    currents[place] = sign * level;
                    currents
                };
                let after = time_to_open([0.5; 3], currents(50.0)).expect("it opens");
                assert!((1..=4).contains(&after), "{after} us");
                assert_eq!(time_to_open([0.5; 3], currents(43.0)), None);
            }
        }
    }

    #[test]
    fn levels_of_one_signal_act_in_their_direction() {
        let mut comparators = Comparators::of(&Parameters::default());
        let mut levels = [[f64::NEG_INFINITY, f64::INFINITY]; 3];
        levels[1] = [-10.0, f64::INFINITY];
        comparators.set_levels(levels, &Parameters::default());
        let opens = |currents_a: [f64; 3]| {
            let mut comparators = comparators;
            assert!(comparators.is_near(currents_a));
            (0..50).any(|at| {
                comparators.step(1e-6, f64::from(at) * 1e-6, PERIOD_S, [0.5; 3], currents_a)
            })
        };
        assert!(opens([15.0, -15.0, 0.0]), "12 A with the tolerance");
        assert!(!opens([-15.0, 15.0, 0.0]) && !opens([100.0, -11.0, -89.0]));
    }

    #[test]
    fn step_with_short_low_side_conduction_does_not_open_the_bridge() {
        // A duty of 92 %, the modulation limit, leaves 4 us minus the dead time. A duty of 99 % leaves 0.2 us.
        assert!(time_to_open([0.92, 0.1, 0.1], [60.0, -30.0, -30.0]).is_some());
        assert_eq!(time_to_open([0.99, 0.1, 0.1], [60.0, -30.0, -30.0]), None);
    }
}

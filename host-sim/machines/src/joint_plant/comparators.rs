//! Overcurrent comparators at a stage's low-side shunts: hardware, beside whatever processor there is.
//!
//! A shunt carries its phase's current while the low side conducts, around the turning point at which a period begins and ends;
//! its amplifier follows with one pole. Three voltages are compared with a level on either side: two amplifiers, and the mean
//! of both, which stands for the third phase. One that stays beyond its level for as long as the filter asks opens the bridge a
//! delay later. Steps of this are a microsecond: it is asked for only near the level.

use super::parameters::Parameters;

/// Steps of a period near the level; a microsecond of 50.
pub const STEPS: usize = 50;

/// Share of the level from which a period is looked at in steps. In a period a current cannot come from there to the level:
/// 48 V on 88 uH are 0.36 A/us, 18 A.
pub const NEAR: f64 = 0.5;

/// Amplifiers, and how long what they show has been beyond the level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparators {
    level_a: f64,
    lag_s: f64,
    filter_s: f64,
    delay_s: f64,
    dead_time_s: f64,
    /// What the amplifiers of phases a and b show, A.
    shown_a: [f64; 2],
    /// How long each of the three has been beyond its level, s.
    beyond_s: [f64; 3],
    /// How long ago the filter passed it on, s.
    passed_s: Option<f64>,
}

impl Comparators {
    /// Comparators whose level is as high as its errors allow.
    pub fn of(p: &Parameters) -> Self {
        Self {
            level_a: p.break_level_a + p.break_error_a,
            lag_s: p.shunt_lag_s,
            filter_s: p.break_filter_s,
            delay_s: p.break_delay_s,
            dead_time_s: p.dead_time_s,
            shown_a: [0.0; 2],
            beyond_s: [0.0; 3],
            passed_s: None,
        }
    }

    /// Whether these currents are worth to be looked at closely.
    pub fn is_near(&self, currents_a: [f64; 3]) -> bool {
        self.passed_s.is_some() || currents_a.iter().any(|a| a.abs() > NEAR * self.level_a)
    }

    /// A step of `dt` (s), so long after the period began; gives whether the bridge opens.
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
        for (beyond, shown) in self.beyond_s.iter_mut().zip([a, b, a + b]) {
            *beyond = if shown.abs() > self.level_a { *beyond + dt } else { 0.0 };
        }
        let passes = self.beyond_s.iter().any(|beyond| *beyond >= self.filter_s);
        self.passed_s = self.passed_s.map(|ago| ago + dt).or(passes.then_some(0.0));
        self.passed_s.is_some_and(|ago| ago >= self.delay_s)
    }

    /// The bridge is open: nothing is beyond any more.
    pub fn forget(&mut self) {
        (self.beyond_s, self.passed_s, self.shown_a) = ([0.0; 3], None, [0.0; 2]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 50e-6;

    /// After how many microseconds these currents open the bridge under these duties; at most two periods.
    fn opens(duty: [f64; 3], currents_a: [f64; 3]) -> Option<usize> {
        let mut comparators = Comparators::of(&Parameters::default());
        (0..100).find(|at| {
            let since_s = (at % 50) as f64 * 1e-6;
            comparators.step(1e-6, since_s, PERIOD_S, duty, currents_a)
        })
    }

    #[test]
    fn each_phase_and_either_direction_opens_it_and_none_below_the_level() {
        for place in 0..3 {
            for sign in [1.0, -1.0] {
                let currents = |level: f64| {
                    let mut currents = [-0.5 * sign * level; 3];
                    currents[place] = sign * level;
                    currents
                };
                let after = opens([0.5; 3], currents(50.0)).expect("it opens");
                assert!((1..=4).contains(&after), "{after} us");
                assert_eq!(opens([0.5; 3], currents(43.0)), None);
            }
        }
    }

    #[test]
    fn a_low_side_that_conducts_for_too_short_a_time_is_not_seen() {
        // 92 % of the duty leave 4 us less the dead time: as much as the modulation bound leaves. 99 % leave 0.2.
        assert!(opens([0.92, 0.1, 0.1], [60.0, -30.0, -30.0]).is_some());
        assert_eq!(opens([0.99, 0.1, 0.1], [60.0, -30.0, -30.0]), None);
    }
}

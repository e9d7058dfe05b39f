//! Banded rotary friction damper: three bands with two wraps each on an oscillating drum.
//!
//! A band brake is self-energising. Over a wrap angle `theta` the tension grows from the slack to the tight end by
//! `exp(mu theta)` (Euler, Eytelwein). Two wraps at `mu = 0.3` give a ratio of 43. After a reversal, tight and slack end
//! are exchanged. First the slack of the band is taken up, with only the drag of the lining. Then the band stretches
//! until it slips.
//!
//! ```text
//! drum travel -> backlash of width gap -> stretch, limited by slip -> tension difference of each band
//! slip limit   T0 (exp(mu(v) theta) - 1), T0 the slack-end tension (saturating function of the preset tension)
//! force        lever sum (difference)    actuator 1, 2   the tensions of the ends: a reaction to the friction
//! ```
//!
//! The time step is [`STEP_S`], and the log has noise. The model is not LuGre: the gap is a play operator, the stretch is
//! a stop operator, and the bands differ by their tolerances. The magnitudes follow the published tests: 4 to 12 kN,
//! half of the force change after 7 to 8 mm, and up to 20 % more force in one direction.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// Integration step, s.
const STEP_S: f64 = 1.0 / 2048.0;

/// Wrap angle of a band, rad: two wraps.
const WRAP_RAD: f64 = 4.0 * std::f64::consts::PI;

/// Ratio of the force on the moving end to the difference of the tensions.
const LEVER: f64 = 2.0;

/// Upper limit of the slack-end tension, N.
const SATURATION_N: f64 = 250.0;

/// Drag of the lining while the slack is taken up, as a share of the slip limit.
const DRAG_SHARE: f64 = 0.04;

/// Noise of the logged channels: force and actuators, N; velocity, m/s.
const FORCE_NOISE_N: f64 = 40.0;
const VELOCITY_NOISE_M_S: f64 = 1e-4;

/// Parameters of one band.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Band {
    /// Coefficient of friction in sliding, and its increase at rest.
    sliding: f64,
    static_increase: f64,
    /// Stribeck velocity of this increase, m/s.
    stribeck_m_s: f64,
    /// Relative increase of the slack-end tension in positive direction.
    asymmetry: f64,
    /// Slack, m.
    gap_m: f64,
    /// Stiffness of the stretched band, N/m of tension difference.
    stiffness_n_m: f64,
    /// Share of the preset tension.
    share: f64,
}

/// State of a band.
#[derive(Clone, Copy, Debug, Default)]
struct BandState {
    /// Position within the slack, from 0 to the gap.
    play_m: f64,
    /// Tension difference, N.
    difference_n: f64,
}

/// Damper with three bands.
#[derive(Clone, Debug)]
pub(crate) struct BandedDamper {
    bands: [Band; 3],
}

/// One row of the log.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub time_s: f64,
    pub position_m: f64,
    pub velocity_m_s: f64,
    pub force_n: f64,
    pub actuators_n: [f64; 2],
}

impl Band {
    /// Returns the maximum tension difference at a velocity, N.
    fn slip_limit_n(&self, velocity: f64, tension_n: f64) -> f64 {
        let at_rest = (-(velocity / self.stribeck_m_s).powi(2)).exp();
        let coefficient = self.sliding + self.static_increase * at_rest;
        let preset = self.share * tension_n;
        let saturation = self.share * SATURATION_N;
        let slack_end = preset * saturation / (preset + saturation);
        let directed = slack_end * (1.0 + self.asymmetry * velocity.signum());
        directed * ((coefficient * WRAP_RAD).exp() - 1.0)
    }

    /// Advances the state by `travel_m`.
    fn step(&self, state: &mut BandState, travel_m: f64, velocity: f64, tension_n: f64) {
        let limit = self.slip_limit_n(velocity, tension_n);
        let room = if travel_m > 0.0 { self.gap_m - state.play_m } else { state.play_m };
        let crossed = travel_m.abs().min(room);
        state.play_m += crossed.copysign(travel_m);
        let stretched = (travel_m.abs() - crossed).copysign(travel_m);
        // In the slack, the difference approaches the drag of the lining over the width of the gap.
        let towards = DRAG_SHARE * limit * travel_m.signum();
        let share = (crossed / self.gap_m.max(1e-9)).min(1.0);
        state.difference_n += (towards - state.difference_n) * share;
        state.difference_n =
            (state.difference_n + self.stiffness_n_m * stretched).clamp(-limit, limit);
    }
}

impl BandedDamper {
    /// Draws a damper with the tolerances of its bands.
    pub fn draw(seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut about = |value: f64, share: f64| {
            let normal: f64 = random.sample(StandardNormal);
            value * (1.0 + share * normal.clamp(-2.0, 2.0))
        };
        Self {
            bands: std::array::from_fn(|_| Band {
                sliding: about(0.3, 0.02),
                static_increase: about(0.012, 0.2),
                stribeck_m_s: about(0.02, 0.2),
                asymmetry: about(0.08, 0.3),
                gap_m: about(3.5e-3, 0.15),
                stiffness_n_m: about(5e5, 0.1),
                share: about(1.0 / 3.0, 0.03),
            }),
        }
    }

    /// Moves the drum along `position` (m, as a function of time in s) and returns the log.
    ///
    /// `rate_hz` must divide the integration rate.
    pub fn record(
        &self,
        tension_n: f64,
        seconds: f64,
        rate_hz: f64,
        seed: u64,
        position: impl Fn(f64) -> f64,
    ) -> Vec<Row> {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        let every = ((1.0 / STEP_S) / rate_hz).round().max(1.0) as usize;
        let steps = (seconds / STEP_S) as usize;
        let mut states = [BandState::default(); 3];
        for (state, band) in states.iter_mut().zip(&self.bands) {
            state.play_m = 0.5 * band.gap_m;
        }
        let mut rows = Vec::with_capacity(steps / every + 1);
        let mut before = position(0.0);
        for step in 0..=steps {
            let time_s = step as f64 * STEP_S;
            let now = position(time_s);
            let travel = now - before;
            before = now;
            let velocity = travel / STEP_S;
            for (state, band) in states.iter_mut().zip(&self.bands) {
                band.step(state, travel, velocity, tension_n);
            }
            if step % every == 0 {
                let difference: f64 = states.iter().map(|state| state.difference_n).sum();
                // Both ends have the saturated preset tension; the tight end also has the difference.
                let slack = tension_n * SATURATION_N / (tension_n + SATURATION_N);
                let ends = [slack + (-difference).max(0.0), slack + difference.max(0.0)];
                rows.push(Row {
                    time_s,
                    position_m: now,
                    velocity_m_s: velocity + VELOCITY_NOISE_M_S * normal(),
                    force_n: LEVER * difference + FORCE_NOISE_N * normal(),
                    actuators_n: ends.map(|end| end + FORCE_NOISE_N * normal()),
                });
            }
        }
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn sine(tension_n: f64) -> Vec<Row> {
        let damper = BandedDamper::draw(1);
        damper.record(tension_n, 8.0, 256.0, 2, |t| 0.025 * (TAU * 0.5 * t).sin())
    }

    #[test]
    fn record_returns_forces_in_the_range_of_the_published_tests() {
        let peak =
            |tension: f64| sine(tension).iter().map(|row| row.force_n.abs()).fold(0.0, f64::max);
        let (loose, tight) = (peak(89.0), peak(356.0));
        assert!((3e3..9e3).contains(&loose), "{loose}");
        assert!((8e3..18e3).contains(&tight), "{tight}");
        // The force is far from proportional to the tension.
        assert!(tight < 3.0 * loose);
    }

    #[test]
    fn record_over_a_cycle_dissipates_energy_and_is_asymmetric() {
        let rows = sine(160.0);
        let later = || rows.iter().skip(1024);
        let work: f64 = later().map(|row| row.force_n * row.velocity_m_s / 256.0).sum();
        assert!(work > 100.0, "{work} J");
        let most = later().map(|row| row.force_n).fold(0.0, f64::max);
        let least = later().map(|row| -row.force_n).fold(0.0, f64::max);
        assert!(most > 1.05 * least, "{most} {least}");
    }

    #[test]
    fn record_after_reversal_depends_on_travel_and_not_on_frequency() {
        let half_swing = |frequency: f64| {
            let damper = BandedDamper::draw(1);
            let seconds = 3.0 / frequency;
            let rows =
                damper.record(160.0, seconds, 1024.0, 2, |t| 0.025 * (TAU * frequency * t).sin());
            // Rows after the third maximum of the position.
            let start = rows.len() * 9 / 12;
            let crest = rows[start].position_m;
            let crossed = rows[start..]
                .iter()
                .find(|row| row.force_n < 0.0)
                .expect("the force changes its sign");
            crest - crossed.position_m
        };
        let (slow, fast) = (half_swing(0.1), half_swing(1.0));
        assert!((2e-3..12e-3).contains(&slow), "{slow}");
        assert!((slow - fast).abs() < 0.25 * slow, "{slow} {fast}");
    }

    #[test]
    fn record_returns_actuator_forces_that_follow_from_the_friction() {
        for row in sine(160.0) {
            let [one, two] = row.actuators_n;
            assert!((row.force_n - LEVER * (two - one)).abs() < 20.0 * FORCE_NOISE_N);
        }
    }
}

//! The PI controller of one axis of current, for a sample period.
//!
//! ```text
//! v[k]   = kp e[k] + s[k] + f[k]                       wanted, V; f: what is known beforehand
//! s[k+1] = s[k] + ki_t (e[k] + (u[k] - v[k]) / kp)     u: what the bridge could give of v
//! ```
//! The winding answers a voltage as `i[k+1] = a i[k] + (1-a)/R v[k]`, `a = exp(-R T / L)`. The zero of the
//! controller is laid on `a` (`ki_t = kp (1 - a)`), and `kp = g R / (1 - a)` with `g = 1 - exp(-2 pi f T)`
//! leaves a loop `g / (z - 1)` of bandwidth `f`. The PWM's period of delay makes that `z (z - 1) + g`,
//! which does not overshoot up to `g = 1/4`: hence the limit of a twentieth of the loop rate on `f`.
//!
//! While the bridge cannot give what is wanted, `s` goes to where the wanted and the given agree
//! (Hanus' conditioning): no windup, and no time constant to choose. `s` is in volts, so that gains may
//! be swapped under it. It is held to `+-limit`; a NaN leaves it 0.

/// Largest bandwidth as a share of the loop rate.
pub const BANDWIDTH_SHARE_MAX: f32 = 0.05;

/// Gains built for a period; immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Proportional, V/A.
    pub kp: f32,
    /// Integral times the period, V/A.
    pub ki_t: f32,
    /// `ki_t / kp`: share of an unmet voltage taken back in a period.
    back: f32,
}

impl Gains {
    /// Gains that cancel the winding's pole. Resistance in ohm, inductance in H, bandwidth in Hz, period
    /// in s, all positive; [`super::MotorParameters`] guards them.
    pub fn cancelling(resistance: f32, inductance: f32, bandwidth_hz: f32, period_s: f32) -> Self {
        let decay = one_minus_exp(resistance * period_s / inductance);
        let loop_gain = one_minus_exp(core::f32::consts::TAU * bandwidth_hz * period_s);
        let kp = loop_gain * resistance / decay;
        Self::given(kp, kp * decay)
    }

    /// Gains as they are: V/A, and V/A in a period. `kp` is positive.
    pub fn given(kp: f32, ki_t: f32) -> Self {
        Self { kp, ki_t, back: ki_t / kp }
    }
}

/// `1 - exp(-x)` for `x >= 0`. Built once, so the series may take its time: without a library, and
/// without the cancellation of subtracting two nearly equal numbers.
pub(super) fn one_minus_exp(x: f32) -> f32 {
    // Halved until the series is short, then 1 - (1 - y)^2 = y (2 - y) as often.
    let mut x = x.clamp(0.0, 64.0);
    let mut halvings = 0;
    while x > 0.125 {
        x *= 0.5;
        halvings += 1;
    }
    let mut y = x * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0 - x / 120.0))));
    for _ in 0..halvings {
        y *= 2.0 - y;
    }
    y
}

/// The integral of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Integral {
    volts: f32,
}

impl Integral {
    /// The integral, V.
    pub fn volts(self) -> f32 {
        self.volts
    }

    /// The voltage wanted for a current error (A), V.
    #[inline(always)]
    pub fn wanted(self, gains: &Gains, error_a: f32, known_v: f32) -> f32 {
        gains.kp * error_a + self.volts + known_v
    }

    /// Takes note of what the bridge gives (`given_v`) of what was wanted, and of the error.
    #[inline(always)]
    pub fn settle(
        &mut self,
        gains: &Gains,
        error_a: f32,
        wanted_v: f32,
        given_v: f32,
        limit_v: f32,
    ) {
        let next = self.volts + gains.ki_t * error_a + gains.back * (given_v - wanted_v);
        // A NaN fails both comparisons.
        self.volts = if next >= -limit_v && next <= limit_v {
            next
        } else if next > limit_v {
            limit_v
        } else if next < -limit_v {
            -limit_v
        } else {
            0.0
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::PERIOD_S;

    #[test]
    fn one_minus_exp_is_that() {
        for x in [0.0, 1e-6, 1e-3, 0.1, 0.2, 1.0, 5.0, 30.0, 64.0] {
            let exact = -f64::exp_m1(-f64::from(x));
            assert!((f64::from(one_minus_exp(x)) - exact).abs() <= 4e-7 * exact, "{x}");
        }
    }

    /// The winding in f64, with the PWM's period of delay; gives the current of every period.
    fn step_response(share: f32, volts: f32) -> Vec<f64> {
        let (r, l) = (0.12f32, 90e-6f32);
        let gains = Gains::cancelling(r, l, share / PERIOD_S, PERIOD_S);
        let a = (-f64::from(r) * f64::from(PERIOD_S) / f64::from(l)).exp();
        let (mut i, mut pending, mut integral) = (0.0f64, 0.0f64, Integral::default());
        (0..400)
            .map(|_| {
                let error = 5.0 - i as f32;
                let wanted = integral.wanted(&gains, error, 0.0);
                let given = wanted.clamp(-volts, volts);
                integral.settle(&gains, error, wanted, given, volts);
                i = a * i + (1.0 - a) / f64::from(r) * pending;
                pending = f64::from(given);
                i
            })
            .collect()
    }

    #[test]
    fn the_pole_is_cancelled_and_the_limit_bandwidth_hardly_overshoots() {
        let response = step_response(BANDWIDTH_SHARE_MAX, 1e3);
        let peak = response.iter().fold(0.0f64, |peak, i| peak.max(*i)) / 5.0;
        assert!((1.0..1.006).contains(&peak), "{peak}");
        // 63 % after the delay and one time constant 1/(2 pi f): 1 + 3.2 periods, no slow tail after.
        let rise = response.iter().position(|i| *i > 5.0 * 0.632).expect("it rises");
        assert!((3..=5).contains(&rise), "{rise}");
        assert!((response[30] / 5.0 - 1.0).abs() < 1e-3, "{}", response[30]);
    }

    #[test]
    fn a_saturated_step_does_not_overshoot_when_it_comes_back() {
        let response = step_response(0.03, 0.68);
        let slow = response.iter().position(|i| *i > 4.75).expect("it arrives");
        let free = step_response(0.03, 1e3).iter().position(|i| *i > 4.75).expect("it arrives");
        assert!(slow > 2 * free, "the limit is to act: {slow} against {free}");
        let peak = response.iter().fold(0.0f64, |peak, i| peak.max(*i)) / 5.0;
        assert!(peak < 1.006, "{peak}");
    }

    #[test]
    fn the_integral_stays_finite_and_within_its_limit() {
        let gains = Gains::given(0.3, 0.02);
        let mut integral = Integral::default();
        for error in [1e9, f32::NAN, -1e30, f32::INFINITY, f32::NEG_INFINITY] {
            let wanted = integral.wanted(&gains, error, 0.0);
            integral.settle(&gains, error, wanted, wanted.clamp(-20.0, 20.0), 20.0);
            assert!(integral.volts().abs() <= 20.0, "{error}: {integral:?}");
        }
    }
}

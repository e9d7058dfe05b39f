//! The PI controller of one current axis, for a sample period.
//!
//! ```text
//! v[k]   = kp e[k] + s[k] + f[k]                       demand, V; f: feed-forward
//! s[k+1] = s[k] + ki_t (e[k] + (u[k] - v[k]) / kp)     u: voltage that the bridge applied
//! ```
//! The winding responds to a voltage as `i[k+1] = a i[k] + (1-a)/R v[k]`, `a = exp(-R T / L)`. The zero of the
//! controller cancels the pole `a` (`ki_t = kp (1 - a)`). With `kp = g R / (1 - a)` and `g = 1 - exp(-2 pi f T)`
//! the loop is `g / (z - 1)`, of bandwidth `f`. The PWM adds one period of delay: `z (z - 1) + g`, which does
//! not overshoot up to `g = 1/4`. Therefore `f` is limited to a twentieth of the loop rate.
//!
//! While the bridge cannot apply the demanded voltage, `s` moves to the value at which demanded and applied
//! voltage agree (Hanus' conditioning technique). This prevents windup and needs no time constant. `s` is in
//! volts, so gains may be swapped at any time. It is limited to `+-limit`; a NaN clears it.

/// Maximum bandwidth as a share of the loop rate.
pub const BANDWIDTH_SHARE_MAX: f32 = 0.05;

/// Gains built for a period; immutable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Proportional, V/A.
    pub kp: f32,
    /// Integral times the period, V/A.
    pub ki_t: f32,
    /// `ki_t / kp`: share of the voltage deficit that is fed back per period.
    tracking_gain: f32,
}

impl Gains {
    /// Returns gains that cancel the pole of the winding. Resistance in ohm, inductance in H, bandwidth in Hz,
    /// period in s. All must be positive, which [`super::MotorParameters`] ensures.
    #[inline(never)]
    pub fn with_pole_cancellation(
        resistance: f32,
        inductance: f32,
        bandwidth_hz: f32,
        period_s: f32,
    ) -> Self {
        let decay = one_minus_exp(resistance * period_s / inductance);
        let loop_gain = one_minus_exp(core::f32::consts::TAU * bandwidth_hz * period_s);
        let kp = loop_gain * resistance / decay;
        Self::new(kp, kp * decay)
    }

    /// Creates gains: V/A, and V/A per period. `kp` must be positive.
    pub fn new(kp: f32, ki_t: f32) -> Self {
        Self { kp, ki_t, tracking_gain: ki_t / kp }
    }
}

/// Returns `1 - exp(-x)` for `x >= 0`. The series needs no library and avoids the cancellation of two nearly
/// equal numbers. It runs at build time only.
pub(super) fn one_minus_exp(x: f32) -> f32 {
    // Halve x until the series is short, then apply 1 - (1 - y)^2 = y (2 - y) as often.
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
    /// Returns the integral, V.
    pub fn volts(self) -> f32 {
        self.volts
    }

    /// Returns the voltage demand for a current error (A), V.
    #[inline(always)]
    pub fn output(self, gains: &Gains, error_a: f32, feed_forward_v: f32) -> f32 {
        gains.kp * error_a + self.volts + feed_forward_v
    }

    /// Updates the integral with the error and the voltage applied of the demand.
    #[inline(always)]
    pub fn update(
        &mut self,
        gains: &Gains,
        error_a: f32,
        demand_v: f32,
        applied_v: f32,
        limit_v: f32,
    ) {
        let next = self.volts + gains.ki_t * error_a + gains.tracking_gain * (applied_v - demand_v);
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
    fn one_minus_exp_matches_the_exact_value() {
        for x in [0.0, 1e-6, 1e-3, 0.1, 0.2, 1.0, 5.0, 30.0, 64.0] {
            let exact = -f64::exp_m1(-f64::from(x));
            assert!((f64::from(one_minus_exp(x)) - exact).abs() <= 4e-7 * exact, "{x}");
        }
    }

    /// Simulates the winding in f64, with the PWM's delay of one period; returns the current of every period.
    fn step_response(share: f32, volts: f32) -> Vec<f64> {
        let (r, l) = (0.12f32, 90e-6f32);
        let gains = Gains::with_pole_cancellation(r, l, share / PERIOD_S, PERIOD_S);
        let a = (-f64::from(r) * f64::from(PERIOD_S) / f64::from(l)).exp();
        let (mut i, mut pending, mut integral) = (0.0f64, 0.0f64, Integral::default());
        (0..400)
            .map(|_| {
                let error = 5.0 - i as f32;
                let demand = integral.output(&gains, error, 0.0);
                let applied = demand.clamp(-volts, volts);
                integral.update(&gains, error, demand, applied, volts);
                i = a * i + (1.0 - a) / f64::from(r) * pending;
                pending = f64::from(applied);
                i
            })
            .collect()
    }

    #[test]
    fn step_response_at_maximum_bandwidth_overshoots_less_than_one_percent() {
        let response = step_response(BANDWIDTH_SHARE_MAX, 1e3);
        let peak = response.iter().fold(0.0f64, |peak, i| peak.max(*i)) / 5.0;
        assert!((1.0..1.006).contains(&peak), "{peak}");
        // 63 % after the delay and one time constant 1/(2 pi f): 1 + 3.2 periods, without a slow tail.
        let rise = response.iter().position(|i| *i > 5.0 * 0.632).expect("it rises");
        assert!((3..=5).contains(&rise), "{rise}");
        assert!((response[30] / 5.0 - 1.0).abs() < 1e-3, "{}", response[30]);
    }

    #[test]
    fn step_response_after_saturation_does_not_overshoot() {
        let response = step_response(0.03, 0.68);
        let slow = response.iter().position(|i| *i > 4.75).expect("it arrives");
        let free = step_response(0.03, 1e3).iter().position(|i| *i > 4.75).expect("it arrives");
        assert!(slow > 2 * free, "the limit is to act: {slow} against {free}");
        let peak = response.iter().fold(0.0f64, |peak, i| peak.max(*i)) / 5.0;
        assert!(peak < 1.006, "{peak}");
    }

    #[test]
    fn integral_with_any_error_stays_finite_and_limited() {
        let gains = Gains::new(0.3, 0.02);
        let mut integral = Integral::default();
        for error in [1e9, f32::NAN, -1e30, f32::INFINITY, f32::NEG_INFINITY] {
            let demand = integral.output(&gains, error, 0.0);
            integral.update(&gains, error, demand, demand.clamp(-20.0, 20.0), 20.0);
            assert!(integral.volts().abs() <= 20.0, "{error}: {integral:?}");
        }
    }
}

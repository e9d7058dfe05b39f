//! The PI controller of one current axis, for a sample period.
//!
//! ```text
//! v[k]   = kp e[k] + s[k] + f[k]                       demand, V; f: feed-forward
//! s[k+1] = s[k] + ki_t (e[k] + (u[k] - v[k]) / kp)     u: voltage that the bridge applied
//! ```
//! The winding responds to a voltage as `i[k+1] = a i[k] + (1-a)/R v[k]`, `a = exp(-R T / L)`. The zero of the
//! controller cancels the pole `a` (`ki_t = kp (1 - a)`). With `kp = g R / (1 - a)` and `g = 1 - exp(-2 pi f T)`
//! the loop is `g / (z - 1)`, of bandwidth `f`. The PWM adds one period of delay: `g / (z (z - 1))`, of phase margin
//! `90 deg - 3 asin(g / 2)` and gain margin `1 / g` ([`Margins`]). Up to `g = 1/4` its step response does not overshoot.
//!
//! Up to a twentieth of the loop rate, every motor permits the bandwidth. Up to a tenth ([`BANDWIDTH_SHARE_MAX`]), where
//! nominal margins are 49 deg and 6.6 dB, the motor must permit it ([`bandwidth_share`]): an inductance that saturation
//! lowers by 30 % leaves 31 deg and 3.5 dB. The response to a reference would overshoot by 21 %, so the loop follows a
//! reference that a first-order lag shapes ([`reference_gain`]): 4 % are left. Disturbances do not pass through the lag.
//!
//! While the bridge cannot apply the demanded voltage, `s` moves to the value at which demanded and applied
//! voltage agree (Hanus' conditioning technique). This prevents windup and needs no time constant. `s` is in
//! volts, so gains may be swapped at any time. It is limited to `+-limit`; a NaN clears it.

use super::space_vector::MAX_VECTOR_PER_BUS_V;

/// Bandwidth as a share of the loop rate that every motor permits.
pub const BANDWIDTH_SHARE_ANY: f32 = 0.05;

/// Maximum bandwidth as a share of the loop rate.
pub const BANDWIDTH_SHARE_MAX: f32 = 0.1;

/// Minimum time constant of a winding for more than [`BANDWIDTH_SHARE_ANY`], periods. The pole of a faster one moves with its
/// temperature and its saturation by so much that the controller's zero does not cancel it.
const TIME_CONSTANT_MIN_PERIODS: f32 = 4.0;

/// Share by which a winding may be colder than at its measurement: its resistance is lower.
const COLD_SHARE: f32 = 0.8;

/// Three standard deviations of a current measurement, A: shunts and converter.
const CURRENT_NOISE_A: f32 = 0.15;

/// Share of the longest voltage vector that this noise may demand.
const NOISE_SHARE_MAX: f32 = 0.1;

/// Tolerance of a measured inductance, which [`Margins`] include.
pub const INDUCTANCE_TOLERANCE: f32 = 0.05;

/// Returns the highest bandwidth that a winding permits, as a share of the loop rate, between [`BANDWIDTH_SHARE_ANY`] and
/// [`BANDWIDTH_SHARE_MAX`]. The inductances are along and across the magnet.
pub fn bandwidth_share(
    resistance_ohm: f32,
    inductances_h: [f32; 2],
    bus_min_v: f32,
    period_s: f32,
) -> f32 {
    let [d_h, q_h] = inductances_h;
    let (least_h, most_h) = if d_h < q_h { (d_h, q_h) } else { (q_h, d_h) };
    if least_h < TIME_CONSTANT_MIN_PERIODS * resistance_ohm * period_s {
        return BANDWIDTH_SHARE_ANY;
    }
    // kp = g R / (1 - a), which is g L / T for a slow winding.
    let decay = one_minus_exp(resistance_ohm * COLD_SHARE * period_s / most_h);
    let noise_v = CURRENT_NOISE_A * resistance_ohm * COLD_SHARE / decay;
    let loop_gain = NOISE_SHARE_MAX * MAX_VECTOR_PER_BUS_V * bus_min_v / noise_v;
    // The chord of `g` over the share: within 2 % of the curve.
    let (of_any, of_max) = (loop_gain_of(BANDWIDTH_SHARE_ANY), loop_gain_of(BANDWIDTH_SHARE_MAX));
    let part = ((loop_gain - of_any) / (of_max - of_any)).clamp(0.0, 1.0);
    BANDWIDTH_SHARE_ANY + part * (BANDWIDTH_SHARE_MAX - BANDWIDTH_SHARE_ANY)
}

/// Returns `g` for a bandwidth as a share of the loop rate.
fn loop_gain_of(share: f32) -> f32 {
    one_minus_exp(core::f32::consts::TAU * share)
}

/// Returns the share of the difference by which the reference moves per period; 1, without a lag, up to
/// [`BANDWIDTH_SHARE_ANY`]. The overshoot stays below 5 %, and the bandwidth of the response is not lower than that of the
/// loop.
pub fn reference_gain(bandwidth_hz: f32, period_s: f32) -> f32 {
    const LAG_PER_SHARE: f32 = 32.0;
    let beyond = bandwidth_hz * period_s - BANDWIDTH_SHARE_ANY;
    if beyond <= 0.0 { 1.0 } else { 1.0 / (1.0 + LAG_PER_SHARE * beyond) }
}

/// Stability margins of a current loop with the winding's inductance lower by [`INDUCTANCE_TOLERANCE`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// Phase margin, rad.
    pub phase_rad: f32,
    /// Gain margin, a factor.
    pub gain: f32,
}

impl Margins {
    /// Returns the margins at a bandwidth in Hz and a period in s.
    pub fn at(bandwidth_hz: f32, period_s: f32) -> Self {
        let g = loop_gain_of(bandwidth_hz * period_s) / (1.0 - INDUCTANCE_TOLERANCE);
        // asin(x) for x up to 0.27, to 1e-4.
        let half = 0.5 * g;
        let angle = half * (1.0 + half * half * (1.0 / 6.0 + 0.075 * half * half));
        Self { phase_rad: core::f32::consts::FRAC_PI_2 - 3.0 * angle, gain: 1.0 / g }
    }
}

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
    /// Returns gains that cancel the pole of the winding. All values must be positive, which
    /// [`super::MotorParameters`] ensures.
    #[inline(never)]
    pub fn with_pole_cancellation(
        resistance_ohm: f32,
        inductance_h: f32,
        bandwidth_hz: f32,
        period_s: f32,
    ) -> Self {
        let decay = one_minus_exp(resistance_ohm * period_s / inductance_h);
        let loop_gain = loop_gain_of(bandwidth_hz * period_s);
        let kp = loop_gain * resistance_ohm / decay;
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
        step_response_with(share, volts, 1.0)
    }

    /// As [`step_response`], with a winding of this share of the written inductance.
    fn step_response_with(share: f32, volts: f32, inductance_share: f32) -> Vec<f64> {
        let (r, l) = (0.12f32, 90e-6f32);
        let gains = Gains::with_pole_cancellation(r, l, share / PERIOD_S, PERIOD_S);
        let shaping = reference_gain(share / PERIOD_S, PERIOD_S);
        let a = (-f64::from(r) * f64::from(PERIOD_S) / f64::from(l * inductance_share)).exp();
        let (mut i, mut pending, mut integral) = (0.0f64, 0.0f64, Integral::default());
        let mut reference = 0.0f32;
        (0..400)
            .map(|_| {
                reference += shaping * (5.0 - reference);
                let error = reference - i as f32;
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
    fn step_response_at_bandwidth_of_every_motor_overshoots_less_than_one_percent() {
        let response = step_response(BANDWIDTH_SHARE_ANY, 1e3);
        let peak = response.iter().fold(0.0f64, |peak, i| peak.max(*i)) / 5.0;
        assert!((1.0..1.006).contains(&peak), "{peak}");
        // 63 % after the delay and one time constant 1/(2 pi f): 1 + 3.2 periods, without a slow tail.
        let rise = response.iter().position(|i| *i > 5.0 * 0.632).expect("it rises");
        assert!((3..=5).contains(&rise), "{rise}");
        assert!((response[30] / 5.0 - 1.0).abs() < 1e-3, "{}", response[30]);
    }

    #[test]
    fn step_response_at_higher_bandwidths_overshoots_less_than_five_percent() {
        for share in [0.055, 0.0625, 0.075, 0.0875, BANDWIDTH_SHARE_MAX] {
            let response = step_response(share, 1e3);
            let peak = response.iter().fold(0.0f64, |peak, i| peak.max(*i)) / 5.0;
            assert!((1.0..1.05).contains(&peak), "{share}: {peak}");
            assert!((response[30] / 5.0 - 1.0).abs() < 1e-2, "{share}: {}", response[30]);
            // A winding that saturation leaves 70 % of its inductance settles, too.
            let saturated = step_response_with(share, 1e3, 0.7);
            let peak = saturated.iter().fold(0.0f64, |peak, i| peak.max(*i)) / 5.0;
            assert!(peak < 1.25 && (saturated[60] / 5.0 - 1.0).abs() < 1e-2, "{share}: {peak}");
        }
    }

    #[test]
    fn margins_are_those_of_the_delayed_integrator() {
        for (hz, phase_deg, gain_db) in
            [(800.0f32, 69.9, 12.6), (1000.0, 65.5, 10.9), (2000.0, 47.4, 6.2)]
        {
            let margins = Margins::at(hz, PERIOD_S);
            assert!((margins.phase_rad.to_degrees() - phase_deg).abs() < 0.2, "{margins:?}");
            assert!((20.0 * margins.gain.log10() - gain_db).abs() < 0.1, "{margins:?}");
        }
    }

    #[test]
    fn bandwidth_share_of_a_fast_or_noisy_winding_is_lower() {
        let share = |r, l, bus| bandwidth_share(r, [l, l], bus, PERIOD_S);
        assert_eq!(share(0.12, 90e-6, 18.0), BANDWIDTH_SHARE_MAX);
        // 38 us: less than a period.
        assert_eq!(share(1.0, 38e-6, 18.0), BANDWIDTH_SHARE_ANY);
        // 9 mH at 18 V: the noise would demand more than the bus at any bandwidth.
        assert_eq!(share(1.0, 9e-3, 18.0), BANDWIDTH_SHARE_ANY);
        let between = share(0.3, 0.9e-3, 18.0);
        assert!((0.055..0.099).contains(&between), "{between}");
        assert_eq!(share(0.3, 0.9e-3, 40.0), BANDWIDTH_SHARE_MAX);
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

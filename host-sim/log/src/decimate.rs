//! Decimation with an anti-aliasing filter.
//!
//! If only every R-th sample is kept, vibration above the new Nyquist frequency appears below it as slow motion. So
//! values are low-pass filtered first, with the filter of identification papers and of MATLAB's `decimate`: Chebyshev
//! type I of order eight, 0.05 dB ripple, cut-off at 0.8 of the new Nyquist frequency. It is applied forwards and
//! backwards, so it causes no delay.
//!
//! The *residual* of a simulation at the full rate and its derivatives are decimated, not the log: a nonlinear law needs
//! the original velocity. Near a reversal, the sign of a decimated velocity depends on the phase of the decimation, and
//! with it twice the Coulomb torque.
//!
//! There are two differences to MATLAB's filter. The gain at zero frequency is exactly 1 (with an even order, the ripple
//! would reduce it by 1.1 %). And the ends are not mirrored: the filter starts as if the first value had been constant
//! before, so that a noisy end sample has no large effect.

use std::f64::consts::PI;

/// A filter section: `(b0 + b1 z^-1 + b2 z^-2) / (1 + a1 z^-1 + a2 z^-2)`.
#[derive(Debug, Clone, Copy)]
struct Biquad {
    b: [f64; 3],
    a: [f64; 2],
}

/// The low-pass filter that is applied before keeping every R-th sample.
#[derive(Debug, Clone)]
pub struct AntiAlias {
    factor: usize,
    sections: [Biquad; 4],
}

impl AntiAlias {
    /// Designs the filter for a decimation by `factor` (2 or more).
    ///
    /// The poles of the analogue Chebyshev filter are on an ellipse. The bilinear transform maps them into the unit
    /// circle, with pre-warped cut-off. All zeros are at the Nyquist frequency.
    pub fn new(factor: usize) -> AntiAlias {
        const ORDER: f64 = 8.0;
        const RIPPLE_DB: f64 = 0.05;
        const CUT_OFF: f64 = 0.8;
        let epsilon = (10f64.powf(RIPPLE_DB / 10.0) - 1.0).sqrt();
        let (narrow, wide) = {
            let v = (1.0 / epsilon).asinh() / ORDER;
            (v.sinh(), v.cosh())
        };
        // The factor `2 / T` of the bilinear transform is included in the frequency.
        let warped = (PI * CUT_OFF / (2.0 * factor as f64)).tan();
        let section = |pair: usize| {
            let angle = PI * (2 * pair + 1) as f64 / (2.0 * ORDER);
            let (re, im) = (-warped * narrow * angle.sin(), warped * wide * angle.cos());
            // z = (1 + s) / (1 - s), for the pole s = re + j im and its conjugate.
            let scale = (1.0 - re) * (1.0 - re) + im * im;
            let a1 = -2.0 * (1.0 - re * re - im * im) / scale;
            let a2 = ((1.0 + re) * (1.0 + re) + im * im) / scale;
            // (1 + z^-1)^2 sums to 4 at zero frequency. 1 + a1 + a2 is 4 |s|^2 / scale; this form keeps its digits
            // for a large factor.
            let b0 = (re * re + im * im) / scale;
            Biquad { b: [b0, 2.0 * b0, b0], a: [a1, a2] }
        };
        AntiAlias { factor, sections: [section(3), section(2), section(1), section(0)] }
    }

    /// Filters one segment and keeps the last value of each `factor`. Remaining values at the end are dropped.
    pub fn thin(&self, mut values: Vec<f64>) -> Vec<f64> {
        for section in &self.sections {
            section.run(values.iter_mut());
        }
        for section in &self.sections {
            section.run(values.iter_mut().rev());
        }
        values.into_iter().skip(self.factor - 1).step_by(self.factor).collect()
    }
}

impl Biquad {
    /// Filters once, in the transposed direct form, from the steady state of the first value.
    fn run<'a>(&self, mut values: impl Iterator<Item = &'a mut f64>) {
        let Biquad { b, a } = self;
        let Some(first) = values.next() else { return };
        // In the steady state with gain 1 the output equals the input, which gives the states.
        let mut late = (b[2] - a[1]) * *first;
        let mut early = (b[1] - a[0]) * *first + late;
        for value in std::iter::once(first).chain(values) {
            let (input, output) = (*value, b[0] * *value + early);
            early = b[1] * input - a[0] * output + late;
            late = b[2] * input - a[1] * output;
            *value = output;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(n: usize, wave: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..n).map(|i| wave(i as f64 * 0.001)).collect()
    }

    #[test]
    fn new_returns_poles_of_the_textbook_filter() {
        // scipy.signal.cheby1(8, 0.05, 0.08, output="sos")
        let expected = [
            (-1.82049686, 0.830859740),
            (-1.82895056, 0.855317371),
            (-1.85173345, 0.901516106),
            (-1.89653960, 0.964424558),
        ];
        for (section, (a1, a2)) in AntiAlias::new(10).sections.iter().zip(expected) {
            assert!((section.a[0] - a1).abs() < 1e-8, "{section:?} {a1}");
            assert!((section.a[1] - a2).abs() < 1e-8, "{section:?} {a2}");
            let at_rest = section.b.iter().sum::<f64>() / (1.0 + section.a[0] + section.a[1]);
            assert!((at_rest - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn thin_with_slow_motion_does_not_shift_it() {
        // 5 Hz, a tenth of the new Nyquist frequency of 50 Hz.
        let wave = |t: f64| (2.0 * PI * 5.0 * t).sin();
        let thin = AntiAlias::new(10).thin(sampled(4000, wave));
        assert_eq!(thin.len(), 400);
        for (row, value) in thin.iter().enumerate().take(370).skip(30) {
            let t = (10 * row + 9) as f64 * 0.001;
            assert!((value - wave(t)).abs() < 0.013, "{value} at {t}");
        }
    }

    #[test]
    fn thin_with_vibration_above_nyquist_removes_it() {
        // 90 Hz would fold down to 10 Hz at full size.
        let thin = AntiAlias::new(10).thin(sampled(4000, |t| (2.0 * PI * 90.0 * t).sin()));
        let largest = |rows: &[f64]| rows.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        assert!(largest(&thin[100..300]) < 1e-5);
        assert!(largest(&thin[30..370]) < 1e-3, "the ends ring a little");
    }

    #[test]
    fn thin_with_very_large_factor_is_stable() {
        let thin = AntiAlias::new(5000).thin(sampled(1_000_000, |t| 3.0 + t));
        assert_eq!(thin.len(), 200);
        for (row, value) in thin.iter().enumerate() {
            // The filter starts from a steady state, which a ramp is not: off by some 2.5 new steps there.
            let allowed = if (40..160).contains(&row) { 1e-3 } else { 15.0 };
            let expected = 3.0 + (5000 * row + 4999) as f64 * 0.001;
            assert!((value - expected).abs() < allowed, "{value} at {row}");
        }
    }

    #[test]
    fn thin_with_short_segment_returns_nothing_and_keeps_a_constant() {
        assert!(AntiAlias::new(10).thin(vec![1.0; 9]).is_empty());
        let thin = AntiAlias::new(10).thin(vec![0.7; 100]);
        assert!(thin.iter().all(|value| (value - 0.7).abs() < 1e-12));
    }
}

//! Blind estimation of the order of a ripple.
//!
//! An eccentric seal, a gear mesh or a scratched shaft changes the friction level `n` times per
//! turn, and `n` is unknown. The residual `e` is weighted with the derivative `h` of the torque by
//! the level, which changes sign with the direction. The spectrum of the product over the angle `q`
//! is:
//!
//! ```text
//! S(n) = sum_rows h e exp(-i n q)      for all n from LEAST to most, by one Fourier transform
//! ```
//!
//! The rows are first distributed on an even grid of angles with linear weights, and the spectrum
//! is corrected for the roll-off of these weights. A ripple must exceed its neighbourhood, the
//! median power of the orders around it. The neighbourhood also contains slow structure of the
//! residual.
//!
//! Under the null hypothesis, the ratio of powers has an exponential distribution. The best of `M`
//! orders then reaches `P` with probability `1 - (1 - exp(-P))^M`.

use super::train_test::TrainTest;
use compensator_core::Sample;
use joint_log::JointKind;
use joint_log::motion::columns::median;
use rustfft::algorithm::Radix4;
use rustfft::num_complex::Complex;
use rustfft::{Fft, FftDirection};
use std::f64::consts::PI;

/// Lowest order of the search, 1/rad.
const LEAST: f64 = 0.5;

/// Highest order of the search for a revolute joint, 1/rad.
const MOST_REVOLUTE: f64 = 300.0;

/// Highest order of the search for a prismatic joint, 1/m. It corresponds to a lead of 2 mm.
const MOST_PRISMATIC: f64 = 3200.0;

/// Largest number of points of the Fourier transform.
const LONGEST: usize = 1 << 22;

/// Half width of the neighbourhood of an order, in independent orders.
const NEIGHBOURS: usize = 64;

/// Returns the highest order that a log can show, 1/rad or 1/m.
///
/// Half of the rows in motion must sample a wave at least twice per period. A higher order is
/// aliased to a lower one.
pub fn most(log: &TrainTest) -> f64 {
    let sought = match log.train.joint {
        JointKind::Revolute => MOST_REVOLUTE,
        JointKind::Prismatic => MOST_PRISMATIC,
    };
    let step = |pair: &[Sample<f64>]| (pair[1].position_rad - pair[0].position_rad).abs();
    let steps = log.train_tracks.iter().flat_map(|track| track.samples.windows(2).map(step));
    let step = median(steps);
    if step > 0.0 { sought.min(PI / step) } else { sought }
}

/// A row: its position, and the product of level derivative and residual.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Position, rad.
    pub position: f64,
    /// Product `h e` of the module documentation.
    pub weighed: f64,
}

/// A peak of the spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Order, 1/rad.
    pub order: f64,
    /// Ratio of its power to that of its neighbourhood.
    pub prominence: f64,
    /// Probability that the best of all orders reaches this prominence under the null hypothesis.
    pub p_value: f64,
    /// Number of orders that the range of the angle can distinguish.
    pub independent: f64,
}

impl Peak {
    /// Returns the order and the number of orders from which it was chosen.
    ///
    /// If the range of the angle cannot distinguish it from the nearest whole order, the whole
    /// order is returned. A ripple of the shaft has a whole number of periods per turn. `most` is
    /// the highest order of the search.
    pub fn whole(&self, most: f64) -> (f64, f64) {
        let apart = (most - LEAST) / self.independent;
        let whole = self.order.round();
        if whole >= 1.0 && (whole - self.order).abs() < 0.5 * apart {
            (whole, self.independent.min(most))
        } else {
            (self.order, self.independent)
        }
    }
}

/// Returns the most prominent orders, at most `count`, the most prominent first. Returns none if
/// the position does not vary.
pub fn peaks(points: &[Point], most: f64, count: usize) -> Vec<Peak> {
    let positions = || points.iter().map(|point| point.position);
    let (least_q, most_q) =
        positions().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), q| (a.min(q), b.max(q)));
    let range = most_q - least_q;
    if !(range.is_finite() && range > 0.0) {
        return Vec::new();
    }
    // The grid has four points in the shortest wave. The range is padded to twice its length.
    let spacing = std::f64::consts::PI / (2.0 * most);
    let length = ((2.0 * range / spacing).ceil() as usize + 4).next_power_of_two().min(LONGEST);
    let spacing = spacing.max(2.0 * range / (length as f64 - 4.0));
    let mut grid = vec![Complex::new(0.0, 0.0); length];
    for point in points {
        let at = (point.position - least_q) / spacing;
        let cell = (at as usize).min(length - 2);
        let share = at - cell as f64;
        grid[cell].re += point.weighed * (1.0 - share);
        grid[cell + 1].re += point.weighed * share;
    }
    // A power of two needs only one algorithm. A planner adds all others to the build, and its last
    // bits depend on the processor.
    Radix4::new(length, FftDirection::Forward).process(&mut grid);
    let step = std::f64::consts::TAU / (length as f64 * spacing);
    let first =
        ((LEAST / step).ceil() as usize).max((std::f64::consts::TAU / range / step) as usize);
    let last = ((most / step) as usize).min(length / 2 - 1);
    if first + 8 >= last {
        return Vec::new();
    }
    let power: Vec<f64> = (first..=last)
        .map(|bin| {
            // Linear weights attenuate a wave by sinc^2 of half its phase per cell.
            let half = 0.5 * bin as f64 * step * spacing;
            let damped = (half.sin() / half).powi(2);
            grid[bin].norm_sqr() / (damped * damped)
        })
        .collect();
    let independent = range / std::f64::consts::TAU * (most - LEAST);
    let per_order = (power.len() as f64 / independent.max(1.0)).max(1.0);
    let floor = neighbourhood(&power, (NEIGHBOURS as f64 * per_order) as usize);
    let mut found: Vec<Peak> = Vec::new();
    let mut order: Vec<usize> = (0..power.len()).collect();
    let prominence = |i: usize| power[i] / floor[i].max(f64::MIN_POSITIVE);
    order.sort_by(|a, b| prominence(*b).total_cmp(&prominence(*a)));
    for index in order {
        let at = (first + index) as f64 * step;
        let apart = 2.0 * std::f64::consts::TAU / range;
        if found.iter().all(|peak| (peak.order - at).abs() > apart) {
            let prominence = prominence(index);
            let chance = -(independent.max(1.0) * (-(-prominence).exp()).ln_1p()).exp_m1();
            found.push(Peak {
                order: at,
                prominence,
                p_value: chance.clamp(0.0, 1.0),
                independent: independent.max(1.0),
            });
        }
        if found.len() == count {
            break;
        }
    }
    found
}

/// Returns the mean power of the noise around each order, from the median of the powers there.
///
/// The median of an exponential distribution is `ln 2` of its mean. A ripple hardly changes the
/// median.
fn neighbourhood(power: &[f64], half: usize) -> Vec<f64> {
    let half = half.clamp(8, power.len() / 2);
    // The medians are computed on a coarse grid, and each order uses that of its cell.
    let stride = (half / 4).max(1);
    let medians: Vec<f64> = (0..power.len().div_ceil(stride))
        .map(|cell| {
            let centre = cell * stride;
            let from = centre.saturating_sub(half);
            let to = (centre + half).min(power.len());
            let mut around = power[from..to].to_vec();
            let middle = around.len() / 2;
            let (_, median, _) = around.select_nth_unstable_by(middle, f64::total_cmp);
            *median / std::f64::consts::LN_2
        })
        .collect();
    (0..power.len()).map(|i| medians[i / stride]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    fn log(order: f64, amplitude: f64, seed: u64) -> Vec<Point> {
        let mut random = Pcg64::seed_from_u64(seed);
        (0..20_000)
            .map(|i| {
                let position = 30.0 * (i as f64 * 1e-3).sin() + 1e-3 * i as f64;
                let noise: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
                let wave = amplitude * (order * position + 0.7).sin();
                Point { position, weighed: wave + noise }
            })
            .collect()
    }

    #[test]
    fn peaks_with_ripple_returns_orders_from_1_to_250() {
        for order in [1.0, 3.7, 17.0, 64.25, 249.0] {
            let peak = peaks(&log(order, 0.3, 1), MOST_REVOLUTE, 3)[0];
            assert!((peak.order - order).abs() < 0.05, "{order}: {peak:?}");
            assert!(peak.p_value < 1e-6, "{peak:?}");
        }
    }

    #[test]
    fn peaks_with_noise_has_no_significant_order() {
        let alarms = (0..40)
            .filter(|seed| peaks(&log(1.0, 0.0, *seed), MOST_REVOLUTE, 1)[0].p_value < 0.05)
            .count();
        assert!(alarms <= 7, "{alarms} of 40 at 5 %");
    }

    #[test]
    fn peaks_without_motion_is_empty() {
        let still = vec![Point { position: 1.0, weighed: 0.5 }; 100];
        assert!(peaks(&still, MOST_REVOLUTE, 3).is_empty());
    }
}

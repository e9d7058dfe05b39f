//! The on-board watch: does the friction model still keep what its identification promised?
//!
//! An identified model comes with a promise: its residual is that of the test runs, `band_nm` (their
//! RMSE). On the joint the residual (measured torque less model) is watched while the joint slides. Of
//! many samples three numbers are kept, in bands, each an exponentially weighted mean over `memory_s`:
//!
//! ```text
//! offset = <r>            a sensor or a load that is not in the model
//! level  = <r sign(v)>    Coulomb level: a worn or swollen seal shows here first
//! square = <r^2>          anything else
//! ```
//!
//! Noise moves these means too. Samples closer than `independent_s` say the same thing, so that many
//! make a window, and its mean counts as *one* draw with the promised scatter (right where noise lasts
//! that long, on the safe side where it does not). A mean over windows then scatters by
//! `s = sqrt(k / (2 - k))`, `k = independent_s / memory_s`, and as a process with that memory it passes `L s`
//! to one side `L exp(-L^2 / 2) / (sqrt(2 pi) memory_s)` times a second. `L` is chosen so that all five
//! sides together (the square has one) alarm once in `false_alarm_h` hours of sliding, while the
//! residual is on the edge of what is tolerated: noise of the whole band, and `tolerance` bands of bias.
//! The square scatters skewly; its limit is put where a gamma distribution has the same tail.
//!
//! A bias of `d` bands that comes at once is flagged after `-memory_s ln(1 - limit / d)` at the latest (the
//! square may see it first), one that grows slowly `memory_s` after it has passed the limit.

use compensator_core::Real;
use compensator_core::parameters::{Bound, ParameterError, check_ranges};

compensator_core::named_fields! {
    /// What is watched for, as a person writes it.
    pub struct WatchParameters {
        /// RMS residual the identification promised, Nm.
        band_nm: f32 = 0.1, 1e-6..=1000.0, "a residual is measured against it";
        /// Bias that is no cause for an alarm, in bands, 0..=10. The promised RMS is not all noise: at one
        /// speed a model may be off by it all the time.
        tolerance: f32 = 1.0, 0.0..=10.0, "a bias in bands";
        /// Residuals this far apart are independent, s.
        independent_s: f32 = 0.01, 1e-4..=1.0, "from a few samples to a stroke";
        /// How far back the means reach, s of sliding.
        memory_s: f32 = 10.0, 2e-3..=1e4, "wear takes hours, a driver wants to know within seconds";
        /// Mean time between false alarms, h of sliding.
        false_alarm_h: f32 = 1000.0, 1e-5..=1e6, "up to a hundred years";
        /// Slower than this the joint does not slide and is not watched, rad/s.
        least_velocity_rad_s: f32 = 0.05, 0.0..=1e3, "a speed";
    }
    /// A band of 0.1 Nm, a false alarm in a thousand hours, three tenths of a Nm found within 5 s.
}

/// Fewest and most windows the means reach back.
const WINDOWS: [f32; 2] = [20.0, 1e4];

/// Fewest memories between two false alarms.
const LEAST_REST: f32 = 20.0;

/// A residual beyond so many bands counts as this: one wild sample shall not blind the means.
const WILD: f32 = 100.0;

impl WatchParameters {
    /// Checks every field, and those that depend on each other.
    ///
    /// # Errors
    /// Names the field refused, its value, the bound it broke and why there is one.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let refuse = |field, value: f32, bound, why| {
            Err(ParameterError { field, value: value.into(), bound, why })
        };
        check_ranges(&Self::NAMES, &self.to_array(), &Self::RANGES)?;
        let [fewest, most] = WINDOWS.map(|windows| windows * self.independent_s);
        let memory = self.memory_s;
        if memory < fewest {
            let why = "a mean of few windows has no steady scatter";
            return refuse("memory_s", memory, Bound::AtLeast(fewest.into()), why);
        }
        if memory > most {
            let why = "single precision cannot add smaller shares";
            return refuse("memory_s", memory, Bound::AtMost(most.into()), why);
        }
        let least_h = LEAST_REST * memory / 3600.0;
        if self.false_alarm_h < least_h {
            let why = "a mean that remembers this long cannot alarm more often";
            return refuse(
                "false_alarm_h",
                self.false_alarm_h,
                Bound::AtLeast(least_h.into()),
                why,
            );
        }
        Ok(())
    }

    /// Builds a watch for the time between samples, s. It knows of nothing yet.
    ///
    /// # Errors
    /// As [`WatchParameters::validate`]; and a period beyond `independent_s`, or so short that a window
    /// has more samples than single precision can add.
    pub fn build(&self, period_s: f32) -> Result<Watch, ParameterError> {
        self.validate()?;
        let refuse = |bound| {
            let why = "a window has from one to 65536 samples";
            Err(ParameterError { field: "period_s", value: period_s.into(), bound, why })
        };
        let samples = self.independent_s / period_s;
        if !period_s.is_finite() {
            return refuse(Bound::Finite);
        } else if !(period_s > 0.0 && samples <= 65536.5) {
            return refuse(Bound::AtLeast((self.independent_s / 65536.0).into()));
        } else if samples < 0.999 {
            return refuse(Bound::AtMost(self.independent_s.into()));
        }
        // Whole samples; a shorter or longer window is another `independent_s`, by at most a third.
        let samples = ((samples + 0.5) as u32).max(1);
        let share = f64::from(period_s) * f64::from(samples) / f64::from(self.memory_s);
        Ok(Watch::new(self, Limits::of(self, share), samples, share as f32))
    }
}

/// Where the means are out of the band, and where back in it; in bands.
#[derive(Clone, Copy, Debug)]
struct Limits {
    mean: f32,
    mean_back: f32,
    square: f32,
    square_back: f32,
}

fn square_root(x: f64) -> f64 {
    if x > 0.0 { Real::exp(0.5 * Real::ln(x)) } else { 0.0 }
}

/// `L` of the module's head: five one-sided crossings in `rest` memories.
fn deviations(rest: f64) -> f64 {
    const SIDES: f64 = 5.0;
    const ROOT_OF_TWO_PI: f64 = 2.506_628_274_631_000_5;
    let rate = |deviations: f64| {
        SIDES * deviations * Real::exp(-0.5 * deviations * deviations) / ROOT_OF_TWO_PI
    };
    // The rate falls from 1 on, and is below one in 1e24 memories at 11.
    let (mut low, mut high) = (1.0, 11.0);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if rate(middle) * rest > 1.0 { low = middle } else { high = middle }
    }
    high
}

impl Limits {
    fn of(parameters: &WatchParameters, share: f64) -> Self {
        let tolerance = f64::from(parameters.tolerance);
        let rest = f64::from(parameters.false_alarm_h) * 3600.0 / f64::from(parameters.memory_s);
        let deviations = deviations(rest);
        let scatter = share / (2.0 - share);
        let mean_scatter = square_root(scatter);
        let biased = tolerance * tolerance;
        let square_scatter = square_root((2.0 + 4.0 * biased) * scatter);
        // Skewness of the mean is 8/3 sqrt(share) for squares of a normal draw; a chi-squared variable of
        // `freedom` degrees has the same, and Wilson and Hilferty's cube gives its tail.
        let freedom = 1.125 / share;
        let ninth = 2.0 / (9.0 * freedom);
        let tail = |deviations: f64| {
            let root = 1.0 - ninth + deviations * square_root(ninth);
            (root * root * root - 1.0) * square_root(0.5 * freedom)
        };
        let half = 0.5 * deviations;
        Self {
            mean: (tolerance + deviations * mean_scatter) as f32,
            mean_back: (tolerance + half * mean_scatter) as f32,
            square: (1.0 + biased + tail(deviations) * square_scatter) as f32,
            square_back: (1.0 + biased + tail(half) * square_scatter) as f32,
        }
    }
}

/// The three means, in bands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Means {
    /// Mean residual.
    pub offset: f32,
    /// Mean residual in the direction of motion: more friction than the model has is positive.
    pub level: f32,
    /// Mean square residual; 1 is what was promised.
    pub square: f32,
}

/// The watch of one joint.
#[derive(Clone, Debug)]
pub struct Watch {
    band_nm: f32,
    per_band: f32,
    least_velocity_rad_s: f32,
    memory_s: f32,
    limits: Limits,
    /// Samples of a window, one over that, and a window's share of the means.
    samples: u32,
    per_sample: f32,
    share: f32,
    /// Windows until the means are worth a word.
    settling: u32,
    left: u32,
    window: Means,
    means: Means,
    in_band: bool,
    windows: u32,
    windows_out: u32,
    alarms: u32,
    unsound: u32,
    largest: f32,
}

const NOTHING: Means = Means { offset: 0.0, level: 0.0, square: 0.0 };

/// What is promised: where the means begin.
const PROMISED: Means = Means { offset: 0.0, level: 0.0, square: 1.0 };

impl Watch {
    fn new(parameters: &WatchParameters, limits: Limits, samples: u32, share: f32) -> Self {
        Self {
            band_nm: parameters.band_nm,
            per_band: 1.0 / parameters.band_nm,
            least_velocity_rad_s: parameters.least_velocity_rad_s,
            memory_s: parameters.memory_s,
            limits,
            samples,
            per_sample: 1.0 / samples as f32,
            share,
            settling: (1.0 / share) as u32,
            left: samples,
            window: NOTHING,
            means: PROMISED,
            in_band: true,
            windows: 0,
            windows_out: 0,
            alarms: 0,
            unsound: 0,
            largest: 0.0,
        }
    }

    /// Takes one sample: the residual torque, Nm, positive where more torque drives positive velocity
    /// than the model has, and the joint's velocity, rad/s. `valid` is false where the model is not meant
    /// to hold: inputs missing, bridge off, being swapped.
    #[inline]
    pub fn step(&mut self, residual_nm: f32, velocity_rad_s: f32, valid: bool) {
        // NaN is not faster than anything.
        let slides = velocity_rad_s.abs() > self.least_velocity_rad_s;
        if !(valid && slides) {
            return;
        }
        // Comparisons, where `max` and `clamp` are calls on this processor.
        let mut residual = residual_nm * self.per_band;
        let size = residual.abs();
        if size > self.largest {
            self.largest = if size < WILD { size } else { WILD };
        }
        // Not so of NaN.
        let sound = size <= WILD;
        if !sound {
            if size.is_nan() {
                self.unsound = self.unsound.saturating_add(1);
                return;
            }
            residual = if residual > 0.0 { WILD } else { -WILD };
        }
        self.window.offset += residual;
        self.window.level += if velocity_rad_s > 0.0 { residual } else { -residual };
        self.window.square += residual * residual;
        self.left -= 1;
        if self.left == 0 {
            self.close_window();
        }
    }

    #[inline(never)]
    fn close_window(&mut self) {
        let Self { window, means, limits, share, per_sample, .. } = self;
        for (mean, sum) in [
            (&mut means.offset, window.offset),
            (&mut means.level, window.level),
            (&mut means.square, window.square),
        ] {
            *mean += (sum * *per_sample - *mean) * *share;
        }
        let farthest = means.offset.abs().max(means.level.abs());
        let out = farthest > limits.mean || means.square > limits.square;
        let back = farthest < limits.mean_back && means.square < limits.square_back;
        if self.in_band && out {
            self.alarms = self.alarms.saturating_add(1);
        }
        self.in_band = if self.in_band { !out } else { back };
        self.windows = self.windows.saturating_add(1);
        self.windows_out = self.windows_out.saturating_add(u32::from(!self.in_band));
        self.window = NOTHING;
        self.left = self.samples;
    }

    /// Whether the residual is in the promised band; `None` until the joint has slid for `memory_s`, unless
    /// it is out before. Back in, it has to be nearer than where it went out.
    pub fn in_band(&self) -> Option<bool> {
        (self.windows >= self.settling || !self.in_band).then_some(self.in_band)
    }

    /// The means, in bands.
    pub fn means(&self) -> Means {
        self.means
    }

    /// Windows seen since the reset.
    pub fn windows(&self) -> u32 {
        self.windows
    }

    /// Those at whose end the residual was out of the band.
    pub fn windows_out_of_band(&self) -> u32 {
        self.windows_out
    }

    /// How often it went out.
    pub fn alarms(&self) -> u32 {
        self.alarms
    }

    /// Samples since the reset whose residual was not a number.
    pub fn unsound(&self) -> u32 {
        self.unsound
    }

    /// Largest single residual since the reset, in bands, at most 100.
    pub fn largest_in_bands(&self) -> f32 {
        self.largest
    }

    /// The promised band, Nm.
    pub fn band_nm(&self) -> f32 {
        self.band_nm
    }

    /// Change of the Coulomb level that is sure to be flagged some time, Nm.
    pub fn level_limit_nm(&self) -> f32 {
        self.limits.mean * self.band_nm
    }

    /// Time of sliding after which a Coulomb level that changes at once by so much, Nm, is flagged at the
    /// latest, s, give or take a tenth for noise; `None` where it may never be. The square may see it first.
    pub fn flagged_after_s(&self, change_nm: f32) -> Option<f32> {
        let left = 1.0 - f64::from(self.level_limit_nm() / change_nm.abs());
        (left > 0.0).then(|| -(Real::ln(left) as f32) * self.memory_s)
    }

    /// Forgets all that was seen, after a change of parameters or a repair.
    pub fn reset(&mut self) {
        self.left = self.samples;
        self.window = NOTHING;
        self.means = PROMISED;
        self.in_band = true;
        (self.windows, self.windows_out, self.alarms, self.unsound) = (0, 0, 0, 0);
        self.largest = 0.0;
    }
}

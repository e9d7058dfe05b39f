//! On-board monitoring of the friction model: is the residual still as small as in the identification?
//!
//! An identified model comes with a band `band_nm`, the RMSE of its test runs. On the joint, the residual
//! (measured torque less model) is monitored while the joint slides. Three exponentially weighted means over
//! `memory_s` are kept, in bands:
//!
//! ```text
//! offset = <r>            a sensor or a load that is not in the model
//! level  = <r sign(v)>    Coulomb level: a worn or swollen seal shows here first
//! square = <r^2>          anything else
//! ```
//!
//! Noise moves these means too. Samples closer than `independent_s` are correlated. They form a window, and the
//! mean of a window counts as *one* draw with the scatter of the band. This is exact if noise lasts as long as a
//! window, and conservative otherwise. A mean over windows then scatters by `s = sqrt(k / (2 - k))`, `k =
//! independent_s / memory_s`. As a process with that memory it crosses `L s` on one side `L exp(-L^2 / 2) /
//! (sqrt(2 pi) memory_s)` times per second. `L` is chosen so that all five sides together (the square has one)
//! raise one alarm in `false_alarm_h` hours of sliding, while the residual is at the limit of what is tolerated:
//! noise of the whole band, and `tolerance` bands of bias. The distribution of the square is skewed; its limit
//! is that of a gamma distribution with the same tail.
//!
//! A bias of `d` bands that arises at once is flagged after at most `-memory_s ln(1 - limit / d)`; the square
//! may flag it earlier. A bias that grows slowly is flagged `memory_s` after it has passed the limit.

use compensator_core::Real;
use compensator_core::parameters::{Bound, ParameterError, check_ranges, refuse};
use compensator_core::text;
use libm::sqrtf;

compensator_core::named_fields! {
    /// Parameters of the monitoring, as they are written.
    pub struct WatchParameters {
        /// RMS residual of the identification, Nm.
        band_nm: f32 = 0.1, 1e-6..=1000.0, "a residual is measured against it";
        /// Bias that raises no alarm, in bands, 0..=10. The RMS of the identification is not all noise: at a
        /// constant speed a model may be off by it permanently.
        tolerance: f32 = 1.0, 0.0..=10.0, "a bias in bands";
        /// Residuals this far apart are independent, s.
        independent_s: f32 = 0.01, 1e-4..=1.0, "from a few samples to a stroke";
        /// Memory of the means, s of sliding.
        memory_s: f32 = 10.0, 2e-3..=1e4, "wear takes hours, a driver wants to know within seconds";
        /// Mean time between false alarms, h of sliding.
        false_alarm_h: f32 = 1000.0, 1e-5..=1e6, "up to a hundred years";
        /// Minimum speed of sliding, rad/s; a slower joint is not monitored.
        least_velocity_rad_s: f32 = 0.05, 0.0..=1e3, "a speed";
    }
    /// Defaults: a band of 0.1 Nm, one false alarm in a thousand hours; 0.3 Nm are found within 5 s.
}

/// Range of the memory of the means, in windows.
const MEMORY_WINDOWS: [f32; 2] = [20.0, 1e4];

/// Minimum mean time between two false alarms, in memories.
const MIN_ALARM_INTERVAL_MEMORIES: f32 = 20.0;

/// Limit of a single residual, in bands, so that one outlier does not dominate the means.
const MAX_RESIDUAL_BANDS: f32 = 100.0;

impl WatchParameters {
    /// Checks every field, and the fields that depend on each other.
    ///
    /// # Errors
    /// Names the refused field, its value, the bound it broke and the reason for the bound.
    pub fn validate(&self) -> Result<(), ParameterError> {
        check_ranges(&Self::TEXTS, &self.to_array(), &Self::RANGES)?;
        let [min_s, max_s] = MEMORY_WINDOWS.map(|windows| windows * self.independent_s);
        let memory = self.memory_s;
        if memory < min_s {
            let why = text!("a mean of few windows has no steady scatter");
            return refuse(text!("memory_s"), memory, Bound::AtLeast(min_s), why);
        }
        if memory > max_s {
            let why = text!("single precision cannot add smaller shares");
            return refuse(text!("memory_s"), memory, Bound::AtMost(max_s), why);
        }
        let min_h = MIN_ALARM_INTERVAL_MEMORIES * memory / 3600.0;
        if self.false_alarm_h < min_h {
            let why = text!("a mean that remembers this long cannot alarm more often");
            return refuse(text!("false_alarm_h"), self.false_alarm_h, Bound::AtLeast(min_h), why);
        }
        Ok(())
    }

    /// Builds a monitor for a sample period, s. Its means are at their start values.
    ///
    /// # Errors
    /// As [`WatchParameters::validate`]; also if the period exceeds `independent_s`, or is so short that a
    /// window has more samples than single precision can add.
    pub fn build(&self, period_s: f32) -> Result<ResidualWatch, ParameterError> {
        self.validate()?;
        let refuse = |bound| {
            let why = text!("a window has from one to 65536 samples");
            Err(ParameterError { field: text!("period_s"), value: period_s, bound, why })
        };
        let samples = self.independent_s / period_s;
        if !period_s.is_finite() {
            return refuse(Bound::Finite);
        } else if !(period_s > 0.0 && samples <= 65536.5) {
            return refuse(Bound::AtLeast(self.independent_s / 65536.0));
        } else if samples < 0.999 {
            return refuse(Bound::AtMost(self.independent_s));
        }
        // The number of samples is rounded: this changes `independent_s` by at most a third.
        let samples = ((samples + 0.5) as u32).max(1);
        let share = period_s * samples as f32 / self.memory_s;
        Ok(ResidualWatch::new(self, BandLimits::of(self, share), samples, share))
    }
}

/// Limits of the means, and the lower limits to return into the band; in bands.
#[derive(Clone, Copy, Debug)]
struct BandLimits {
    mean: f32,
    mean_back: f32,
    square: f32,
    square_back: f32,
}

/// Returns `L` of the module documentation: five one-sided crossings in `rest` memories.
fn deviations(rest: f32) -> f32 {
    const SIDES: f32 = 5.0;
    const ROOT_OF_TWO_PI: f32 = 2.506_628_3;
    let rate = |deviations: f32| {
        SIDES * deviations * Real::exp(-0.5 * deviations * deviations) / ROOT_OF_TWO_PI
    };
    // The rate falls from 1 on, and is below one in 1e24 memories at 11.
    let (mut low, mut high) = (1.0, 11.0);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if rate(middle) * rest > 1.0 { low = middle } else { high = middle }
    }
    high
}

impl BandLimits {
    fn of(parameters: &WatchParameters, share: f32) -> Self {
        let tolerance = parameters.tolerance;
        let rest = parameters.false_alarm_h * 3600.0 / parameters.memory_s;
        let deviations = deviations(rest);
        let scatter = share / (2.0 - share);
        let mean_scatter = sqrtf(scatter);
        let biased = tolerance * tolerance;
        let square_scatter = sqrtf((2.0 + 4.0 * biased) * scatter);
        // For squares of a normal draw, the skewness of the mean is 8/3 sqrt(share). A chi-squared variable of
        // `freedom` degrees has the same skewness, and the Wilson-Hilferty cube gives its tail.
        let freedom = 1.125 / share;
        let ninth = 2.0 / (9.0 * freedom);
        let tail = |deviations: f32| {
            // The cube less one, expanded: a difference to 1 would lose digits.
            let beyond = deviations * sqrtf(ninth) - ninth;
            beyond * (3.0 + beyond * (3.0 + beyond)) * sqrtf(0.5 * freedom)
        };
        let half = 0.5 * deviations;
        Self {
            mean: tolerance + deviations * mean_scatter,
            mean_back: tolerance + half * mean_scatter,
            square: 1.0 + biased + tail(deviations) * square_scatter,
            square_back: 1.0 + biased + tail(half) * square_scatter,
        }
    }
}

/// The three means of the residual, in bands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResidualMeans {
    /// Mean residual.
    pub offset: f32,
    /// Mean residual in the direction of motion; positive if there is more friction than in the model.
    pub level: f32,
    /// Mean square residual; 1 in the identification.
    pub square: f32,
}

/// What a watch counted since its reset.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WatchCounters {
    /// Windows.
    pub windows: u32,
    /// Windows at whose end the residual was out of the band.
    pub windows_out_of_band: u32,
    /// How often the residual left the band.
    pub alarms: u32,
    /// Largest single residual, in bands, at most 100.
    pub largest_in_bands: f32,
}

/// Monitoring of the residual of one joint.
#[derive(Clone, Debug)]
pub struct ResidualWatch {
    band_nm: f32,
    per_band: f32,
    least_velocity_rad_s: f32,
    limits: BandLimits,
    /// Samples per window, its reciprocal, and the weight of a window in the means.
    samples: u32,
    per_sample: f32,
    share: f32,
    /// Windows until the means have settled.
    settling: u32,
    left: u32,
    window: ResidualMeans,
    means: ResidualMeans,
    in_band: bool,
    counters: WatchCounters,
}

const ZERO_MEANS: ResidualMeans = ResidualMeans { offset: 0.0, level: 0.0, square: 0.0 };

/// Start values of the means: those of the identification.
const INITIAL_MEANS: ResidualMeans = ResidualMeans { offset: 0.0, level: 0.0, square: 1.0 };

impl ResidualWatch {
    fn new(parameters: &WatchParameters, limits: BandLimits, samples: u32, share: f32) -> Self {
        Self {
            band_nm: parameters.band_nm,
            per_band: 1.0 / parameters.band_nm,
            least_velocity_rad_s: parameters.least_velocity_rad_s,
            limits,
            samples,
            per_sample: 1.0 / samples as f32,
            share,
            settling: (1.0 / share) as u32,
            left: samples,
            window: ZERO_MEANS,
            means: INITIAL_MEANS,
            in_band: true,
            counters: WatchCounters::default(),
        }
    }

    /// Processes one sample: the residual torque, Nm, positive if the torque that drives positive velocity
    /// exceeds the model, and the joint velocity, rad/s. `valid` must be false if the model does not apply:
    /// inputs missing, bridge off, or a swap. A residual that is NaN is not counted: the supervisor reports its cause.
    // Not inlined: one copy takes less flash than one for each caller.
    #[inline(never)]
    pub fn step(&mut self, residual_nm: f32, velocity_rad_s: f32, valid: bool) {
        // False for NaN.
        let slides = velocity_rad_s.abs() > self.least_velocity_rad_s;
        if !(valid && slides) || residual_nm.is_nan() {
            return;
        }
        // Comparisons are used because `max` and `clamp` are function calls on this processor.
        let mut residual = residual_nm * self.per_band;
        let size = residual.abs();
        if size > self.counters.largest_in_bands {
            self.counters.largest_in_bands =
                if size < MAX_RESIDUAL_BANDS { size } else { MAX_RESIDUAL_BANDS };
        }
        if size > MAX_RESIDUAL_BANDS {
            residual = if residual > 0.0 { MAX_RESIDUAL_BANDS } else { -MAX_RESIDUAL_BANDS };
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
        let Self { window, means, limits, share, per_sample, counters, .. } = self;
        for (mean, sum) in [
            (&mut means.offset, window.offset),
            (&mut means.level, window.level),
            (&mut means.square, window.square),
        ] {
            *mean += (sum * *per_sample - *mean) * *share;
        }
        let largest_mean = means.offset.abs().max(means.level.abs());
        let is_out = largest_mean > limits.mean || means.square > limits.square;
        let is_back = largest_mean < limits.mean_back && means.square < limits.square_back;
        if self.in_band && is_out {
            counters.alarms = counters.alarms.saturating_add(1);
        }
        self.in_band = if self.in_band { !is_out } else { is_back };
        counters.windows = counters.windows.saturating_add(1);
        counters.windows_out_of_band =
            counters.windows_out_of_band.saturating_add(u32::from(!self.in_band));
        self.window = ZERO_MEANS;
        self.left = self.samples;
    }

    /// Returns whether the residual is in the band; `None` until the joint has slid for `memory_s`, unless the
    /// residual leaves the band earlier. The limit to return into the band is lower than the limit to leave it.
    #[inline(never)]
    pub fn in_band(&self) -> Option<bool> {
        (self.counters.windows >= self.settling || !self.in_band).then_some(self.in_band)
    }

    /// Returns the means, in bands.
    pub fn means(&self) -> ResidualMeans {
        self.means
    }

    /// Returns what was counted since the reset.
    pub fn counters(&self) -> WatchCounters {
        self.counters
    }

    /// Returns the smallest change of the Coulomb level that is certain to be flagged, Nm.
    pub fn level_limit_nm(&self) -> f32 {
        self.limits.mean * self.band_nm
    }

    /// Resets all means and counters, after a change of parameters or a repair.
    pub fn reset(&mut self) {
        self.left = self.samples;
        self.window = ZERO_MEANS;
        self.means = INITIAL_MEANS;
        self.in_band = true;
        self.counters = WatchCounters::default();
    }
}

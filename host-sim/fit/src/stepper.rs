//! Stepping a model along a track, with one or more steps of the core per row.

use super::delayed::Motion;
use super::initial_heat::initial_heat;
use super::track::Track;
use compensator_core::{FrictionModel, LawKind, ModelState, Parameters, Quantity, Real, Sample};
use std::rc::Rc;

/// The fields of a sample that a stepper writes in each row.
///
/// Writing a dual number copies all its derivatives, and a sample has a dozen fields. A stepper therefore writes only
/// the fields that vary along the track and that the model may read.
pub enum Varying {
    /// The velocity: the model reads no other field.
    Velocity,
    /// All fields, which for plain numbers is faster than the checks.
    All,
    /// Some fields.
    Some(VaryingFields),
}

/// The fields of a sample that vary along a track.
pub struct VaryingFields {
    quantities: Vec<Quantity>,
    has_position_weight: bool,
    has_radial_force_change: bool,
    has_lookup_weight: bool,
}

impl Varying {
    /// Returns the fields for a simulation in the number type `T`.
    pub fn of<T: Real>(parameters: &Parameters<T>, track: &Track) -> Self {
        if parameters.terms.is_empty() && parameters.law != LawKind::ImprovedLugre {
            return Self::Velocity;
        }
        if size_of::<T>() <= size_of::<f64>() {
            return Self::All;
        }
        let first = &track.samples[0];
        let varies = |of: &dyn Fn(&Sample<f64>) -> Option<f64>| {
            let at_first = of(first);
            track.samples.iter().any(|sample| of(sample) != at_first)
        };
        let quantities = Quantity::ALL.iter().copied();
        Self::Some(VaryingFields {
            quantities: quantities
                .filter(|quantity| varies(&|sample| quantity.value_in(sample)))
                .collect(),
            has_position_weight: varies(&|sample| Some(sample.position_weight)),
            has_radial_force_change: varies(&|sample| Some(sample.radial_force_change_n)),
            has_lookup_weight: varies(&|sample| Some(sample.lookup_weight)),
        })
    }
}

/// One row of a track, as a stepper needs it.
pub struct TrackRow<'a, T> {
    /// The track.
    pub track: &'a Track,
    /// Index of the row in the track.
    pub index: usize,
    /// Sample of the row before; the row's own for the first row.
    pub before: &'a Sample<f64>,
    /// Sample of the row.
    pub sample: &'a Sample<f64>,
    /// Motion of both rows for a model with a channel delay; `None` to use the samples' own.
    pub delayed: Option<[Motion<T>; 2]>,
    /// Time since the row before, in periods of the track.
    pub ratio: f64,
}

/// Returns the rows of a track, with this delayed motion, if there is any.
pub fn track_rows<'a, T: Real>(
    track: &'a Track,
    delayed: Option<&'a [Motion<T>]>,
) -> impl Iterator<Item = TrackRow<'a, T>> {
    let before = track.samples.iter().take(1).chain(&track.samples);
    before.zip(&track.samples).enumerate().map(move |(index, (before, sample))| TrackRow {
        track,
        index,
        before,
        sample,
        delayed: delayed.map(|v| [v[index.saturating_sub(1)], v[index]]),
        ratio: track.period_ratio_of(index),
    })
}

/// Model and state of a simulation along a track.
pub struct Stepper<T: Real> {
    /// The model for the track's own sample period.
    pub model: FrictionModel<T>,
    /// The model's state.
    pub state: ModelState<T>,
    /// The model for the current row's period, if periods vary.
    rescaled: FrictionModel<T>,
    ratio: f64,
    substeps: usize,
    varying: Rc<Varying>,
    input: Sample<T>,
}

impl<T: Real<Setting = T>> Stepper<T> {
    /// Places a model at the start of a track. `held` is the bristle torque there, Nm, or `None` if the joint slides.
    pub fn new(
        parameters: &Parameters<T>,
        track: &Track,
        varying: impl Into<Rc<Varying>>,
        held: Option<T>,
        substeps: usize,
    ) -> Self {
        let period = T::from_f64(track.period_s / substeps as f64);
        let model: FrictionModel<T> = parameters.build_unchecked(period);
        let held = held.unwrap_or_else(|| sliding_bristle_torque(&model, track));
        let state = ModelState::holding(held).with_heat(initial_heat(parameters, track));
        let mut input = track.samples[0].map(T::from_f64);
        // The force change of a sample is divided among its sub-steps.
        input.radial_force_change_n =
            T::from_f64(track.samples[0].radial_force_change_n / substeps as f64);
        Self {
            rescaled: model.clone(),
            model,
            ratio: 1.0,
            state,
            substeps,
            varying: varying.into(),
            input,
        }
    }

    /// Replaces the parameters of the same model and keeps its state.
    pub fn replace_parameters(&mut self, parameters: &Parameters<T>, track: &Track) {
        self.model = parameters.build_unchecked(T::from_f64(track.period_s / self.substeps as f64));
        self.rescaled = self.model.clone();
        self.rescaled.rescale_period(&self.model, T::from_f64(self.ratio));
    }

    /// Simulates a row and returns the torque at its end, Nm.
    pub fn step(&mut self, row: &TrackRow<T>) -> T {
        let TrackRow { track, index, before, sample, delayed, ratio } = *row;
        if ratio != self.ratio {
            self.ratio = ratio;
            self.rescaled.rescale_period(&self.model, T::from_f64(ratio));
        }
        let mut torque = T::zero();
        let curve = (self.substeps > 1 && track.velocity_is_exact).then(|| curvature(track, index));
        for step in 1..=self.substeps {
            self.interpolate_input(before, sample, step);
            let share = step as f64 / self.substeps as f64;
            if let Some([from, to]) = delayed {
                let motion = from.towards(&to, T::from_f64(share));
                self.input.velocity_rad_s = motion.velocity_rad_s;
                self.input.acceleration_rad_s2 = motion.acceleration_rad_s2;
                self.input.position_rad = motion.position_rad;
            } else if let Some([at_start, at_end]) = curve {
                let rest = 1.0 - share;
                let above_line = share * rest * (at_start * rest - at_end * share);
                let on_line = self.input.velocity_rad_s;
                self.input.velocity_rad_s = on_line + T::from_f64(above_line);
            }
            torque = self.rescaled.step(&mut self.state, &self.input);
        }
        torque
    }

    /// Sets the input to the sample at the end of this sub-step, interpolated between `before` and `now`.
    #[inline(always)]
    fn interpolate_input(&mut self, before: &Sample<f64>, now: &Sample<f64>, step: usize) {
        let steps = self.substeps as f64;
        let share = step as f64 / steps;
        let last = step == self.substeps;
        let on_line = |from: f64, to: f64| if last { to } else { from + (to - from) * share };
        match &*self.varying {
            Varying::Velocity => {
                let velocity = on_line(before.velocity_rad_s, now.velocity_rad_s);
                self.input.velocity_rad_s = T::from_f64(velocity);
            }
            Varying::All => {
                self.input = Sample {
                    position_weight: T::from_f64(now.position_weight),
                    radial_force_change_n: T::from_f64(now.radial_force_change_n / steps),
                    lookup_weight: T::from_f64(now.lookup_weight),
                    ..before.zip(now, |from, to| T::from_f64(on_line(from, to)))
                };
            }
            Varying::Some(fields) => {
                for quantity in &fields.quantities {
                    let ends = quantity.value_in(before).zip(quantity.value_in(now));
                    if let Some((from, to)) = ends {
                        quantity.set_in_sample(&mut self.input, T::from_f64(on_line(from, to)));
                    }
                }
                if fields.has_position_weight {
                    self.input.position_weight = T::from_f64(now.position_weight);
                }
                if fields.has_radial_force_change {
                    let change = now.radial_force_change_n / steps;
                    self.input.radial_force_change_n = T::from_f64(change);
                }
                if fields.has_lookup_weight {
                    self.input.lookup_weight = T::from_f64(now.lookup_weight);
                }
            }
        }
    }
}

/// Returns how much the slope of the velocity at both ends of a row exceeds that of the line between them, rad/s per row.
///
/// A line cuts the corners of a motion: at 200 Hz and 5 Hz its displacement in a row is wrong by some 0.2 %, which a fit ascribes
/// to the bristle's damping. Each slope is that of the parabola through three samples. It is limited so that the velocity stays
/// between those of the samples (Fritsch and Carlson 1980): a joint at rest does not move before it starts.
fn curvature(track: &Track, index: usize) -> [f64; 2] {
    let velocity = |row: usize| track.samples[row].velocity_rad_s;
    let ratio = |row: usize| track.period_ratio_of(row);
    // Change of the velocity up to a row, per median period.
    let slope = |row: usize| (velocity(row) - velocity(row - 1)) / ratio(row);
    if index == 0 {
        return [0.0; 2];
    }
    let here = slope(index);
    let at = |row: usize| {
        if row == 0 || row + 1 == track.len() {
            return 0.0;
        }
        let (before, after) = (slope(row), slope(row + 1));
        if before * after <= 0.0 {
            return -here;
        }
        let (short, long) = (ratio(row), ratio(row + 1));
        let parabola = (before * long + after * short) / (short + long);
        let most = 3.0 * before.abs().min(after.abs());
        parabola.clamp(-most, most) - here
    };
    [at(index - 1), at(index)].map(|above| above * ratio(index))
}

/// Returns the bristle torque of a joint that slides at the start of the track: the Coulomb level, Nm.
fn sliding_bristle_torque<T: Real<Setting = T>>(model: &FrictionModel<T>, track: &Track) -> T {
    let coulomb = model.law().sliding_torque();
    coulomb.copy_sign(T::from_f64(track.samples[0].velocity_rad_s))
}

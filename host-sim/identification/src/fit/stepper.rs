//! A model on its way along a track, some steps of the core to a row.

use super::track::Track;
use super::warmth::heat;
use compensator_core::{Model, Parameters, Quantity, Real, Sample, State};

/// The numbers of a sample that change along a track.
///
/// A dual number carries all its derivatives wherever it is written, and a sample has a dozen numbers: only
/// what changes is written anew.
pub struct Varying {
    quantities: Vec<Quantity>,
    position_trust: bool,
    radial_force_change: bool,
    lookup_trust: bool,
    /// Plain numbers: writing all of them is quicker than asking.
    all: bool,
}

impl Varying {
    /// Everything.
    pub const ALL: Self = Self {
        quantities: Vec::new(),
        position_trust: true,
        radial_force_change: true,
        lookup_trust: true,
        all: true,
    };

    /// What changes along a track that is stepped in the number `T`.
    pub fn of<T>(track: &Track) -> Self {
        let all = size_of::<T>() <= size_of::<f64>();
        let first = &track.samples[0];
        let varies = |of: &dyn Fn(&Sample<f64>) -> Option<f64>| {
            let at_first = of(first);
            !all && track.samples.iter().any(|sample| of(sample) != at_first)
        };
        let quantities = Quantity::ALL.iter().copied();
        Self {
            quantities: quantities
                .filter(|quantity| varies(&|sample| quantity.of_sample(sample)))
                .collect(),
            position_trust: varies(&|sample| Some(sample.position_trust)),
            radial_force_change: varies(&|sample| Some(sample.radial_force_change_n)),
            lookup_trust: varies(&|sample| Some(sample.lookup_trust)),
            all,
        }
    }
}

/// A model on its way along a track.
pub struct Stepper<'a, T: Real> {
    /// The model for the track's own sample period.
    pub model: Model<T>,
    /// What it remembers.
    pub state: State<T>,
    /// The model for the sample period at hand, where periods vary.
    rescaled: Model<T>,
    ratio: f64,
    substeps: usize,
    varying: &'a Varying,
    input: Sample<T>,
}

impl<'a, T: Real<Setting = T>> Stepper<'a, T> {
    /// A model at the start of a track. `held` is the bristle torque there, Nm, or `None` where the joint
    /// slides.
    pub fn new(
        parameters: &Parameters<T>,
        track: &Track,
        varying: &'a Varying,
        held: Option<T>,
        substeps: usize,
    ) -> Self {
        let period = T::from_f64(track.period_s / substeps as f64);
        let model: Model<T> = parameters.build_unchecked(period);
        let held = held.unwrap_or_else(|| sliding(&model, track));
        let state = State::holding(held).warmed(heat(parameters, track));
        let mut input = track.samples[0].map(T::from_f64);
        // A change within the sample is shared among its steps.
        input.radial_force_change_n =
            T::from_f64(track.samples[0].radial_force_change_n / substeps as f64);
        Self { rescaled: model.clone(), model, ratio: 1.0, state, substeps, varying, input }
    }

    /// Steps from the row before to this one, `ratio` sample periods later, the inputs following a straight
    /// line; returns the torque at its end, Nm. `delayed` are the velocities of both rows, where they are
    /// not the samples' own.
    pub fn row(
        &mut self,
        before: &Sample<f64>,
        sample: &Sample<f64>,
        delayed: Option<[T; 2]>,
        ratio: f64,
    ) -> T {
        if ratio != self.ratio {
            self.ratio = ratio;
            self.rescaled.rescale_period(&self.model, T::from_f64(ratio));
        }
        let mut torque = T::zero();
        for step in 1..=self.substeps {
            self.between(before, sample, step);
            if let Some([from, to]) = delayed {
                let share = T::from_f64(step as f64 / self.substeps as f64);
                self.input.velocity_rad_s = from + (to - from) * share;
            }
            torque = self.rescaled.step(&mut self.state, &self.input);
        }
        torque
    }

    /// Sets the input to the sample that lies at the end of this step, on the way from `before` to `now`.
    #[inline(always)]
    fn between(&mut self, before: &Sample<f64>, now: &Sample<f64>, step: usize) {
        let steps = self.substeps as f64;
        let share = step as f64 / steps;
        let last = step == self.substeps;
        let on_line = |from: f64, to: f64| if last { to } else { from + (to - from) * share };
        if self.varying.all {
            self.input = Sample {
                position_trust: T::from_f64(now.position_trust),
                radial_force_change_n: T::from_f64(now.radial_force_change_n / steps),
                lookup_trust: T::from_f64(now.lookup_trust),
                ..before.zip(now, |from, to| T::from_f64(on_line(from, to)))
            };
            return;
        }
        for quantity in &self.varying.quantities {
            if let (Some(from), Some(to)) = (quantity.of_sample(before), quantity.of_sample(now)) {
                quantity.set_in_sample(&mut self.input, T::from_f64(on_line(from, to)));
            }
        }
        if self.varying.position_trust {
            self.input.position_trust = T::from_f64(now.position_trust);
        }
        if self.varying.radial_force_change {
            self.input.radial_force_change_n = T::from_f64(now.radial_force_change_n / steps);
        }
        if self.varying.lookup_trust {
            self.input.lookup_trust = T::from_f64(now.lookup_trust);
        }
    }
}

/// The bristle torque of a joint that slides where the track begins: the Coulomb level.
fn sliding<T: Real<Setting = T>>(model: &Model<T>, track: &Track) -> T {
    let coulomb = model.law().sliding_torque();
    coulomb.copy_sign(T::from_f64(track.samples[0].velocity_rad_s))
}

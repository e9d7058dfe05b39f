//! The same four models on torques: each joint by itself, as `compare` fits them, and with the printed start and bounds.
//!
//! Where a joint's friction torque is measured no arm needs to be simulated: the model is stepped along the measured
//! motion. That is how every other fit of this program is made, and the only way open for a measured machine whose
//! rigid body nobody publishes.

use super::bounded::{Normal, Search, Sums, search};
use super::fit::{PRINTED_BOUNDS, PRINTED_START};
use compensator_core::TermKind;
use compensator_core::{LawKind, Parameters};
use friction_identification::data::Dataset;
use friction_identification::dual::Dual;
use friction_identification::fit::simulate::simulate;
use friction_identification::fit::track::{campaign_start, tracks_since};
use friction_identification::fit::{
    FitOptions, Metrics, Outcome, Resolution, Rows, Track, identify, predict,
};
use friction_identification::log_check::{Correct, check};
use friction_identification::spec::Spec;

/// A joint's log in two: what is fitted on, and what is judged by.
pub struct Joint {
    train: Vec<Track>,
    test: Vec<Track>,
    rigid_body: Vec<TermKind>,
}

/// A model on a joint's torques.
pub struct OnTorques {
    /// Errors on the rows of the fit, Nm.
    pub train: Metrics,
    /// Errors on a run no fit has seen, Nm.
    pub test: Metrics,
    /// What was found.
    pub parameters: Parameters<f64>,
}

/// Most values a law has that is fitted with the printed start and bounds.
const MOST_VALUES: usize = 6;

impl Joint {
    /// A log of which the named runs are held out.
    ///
    /// # Errors
    /// One line, where either side is left without rows.
    pub fn new(data: Dataset, held_out: &[&str], rigid_body: &[TermKind]) -> Result<Self, String> {
        let data = check(data, Correct::default()).data;
        let start = campaign_start(&data);
        let part = |wanted: bool| {
            let mut part = data.clone();
            part.runs.retain(|run| held_out.contains(&run.name.as_str()) == wanted);
            tracks_since(&part, None, start)
        };
        let (train, test) = (part(false), part(true));
        if train.is_empty() || test.is_empty() {
            return Err("no unbroken stretch of two rows or more to fit on and to judge by".into());
        }
        Ok(Self { train, test, rigid_body: rigid_body.to_vec() })
    }

    fn train_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.train, decimate: 1 }
    }

    fn test_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.test, decimate: 1 }
    }

    /// As `compare` does it: scaled, from several starts.
    ///
    /// # Errors
    /// One line, where the model carries too many terms.
    pub fn properly(&self, law: LawKind) -> Result<Outcome, String> {
        let spec = Spec::law(law).on(&self.rigid_body);
        let base = spec.parameters().map_err(|error| error.to_string())?;
        let options = FitOptions { passive: true, ..FitOptions::default() };
        identify(&spec, &base, self.train_rows(), self.test_rows(), &options)
            .map_err(|error| error.to_string())
    }

    /// With the printed start and bounds for each value of the law; what is of the rigid body stays as a proper
    /// fit of the linear law found it, for the paper knew its arm's.
    ///
    /// # Errors
    /// As [`Joint::properly`].
    pub fn as_printed(
        &self,
        law: LawKind,
        rigid_body: &Parameters<f64>,
        how: Search,
    ) -> Result<OnTorques, String> {
        let spec = Spec::law(law).on(&self.rigid_body);
        let mut base = spec.parameters().map_err(|error| error.to_string())?;
        let own = law.parameters();
        let known: Vec<_> = base.active().filter(|id| !own.contains(id)).collect();
        known.into_iter().for_each(|id| base.set(id, rigid_body.get(id)));
        base.choices.printed_extended = true;
        base.envelope.velocity_max_rad_s = f32::MAX;
        let at = |point: &[f64]| self.normal(law, &base, point);
        let start = vec![PRINTED_START; own.len()];
        let end = search(&start, &vec![PRINTED_BOUNDS; own.len()], how, at);
        own.iter().zip(&end.point).for_each(|(id, value)| base.set(*id, *value));
        let metrics = |rows: Rows| predict(&base, rows, Resolution::PLAIN).metrics;
        let (train, test) = (metrics(self.train_rows()), metrics(self.test_rows()));
        Ok(OnTorques { train, test, parameters: base })
    }

    fn normal(&self, law: LawKind, base: &Parameters<f64>, point: &[f64]) -> Normal {
        let mut parameters = base.convert::<Dual<MOST_VALUES>>();
        for (index, (id, value)) in law.parameters().iter().zip(point).enumerate() {
            parameters.set(*id, Dual::parameter(*value, index));
        }
        let mut sums = Sums::<MOST_VALUES>::new();
        for track in &self.train {
            // The bristles begin unbent, as nothing is told of them.
            let held = Some(Dual::default());
            simulate(&parameters, track, held, Resolution::PLAIN, |row, torque, _| {
                sums.push(torque.value - track.torque[row], &torque.gradient, track.weight(row));
                true
            });
        }
        sums.normal(point.len(), false)
    }
}

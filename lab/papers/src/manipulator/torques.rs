//! The four models fitted to the torques of one joint, as `compare` does and by the paper's protocol.
//!
//! With a measured friction torque no arm has to be simulated: the model runs along the measured motion. All other fits of
//! this program work so. For a measured machine without a published rigid-body model it is the only way.

use super::bounded::{NormalEquations, NormalSums, SearchOptions, search};
use super::fit::{PRINTED_BOUNDS, PRINTED_START};
use crate::PaperError;
use compensator_core::TermKind;
use compensator_core::{LawKind, Parameters};
use friction_fit::spec::Spec;
use friction_fit::{
    Dual, FitOptions, Metrics, Outcome, Resolution, Rows, Track, campaign_start, identify, predict,
    simulate, tracks_since,
};
use joint_log::Dataset;
use joint_log::log_check::{Corrections, check};

/// The log of a joint, split into fitted and held-out rows.
pub struct Joint {
    train: Vec<Track>,
    test: Vec<Track>,
    rigid_body: Vec<TermKind>,
}

/// A model fitted to a joint's torques.
pub struct TorqueFit {
    /// Errors on the fitted rows, Nm.
    pub train: Metrics,
    /// Errors on the held-out rows, Nm.
    pub test: Metrics,
    /// Fitted parameters.
    pub parameters: Parameters<f64>,
}

/// Maximum number of values of a law in the paper's protocol.
const MAX_VALUES: usize = 6;

impl Joint {
    /// Splits a log by the names of the held-out runs.
    ///
    /// # Errors
    /// Returns one line if either part has no rows.
    pub fn new(
        data: Dataset,
        held_out: &[&str],
        rigid_body: &[TermKind],
    ) -> Result<Self, PaperError> {
        let data = check(data, Corrections::default()).data;
        let start = campaign_start(&data);
        let part = |wanted: bool| {
            let mut part = data.clone();
            part.runs.retain(|run| held_out.contains(&run.name.as_str()) == wanted);
            tracks_since(&part, None, start)
        };
        let (train, test) = (part(false), part(true));
        if train.is_empty() || test.is_empty() {
            return Err(PaperError::NoRows);
        }
        Ok(Self { train, test, rigid_body: rigid_body.to_vec() })
    }

    fn train_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.train, decimate: 1 }
    }

    fn test_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.test, decimate: 1 }
    }

    /// Fits as `compare` does: scaled, from several starts.
    ///
    /// # Errors
    /// Returns one line if the model has too many terms.
    pub fn fit_properly(&self, law: LawKind) -> Result<Outcome, PaperError> {
        let spec = Spec::law(law).on(&self.rigid_body);
        let base = spec.parameters().map_err(PaperError::source)?;
        let options = FitOptions { passive: true, ..FitOptions::default() };
        Ok(identify(&spec, &base, self.train_rows(), self.test_rows(), &options))
    }

    /// Fits by the paper's protocol. The rigid-body terms keep the values of a proper fit of the linear law, because the paper
    /// knew its arm's.
    ///
    /// # Errors
    /// As [`Joint::properly`].
    pub fn fit_as_printed(
        &self,
        law: LawKind,
        rigid_body: &Parameters<f64>,
        how: SearchOptions,
    ) -> Result<TorqueFit, PaperError> {
        let spec = Spec::law(law).on(&self.rigid_body);
        let mut base = spec.parameters().map_err(PaperError::source)?;
        let fitted = law.parameters();
        let known: Vec<_> = base.active().filter(|id| !fitted.contains(id)).collect();
        known.into_iter().for_each(|id| base.set(id, rigid_body.get(id)));
        base.choices.printed_extended = true;
        base.envelope.velocity_max_rad_s = f32::MAX;
        let at = |point: &[f64]| self.normal(law, &base, point);
        let start = vec![PRINTED_START; fitted.len()];
        let end = search(&start, &vec![PRINTED_BOUNDS; fitted.len()], how, at);
        fitted.iter().zip(&end.point).for_each(|(id, value)| base.set(*id, *value));
        let metrics = |rows: Rows| predict(&base, rows, Resolution::PLAIN).metrics;
        let (train, test) = (metrics(self.train_rows()), metrics(self.test_rows()));
        Ok(TorqueFit { train, test, parameters: base })
    }

    fn normal(&self, law: LawKind, base: &Parameters<f64>, point: &[f64]) -> NormalEquations {
        let mut parameters = base.convert::<Dual<MAX_VALUES>>();
        for (index, (id, value)) in law.parameters().iter().zip(point).enumerate() {
            parameters.set(*id, Dual::parameter(*value, index));
        }
        let mut sums = NormalSums::<MAX_VALUES>::new();
        for track in &self.train {
            // The initial deflection of the bristle is unknown and set to zero.
            let held = Some(Dual::default());
            simulate(&parameters, track, held, Resolution::PLAIN, |row, torque, _| {
                sums.push(torque.value - track.torque[row], &torque.gradient, track.weight(row));
                true
            });
        }
        sums.normal(point.len(), false)
    }
}

//! From recordings to a model: the diagnosis, the two hypotheses that are still open, and the set for the drive.

use crate::recording::{Recording, table};
use compensator_core::parameters::Envelope;
use compensator_core::{LawKind, ParameterId, Parameters, TermKind};
use firmware::parameter_set::ParameterSet;
use friction_diagnose::prepare::{Error, PrepareOptions, Prepared, Source, prepare};
use friction_diagnose::{Diagnosis, DiagnosisOptions, diagnose};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Outcome, Rows, identify_robustly, predict};
use friction_results::stochastic::StochasticExtension;
use joint_log::SplitRule;
use joint_log::log_check::LogFindingKind;

/// What the recordings show.
#[derive(Debug)]
pub struct Learnt {
    /// The log as it was checked and split.
    pub input: Prepared,
    /// The diagnosis.
    pub found: Diagnosis,
    /// Its stochastic extension.
    pub stochastic: StochasticExtension,
}

/// Diagnoses recordings. The torque is that of the motor, so inertia is a part of the base model.
///
/// # Errors
/// One line, if the recordings cannot be read as a log or fitted.
pub fn learn(recordings: &[Recording], seed: u64) -> Result<Learnt, Error> {
    let options = PrepareOptions {
        rigid_body: vec![TermKind::UnmodelledInertia],
        split: SplitRule::LeaveOneRunOut,
        seed,
        ..PrepareOptions::default()
    };
    let input = prepare(&Source::Tables(vec![table(recordings)]), &options)?;
    // The drive samples torque and motion together, and filters neither: a lag would be one of the mechanics.
    let as_logged = vec![LogFindingKind::TorqueLag, LogFindingKind::ChannelLag];
    let question = DiagnosisOptions { seed, as_logged, ..input.question() };
    let found = diagnose(&input.data, &input.split, &question, &|_| {})?;
    let stochastic = StochasticExtension::new(&found, seed, &|_| {});
    Ok(Learnt { input, found, stochastic })
}

/// Terms that act on the bristles.
const NEED_BRISTLES: [TermKind; 3] =
    [TermKind::Backlash, TermKind::RadialForceRate, TermKind::DwellTimeStatic];

/// Name of the finding that is none of the causes.
const UNKNOWN: &str = "unknown";

/// Probability above which a hypothesis counts as settled.
const SETTLED: f64 = 0.9;

impl Learnt {
    /// Returns the name of the first cause, and its probability. Without a known cause: `none` or `unknown`, and the
    /// probability that none of the candidates is real.
    pub fn cause(&self) -> (String, f64) {
        match self.found.findings.first() {
            Some(finding) if finding.cause.name() != UNKNOWN => {
                (finding.cause.name().to_owned(), finding.probability)
            }
            other => {
                let known = self
                    .found
                    .candidates
                    .iter()
                    .filter(|candidate| candidate.cause.name() != UNKNOWN);
                let most = known.map(|candidate| candidate.probability).fold(0.0, f64::max);
                (other.map_or("none", |_| UNKNOWN).to_owned(), 1.0 - most)
            }
        }
    }

    /// Returns the number of the first cause for the record in a drive: 0 for none, otherwise that of its term plus one.
    pub fn cause_number(&self) -> u8 {
        let term = self.found.findings.first().and_then(|finding| finding.cause.remedy().term());
        term.map_or(0, |term| term as u8 + 1)
    }

    /// Returns true if the doubt about the first cause is below 10 %.
    pub fn is_settled(&self) -> bool {
        self.cause().1 >= SETTLED
    }

    /// Fits the two hypotheses that are still open: the extended model, and the base model with the most probable other
    /// candidate, or without any. `None` if they do not differ.
    pub fn open_hypotheses(&self) -> Option<[Outcome; 2]> {
        let first = &self.found.extended;
        let named: Vec<&str> =
            self.found.findings.iter().map(|finding| finding.cause.name()).collect();
        let other = self
            .found
            .candidates
            .iter()
            .filter(|candidate| !named.contains(&candidate.cause.name()));
        let other = other.max_by(|a, b| a.probability.total_cmp(&b.probability));
        let mut spec = Spec { terms: Vec::new(), ..self.found.baseline.spec.clone() };
        if let Some(term) = other.and_then(|candidate| candidate.cause.remedy().term())
            && !spec.law.includes(term)
            && !spec.rigid_body.contains(&term)
        {
            spec.terms.push(term);
        }
        if spec.terms == first.spec.terms {
            spec.terms.clear();
        }
        if spec.terms == first.spec.terms {
            return None;
        }
        let second = self.fit(&spec)?;
        Some([first.clone(), second])
    }

    fn fit(&self, spec: &Spec) -> Option<Outcome> {
        Some(self.fit_from(spec, &spec.parameters().ok()?, &FitOptions::default()))
    }

    fn fit_from(&self, spec: &Spec, base: &Parameters<f64>, options: &FitOptions) -> Outcome {
        let rows = Rows { tracks: &self.input.train, decimate: self.input.decimate };
        let (test, loss) = (self.input.test_rows(), self.input.loss);
        identify_robustly(loss, spec, base, rows, test, options)
    }

    /// Returns the inertia at the joint, kg m^2, if the recordings determine it.
    pub fn inertia_kg_m2(&self) -> Option<f64> {
        let model = &self.found.extended;
        let estimate =
            model.estimates.iter().find(|estimate| estimate.id == ParameterId::Inertia)?;
        let error = estimate.std_error?;
        (estimate.value > 0.0 && error < 0.2 * estimate.value).then_some(estimate.value)
    }

    /// Fits the static form of the extended model: the same terms on a law without bristles. `None` if the law is static
    /// already or a term needs bristles. Where the law of the bristles describes a joint badly, a static one may follow it
    /// better.
    pub fn static_model(&self) -> Option<Outcome> {
        let extended = &self.found.extended.spec;
        let is_static = |law: LawKind| !law.parameters().contains(&ParameterId::BristleStiffness);
        if is_static(extended.law) {
            return None;
        }
        let of_law = LawKind::Stribeck;
        let terms = extended.terms.iter().copied();
        let bare = |term: &TermKind| !of_law.includes(*term) && !NEED_BRISTLES.contains(term);
        let spec = Spec { law: of_law, terms: terms.filter(bare).collect(), ..extended.clone() };
        self.fit(&spec)
    }

    /// Returns the model for the driver in a passive form: the learnt one if it is passive, or else one that is fitted again
    /// without friction that drives. `None` if there is none.
    pub fn passive_form(&self, model: &Outcome) -> Option<Outcome> {
        let learnt = model.for_driver().parameters;
        if is_passive(&learnt) {
            return Some(model.clone());
        }
        let mut options = FitOptions { passive: true, starts: 1, ..FitOptions::default() };
        let mut start = learnt;
        start.choices.allow_active = false;
        if start.get(ParameterId::ViscousFriction) < 0.0 {
            start.set(ParameterId::ViscousFriction, 0.0);
            options.fixed.push(ParameterId::ViscousFriction);
        }
        options.start = Some(start.clone());
        let fitted = self.fit_from(&model.spec, &start, &options);
        is_passive(&fitted.for_driver().parameters).then_some(fitted)
    }

    /// Returns the error of a model for the driver on the held-out rows, RMS, Nm.
    pub fn held_out_nm(&self, model: &Outcome) -> f64 {
        predict(&model.for_driver().parameters, self.input.test_rows(), model.resolution)
            .metrics
            .rmse
    }

    /// Returns a copy of the set with a model that was fitted to the recordings. Inertia goes to the feed-forward of the velocity
    /// loop, friction and gravity to the compensator, at this scale.
    pub fn set_with(&self, model: &Outcome, former: &ParameterSet, scale: f32) -> ParameterSet {
        let driver = model.for_driver();
        let mut set = former.clone();
        set.network = None;
        let mut model: Parameters<f32> = driver.parameters.convert();
        model.choices.allow_active =
            former.friction.model.choices.allow_active || !is_passive(&driver.parameters);
        model.remove_left_out();
        widen(&mut model, &former.friction.model.envelope);
        set.friction.model = model;
        set.friction.compensator.scale = scale;
        if let Some(inertia) = self.inertia_kg_m2() {
            set.motor.inertia_kg_m2 = inertia as f32;
        }
        set.watch.band_nm = (2.0 * self.found.hand_over.held_out_of_driver.rmse) as f32;
        set
    }
}

/// Returns true if a law cannot give out energy: the core accepts it without `allow_active`, and it has no viscous friction that
/// drives.
pub fn is_passive(law: &Parameters<f64>) -> bool {
    let mut law = law.convert::<f32>();
    law.choices.allow_active = false;
    let viscous = ParameterId::ViscousFriction;
    let drives = law.active().any(|id| id == viscous) && law.get(viscous) < 0.0;
    !drives && law.validate().is_ok()
}

/// Gives a model the former range of inputs where it was wider than that of the recordings, if the model is valid there: the
/// joint keeps moving outside of what was recorded.
fn widen(model: &mut Parameters<f32>, former: &Envelope) {
    let recorded = model.envelope;
    let mut fields = recorded.to_array();
    for (field, former) in fields.iter_mut().zip(former.to_array()) {
        *field = field.max(former);
    }
    model.envelope = Envelope::from_array(fields);
    if model.validate().is_err() {
        model.envelope = recorded;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_passive_is_false_for_friction_that_drives_and_for_much_damping() {
        for law in [LawKind::Lugre, LawKind::Stribeck] {
            let passive = Parameters::<f64>::new(law);
            assert!(is_passive(&passive), "{law:?}");
            // The flag permits the law, and does not make it passive.
            for allow_active in [false, true] {
                let mut driving = passive.clone().with(ParameterId::ViscousFriction, -0.1);
                driving.choices.allow_active = allow_active;
                assert!(!is_passive(&driving), "{law:?}");
            }
        }
        let damped = Parameters::<f64>::new(LawKind::Lugre)
            .with(ParameterId::CoulombTorque, 1.0)
            .with(ParameterId::StaticTorque, 2.0)
            .with(ParameterId::BristleDamping, 1e4);
        assert!(!is_passive(&damped));
    }
}

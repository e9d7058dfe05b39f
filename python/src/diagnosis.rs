//! The diagnosis of a log.

use crate::computation::compute;
use crate::error::{to_python, unserialised, wrong_model};
use crate::log::Log;
use crate::model::Model;
use friction_diagnose::DiagnosisOptions;
use friction_diagnose::prepare::{Error, Prepared};
use friction_fit::spec::Spec;
use friction_results::diagnosis::{self, DiagnosedLog};
use friction_results::pretty;
use friction_results::stochastic::StochasticExtension;
use joint_log::SplitRule;
use joint_log::work::report_stage;
#[cfg(feature = "tune")]
use joint_tuning::learn::Learnt;
use pyo3::prelude::*;
use std::path::PathBuf;

/// Result of a diagnosis.
#[pyclass(frozen, module = "friction._core")]
pub struct Diagnosis {
    found: friction_diagnose::Diagnosis,
    stochastic: StochasticExtension,
    input: Prepared,
}

impl Diagnosis {
    fn log(&self) -> DiagnosedLog<'_> {
        let Self { found, stochastic, input } = self;
        DiagnosedLog { found, stochastic, input }
    }

    /// Creates the result of a diagnosis that a session has made.
    #[cfg(feature = "tune")]
    pub fn of_session(learnt: Learnt) -> Self {
        let Learnt { input, found, stochastic } = learnt;
        Self { found, stochastic, input }
    }
}

#[pymethods]
impl Diagnosis {
    /// Returns the text of diagnosis.json.
    fn json(&self) -> PyResult<String> {
        self.log().document().and_then(|document| pretty(&document)).map_err(unserialised)
    }

    /// Returns the text of report.html.
    #[pyo3(signature = (threads=0))]
    fn html(&self, py: Python<'_>, threads: usize) -> PyResult<String> {
        compute(py, threads, None, || Ok(self.log().page_text()))
    }

    /// Returns the first screen of the report as an HTML fragment without scripts.
    fn first_screen(&self, py: Python<'_>) -> PyResult<String> {
        compute(py, 0, None, || Ok(self.log().first_screen()))
    }

    /// Writes all result files into a folder, each completely or not at all.
    #[pyo3(signature = (folder, threads=0))]
    fn write(&self, py: Python<'_>, folder: PathBuf, threads: usize) -> PyResult<()> {
        let files = || self.log().files().map_err(|e| e.to_string().into());
        Ok(compute(py, threads, None, files)?.write(&folder)?)
    }

    /// The model to hand out: the extended one, or the base model if nothing was extended.
    #[getter]
    fn model(&self, py: Python<'_>) -> PyResult<Model> {
        let outcome = diagnosis::transferable_model(&self.found);
        let toml = diagnosis::parameter_text(&self.found, &self.input);
        let auxiliary = self.found.auxiliary_of_driver().map(str::to_owned);
        Model::of_fit(py, toml, &outcome, auxiliary)
    }

    /// The extended model as it was evaluated on this log.
    #[getter]
    fn extended(&self, py: Python<'_>) -> PyResult<Model> {
        let (fit, auxiliary) = (&self.found.extended, self.found.auxiliary.clone());
        let toml = diagnosis::law_text(&self.found, &self.input, fit, auxiliary.as_deref());
        Model::of_fit(py, toml, fit, auxiliary)
    }

    /// The base model, without extension.
    #[getter]
    fn baseline(&self, py: Python<'_>) -> PyResult<Model> {
        let fit = &self.found.baseline;
        let toml = diagnosis::law_text(&self.found, &self.input, fit, None);
        Model::of_fit(py, toml, fit, None)
    }
}

/// Diagnoses a log. `given` is a model to evaluate as it is, before its law is extended.
#[pyfunction]
#[pyo3(signature = (log, *, model=None, given=None, threads=0, progress=None))]
pub fn diagnose(
    py: Python<'_>,
    log: &Bound<'_, Log>,
    model: Option<&str>,
    given: Option<&Bound<'_, Model>>,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Diagnosis> {
    let log = log.get();
    let model = model.map(Spec::parse).transpose().map_err(|error| to_python(py, error.into()))?;
    let given = given.map(|given| given.get().given());
    if model.is_some() && given.is_some() {
        return Err(wrong_model(py, "model and given: expected one of them"));
    }
    compute(py, threads, progress, || {
        let input = log.prepare(&SplitRule::LeaveOneRunOut)?;
        let question =
            DiagnosisOptions { model, given, as_logged: log.as_logged.clone(), ..input.question() };
        let found =
            friction_diagnose::diagnose(&input.data, &input.split, &question, &report_stage)?;
        let stochastic = StochasticExtension::new(&found, question.seed, &report_stage);
        Ok::<_, Error>(Diagnosis { found, stochastic, input })
    })
}

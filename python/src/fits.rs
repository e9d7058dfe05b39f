//! Fits of one or several models.

use crate::computation::compute;
use crate::error::{to_python, unserialised, wrong_model};
use crate::log::Log;
use crate::model::Model;
use compensator_core::parameters::Choices;
use compensator_core::{LawKind, ParameterId};
use friction_diagnose::hand_over::BesidePlain;
use friction_diagnose::prepare::{Error, Prepared, identify_each};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Measurement, Outcome};
use friction_results::Files;
use friction_results::fits::{ComparisonFiles, comparison_files, fit_files, fit_json, fit_page};
use friction_results::provenance::parameter_file;
use joint_log::SplitRule;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::OnceLock;

/// Fits to one log. A comparison has files and a recommended model.
#[pyclass(frozen, module = "friction._core")]
pub struct Fits {
    fits: Vec<Outcome>,
    input: Prepared,
    /// `None` for the fit of one model.
    comparison: Option<ComparisonFiles>,
    /// The fit of one model beside plain friction, once it was needed.
    beside: OnceLock<BesidePlain>,
}

impl Fits {
    /// Returns the first fit beside plain friction.
    fn beside(&self) -> Result<BesidePlain, Error> {
        if let Some(beside) = self.beside.get() {
            return Ok(beside.clone());
        }
        let beside = BesidePlain::of(&self.fits[0], &self.input)?;
        Ok(self.beside.get_or_init(|| beside).clone())
    }

    fn files(&self) -> Result<Files, Error> {
        match &self.comparison {
            Some(comparison) => Ok(comparison.files.clone()),
            None => fit_files(&self.fits[0], &self.beside()?, &self.input)
                .map_err(|e| e.to_string().into()),
        }
    }
}

#[pymethods]
impl Fits {
    /// Returns the text of fit.json or compare.json.
    fn json(&self, py: Python<'_>) -> PyResult<String> {
        match &self.comparison {
            Some(comparison) => Ok(comparison.files.document.1.clone()),
            None => {
                let beside = self.beside().map_err(|error| to_python(py, error))?;
                fit_json(&self.fits[0], &beside, &self.input).map_err(unserialised)
            }
        }
    }

    /// Returns the text of fit.html or compare.html.
    #[pyo3(signature = (threads=0))]
    fn html(&self, py: Python<'_>, threads: usize) -> PyResult<String> {
        let page = self.comparison.as_ref().and_then(|comparison| {
            let mut others = comparison.files.others.iter();
            others.find(|(name, _)| *name == "compare.html")
        });
        match page {
            Some((_, page)) => Ok(String::from_utf8_lossy(page).into_owned()),
            None => compute(py, threads, None, || Ok(fit_page(&self.fits[0], &self.input))),
        }
    }

    /// Writes all result files into a folder, each completely or not at all.
    #[pyo3(signature = (folder, threads=0))]
    fn write(&self, py: Python<'_>, folder: PathBuf, threads: usize) -> PyResult<()> {
        Ok(compute(py, threads, None, || self.files())?.write(&folder)?)
    }

    /// The fitted models, in the order of the request.
    #[getter]
    fn models(&self, py: Python<'_>) -> PyResult<Vec<Model>> {
        let command = if self.comparison.is_some() { "compare" } else { "identify" };
        self.fits
            .iter()
            .map(|fit| {
                let toml = parameter_file(command, &self.input, fit, None, &Measurement::default());
                Model::of_fit(py, toml, fit, None)
            })
            .collect()
    }

    /// Index of the recommended model.
    #[getter]
    fn chosen(&self) -> usize {
        self.comparison.as_ref().map_or(0, |comparison| comparison.chosen)
    }

    /// The result of a comparison in sentences.
    #[getter]
    fn summary(&self) -> Vec<String> {
        self.comparison.as_ref().map_or(Vec::new(), |comparison| comparison.summary.to_vec())
    }
}

/// Returns the names of all laws.
#[pyfunction]
pub fn laws() -> Vec<&'static str> {
    LawKind::ALL.iter().map(|law| law.name()).collect()
}

/// Fits models to a log. `compares` selects the files and the recommendation of a comparison. With `uses_all_rows`, no run
/// is held out.
#[pyfunction]
#[pyo3(signature = (log, models, *, compares=false, uses_all_rows=false, starts=3, keep=vec![], free=vec![], choices=vec![], threads=0, progress=None))]
#[expect(clippy::too_many_arguments, reason = "each is a keyword in Python")]
pub fn fit(
    py: Python<'_>,
    log: &Bound<'_, Log>,
    models: Vec<String>,
    compares: bool,
    uses_all_rows: bool,
    starts: usize,
    keep: Vec<String>,
    free: Vec<String>,
    choices: Vec<String>,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Fits> {
    let log = log.get();
    let specs: Result<Vec<Spec>, _> = models.iter().map(|model| Spec::parse(model)).collect();
    let specs = specs.map_err(|error| to_python(py, error.into()))?;
    if specs.is_empty() {
        return Err(wrong_model(py, "models: found none, expected at least one"));
    }
    let ids = |setting: &str, names: &[String]| -> PyResult<Vec<ParameterId>> {
        let id = |name: &String| {
            let unknown = || wrong_model(py, &format!("{setting}: unknown parameter {name:?}"));
            ParameterId::parse(name).ok_or_else(unknown)
        };
        names.iter().map(id).collect()
    };
    let options = FitOptions {
        starts: if compares { FitOptions::default().starts } else { starts.max(1) },
        fixed: ids("keep", &keep)?,
        freed: ids("free", &free)?,
        passive: true,
        ..FitOptions::default()
    };
    let choices = chosen(py, &choices)?;
    compute(py, threads, progress, || {
        let split = if uses_all_rows { SplitRule::LeaveOneRunOut } else { SplitRule::default() };
        let input = log.prepare(&split)?;
        let fits = identify_each(&specs, &input, choices, &options)?;
        let files = || comparison_files(&fits, &input).map_err(|e| Error::from(e.to_string()));
        let comparison = compares.then(files).transpose()?;
        Ok(Fits { fits, input, comparison, beside: OnceLock::new() })
    })
}

/// Returns the choices with the named ones switched on.
fn chosen(py: Python<'_>, names: &[String]) -> PyResult<Choices> {
    let mut choices = Choices::default().to_array();
    for name in names {
        let place = Choices::NAMES.iter().position(|known| known == name).ok_or_else(|| {
            let known = Choices::NAMES.join(", ");
            wrong_model(py, &format!("choices: unknown choice {name:?}, expected one of {known}"))
        })?;
        choices[place] = true;
    }
    Ok(Choices::from_array(choices))
}

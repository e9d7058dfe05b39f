//! Long computations without Python's lock, which Ctrl-C and the progress function end.

use crate::error::to_python;
use friction_diagnose::prepare::Error;
use joint_log::work::{self, Progress};
use pyo3::prelude::*;
use std::cell::RefCell;
use std::ops::ControlFlow;

/// Runs `work` on `threads` threads, 0 for all cores. `progress` is called with the state in words and the share that is
/// done, `None` if it is unknown; an exception in it ends the computation.
///
/// # Errors
/// The exception of `progress` or of a signal, or the error of `work`.
pub fn compute<R: Send>(
    py: Python<'_>,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce() -> Result<R, Error> + Send,
) -> PyResult<R> {
    let progress = progress.map(|progress| progress.clone().unbind());
    let (outcome, exception) = py.detach(|| {
        let exception = RefCell::new(None);
        let ask = |state: &Progress| {
            let asked = Python::attach(|py| {
                py.check_signals()?;
                progress.as_ref().map_or(Ok(()), |progress| report(progress.bind(py), state))
            });
            match asked {
                Ok(()) => ControlFlow::Continue(()),
                Err(raised) => {
                    exception.replace(Some(raised));
                    ControlFlow::Break(())
                }
            }
        };
        let outcome = work::run(threads, &ask, work);
        (outcome, exception.into_inner())
    });
    match exception {
        Some(raised) => Err(raised),
        None => outcome.map_err(|error| to_python(py, error)),
    }
}

fn report(progress: &Bound<'_, PyAny>, state: &Progress) -> PyResult<()> {
    let arguments = match state {
        Progress::Stage(stage) if stage.is_empty() => return Ok(()),
        Progress::Stage(stage) => (stage.as_str(), None),
        Progress::Reading { total: 0, .. } => ("reading", None),
        Progress::Reading { done, total } => ("reading", Some(*done as f64 / *total as f64)),
    };
    progress.call1(arguments).map(|_| ())
}

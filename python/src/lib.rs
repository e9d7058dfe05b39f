//! The Python module `friction._core`: identification and diagnosis of joint friction for data frames.
//!
//! The package `friction` around it, written in Python, has the types and the documentation for users. This crate converts
//! values, releases Python's lock during computations, and stops them if Python asks.
//!
//! - `table`: Arrow data and columns as tables in memory, and back.
//! - `log`: a log with the options of its reading.
//! - `computation`: progress, Ctrl-C.
//! - `error`: errors as Python exceptions.
//! - `diagnosis`, `fits`, `fleet`, `model`, `simulation`: the results.
//! - `tune`: a joint on a bus, behind the feature of this name.

mod computation;
mod diagnosis;
mod error;
mod fits;
mod fleet;
mod log;
mod model;
mod simulation;
mod table;
#[cfg(feature = "tune")]
mod tune;

use pyo3::prelude::*;

#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<table::Table>()?;
    module.add_class::<log::Log>()?;
    module.add_class::<diagnosis::Diagnosis>()?;
    module.add_class::<fits::Fits>()?;
    module.add_class::<model::Model>()?;
    #[cfg(feature = "tune")]
    {
        module.add_class::<tune::Joint>()?;
        module.add_class::<tune::Tuning>()?;
        module.add_function(wrap_pyfunction!(tune::tune, module)?)?;
        module.add_function(wrap_pyfunction!(tune::undo_tuning, module)?)?;
    }
    module.add_function(wrap_pyfunction!(diagnosis::diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(fits::fit, module)?)?;
    module.add_function(wrap_pyfunction!(fits::laws, module)?)?;
    module.add_function(wrap_pyfunction!(fleet::fleet_jobs, module)?)?;
    module.add_function(wrap_pyfunction!(fleet::fleet_jobs_of, module)?)?;
    module.add_function(wrap_pyfunction!(fleet::fleet_task, module)?)?;
    module.add_function(wrap_pyfunction!(fleet::fleet_write, module)?)?;
    module.add_function(wrap_pyfunction!(log::read, module)?)?;
    module.add_function(wrap_pyfunction!(model::with_row_numbers, module)?)?;
    module.add_function(wrap_pyfunction!(model::with_numbers, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::simulate, module)?)
}

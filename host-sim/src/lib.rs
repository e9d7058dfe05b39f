//! Identifies, compares and diagnoses joint friction models on measured data.
//!
//! ```text
//! data -> fit (over compensator-core's own step) -> results
//! ```
//!
//! [`data`] reads logs by the contract; [`fit`] fits a [`spec::Spec`]; [`results`] writes `fit.json`,
//! `compare.json`, `params.toml` and the HTML page; [`cli`] is the command line over them. The binary is
//! a thin `main`.

pub mod bank;
pub mod bus;
pub mod canopen;
pub mod cli;
pub mod data;
pub mod diagnose;
pub mod dual;
pub mod fit;
pub mod joint;
pub mod monitor;
pub mod params;
pub mod plant;
pub mod replay;
pub mod report;
pub mod results;
pub mod spec;
pub mod stochastic;
pub mod trace;

//! Simulation of the underwater joint: as in the paper, or with hidden effects.

use crate::scenarios::{self, Hidden, Hide, Options, ScenarioTruth};
use crate::simulation::{Request, Simulated, Simulation, SimulationError};
use crate::underwater_joint::{Recording, record};

/// The joint of Ding et al. on its test stand.
///
/// Without `--hide`, load and pressure act as in the paper. With it, no, one or two physical effects are hidden in a
/// random campaign.
pub const UNDERWATER_JOINT: Simulation = Simulation {
    name: "underwater-joint",
    about: "The joint of Ding et al. on its test stand: speeds, side loads and pressures",
    run: |request| if request.hide.is_empty() { plain(request) } else { hidden(request) },
};

/// Maximum number of rows.
const MAX_ROWS: f64 = 1e8;

/// Simulates the joint with load and pressure as in the paper.
fn plain(request: &Request) -> Result<Simulated, SimulationError> {
    let default = Recording::default();
    let how = Recording {
        runs: request.runs.unwrap_or(default.runs),
        seconds: request.seconds.unwrap_or(default.seconds),
        rate_hz: request.rate_hz.unwrap_or(default.rate_hz),
        noise_nm: request.noise_nm.unwrap_or(default.noise_nm),
        loaded: !request.unloaded,
        steady: request.steady,
    };
    if how.seconds * how.rate_hz * how.runs as f64 > MAX_ROWS {
        return Err(SimulationError::TooManyRows { most: MAX_ROWS });
    }
    let truth = record(request.seed, how);
    Ok(Simulated { truth: truth.json(), log: truth.log().clone(), hidden: Vec::new() })
}

/// Maximum duration, s, and number of rows with hidden effects. All integration steps are kept in memory.
const MAX_SECONDS_HIDDEN: f64 = 2000.0;
const MAX_ROWS_HIDDEN: f64 = 5e6;

/// Simulates a joint with hidden effects.
fn hidden(request: &Request) -> Result<Simulated, SimulationError> {
    Hide::require_scenario(&request.hide)?;
    let options = Options {
        runs: request.runs,
        seconds: request.seconds,
        rate_hz: request.rate_hz,
        noise_nm: request.noise_nm,
        ..Options::default()
    };
    // Missing values are drawn: at most about 170 s in total, at least six runs, at least one second per run.
    let seconds = match (request.runs.map(|runs| runs as f64), request.seconds) {
        (Some(runs), Some(seconds)) => runs * seconds,
        (runs, seconds) => (runs.unwrap_or(6.0) * seconds.unwrap_or(1.0)).max(170.0),
    };
    if seconds > MAX_SECONDS_HIDDEN {
        return Err(SimulationError::TooLong { most_s: MAX_SECONDS_HIDDEN });
    }
    if seconds * request.rate_hz.unwrap_or(2000.0) > MAX_ROWS_HIDDEN {
        return Err(SimulationError::TooManyRowsWithHide { most: MAX_ROWS_HIDDEN });
    }
    let scenario = scenarios::draw_with(&request.hide, request.seed, &options);
    Ok(Simulated {
        truth: scenario.truth.json(),
        hidden: in_words(&scenario.truth),
        log: scenario.log,
    })
}

/// Returns one line for each hidden effect.
fn in_words(truth: &ScenarioTruth) -> Vec<String> {
    if truth.hidden.is_empty() {
        return vec!["hidden: none".to_owned()];
    }
    let noise_nm = truth.noise_nm;
    let line = |hidden: &Hidden| {
        let Hidden { in_words, visible_rms_nm, .. } = hidden;
        format!("hidden: {in_words}; {visible_rms_nm:.3} Nm RMS under {noise_nm:.3} Nm of noise")
    };
    truth.hidden.iter().map(line).collect()
}

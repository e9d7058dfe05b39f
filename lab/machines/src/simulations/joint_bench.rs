//! Simulation of the test stand: the runs that precede the pool tests, of the same joint. Their torque is the friction alone.

use crate::bench::{Amount, Bench, Campaigns};
use simulated_machines::joint_plant::Parameters;
use simulated_machines::joint_plant::parameters::PHASE_RAD;
use simulated_machines::{Request, Simulated, Simulation, SimulationError};

/// Bench runs of the joint of the pool tests.
pub const JOINT_BENCH: Simulation = Simulation {
    name: "joint-bench",
    about: "Bench runs of the joint of the pool tests: unloaded, factorial, and the paper's eight kinds",
    run: simulate,
};

/// Length of the unloaded and the factorial runs without `--seconds`, s.
const DEFAULT_SECONDS: f64 = 6.0;

/// Measures the bench runs.
fn simulate(request: &Request) -> Result<Simulated, SimulationError> {
    request.refuse_effects()?;
    if request.runs.is_some() || request.rate_hz.is_some() {
        let options = "--runs, --rate: the bench has its own runs at 250 Hz";
        return Err(SimulationError::Unsupported { options });
    }
    let seconds = request.seconds.unwrap_or(DEFAULT_SECONDS);
    if !(0.5..=60.0).contains(&seconds) {
        let expected = "0.5 to 60".to_owned();
        return Err(SimulationError::Value { option: "--seconds", found: seconds, expected });
    }
    let mut parameters = Parameters::default();
    parameters.torque_noise_nm = request.noise_nm.unwrap_or(parameters.torque_noise_nm);
    let temperature_c = [parameters.water_temperature_c; 2];
    let bench = Bench { parameters, phase_rad: PHASE_RAD, temperature_c, seed: request.seed };
    let amount = Amount { seconds, both_motions: false, learned: 2, held_out: 0 };
    let Campaigns { unloaded: mut log, factorial, learned, .. } = bench.measure(&amount);
    log.runs.extend(factorial.runs);
    log.runs.extend(learned.runs);
    let truth = parameters.truth(JOINT_BENCH.name, request.seed);
    Ok(Simulated { log, truth, hidden: Vec::new() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulate_with_unsupported_option_returns_error() {
        let unloaded = Request { unloaded: true, ..Request::default() };
        assert!(JOINT_BENCH.simulate(&unloaded).unwrap_err().to_string().contains("--unloaded"));
        let runs = Request { runs: Some(3), ..Request::default() };
        assert!(JOINT_BENCH.simulate(&runs).unwrap_err().to_string().contains("250 Hz"));
    }

    #[test]
    fn simulate_measures_the_unloaded_the_factorial_and_the_eight_kinds() {
        let request = Request { seconds: Some(0.5), ..Request::default() };
        let log = JOINT_BENCH.simulate(&request).expect("a log").log;
        assert_eq!(log.runs.len(), 8 + 24 + 16);
    }
}

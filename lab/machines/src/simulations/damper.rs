//! Simulation of the friction damper: the paper's 24 characterisation tests and five wind tests.
//!
//! Half of the paper's tests and all of its wind tests are not public. This simulation replaces them. It follows the
//! paper's protocol on an independent plant ([`crate::banded_damper`]). The results must be marked as simulated.

use crate::banded_damper::BandedDamper;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::json;
use simulated_machines::{Log, LoggedRun};
use simulated_machines::{Request, Simulated, Simulation, SimulationError};
use std::f64::consts::TAU;

/// The damper of the second paper on its test stand.
pub const DAMPER: Simulation = Simulation {
    name: "damper",
    about: "A banded rotary friction damper: six tensions at four frequencies, and wind",
    run: simulate,
};

/// Preset tensions of the paper, lb, and the conversion factor to N.
const TENSIONS_LB: [f64; 6] = [20.0, 22.0, 25.0, 35.0, 70.0, 80.0];
const NEWTON_PER_POUND: f64 = 4.448_222;

/// Frequencies of the paper, Hz.
const FREQUENCIES_HZ: [f64; 4] = [0.05, 0.1, 0.5, 1.0];

/// Full amplitude of a sine test, m, and its number of cycles. Two cycles fade in and two fade out.
const AMPLITUDE_M: f64 = 0.0275;
const CYCLES: f64 = 6.0;

/// Number, length and preset tension of the wind tests.
const WIND_TESTS: usize = 5;
const WIND_SECONDS: f64 = 60.0;
const WIND_TENSION_LB: f64 = 35.0;

/// Default and maximum sample rate, Hz.
const RATE_HZ: f64 = 128.0;
const MAX_RATE_HZ: f64 = 2048.0;

const COLUMNS: [&str; 7] = [
    "time_s",
    "position_m",
    "velocity_m_s",
    "force_n",
    "tension_n",
    "actuator1_force_n",
    "actuator2_force_n",
];

/// A test with its name, tension, length and motion.
struct Test {
    name: String,
    tension_n: f64,
    seconds: f64,
    position: Box<dyn Fn(f64) -> f64>,
}

/// Runs the simulation.
fn simulate(request: &Request) -> Result<Simulated, SimulationError> {
    if !request.hide.is_empty() || request.unloaded || request.steady {
        let options = "damper: --hide, --unloaded and --steady are for the underwater joint";
        return Err(SimulationError::Unsupported { options });
    }
    if request.noise_nm.is_some() {
        let options = "damper: --noise is for the underwater joint";
        return Err(SimulationError::Unsupported { options });
    }
    let rate_hz = request.rate_hz.unwrap_or(RATE_HZ);
    if rate_hz > MAX_RATE_HZ {
        let expected = format!("at most {MAX_RATE_HZ}");
        return Err(SimulationError::Value { option: "damper: --rate", found: rate_hz, expected });
    }
    let damper = BandedDamper::draw(request.seed);
    let mut tests = tests(request.seed);
    let count = request.runs.unwrap_or(tests.len());
    if count > tests.len() {
        let expected = format!("at most {}", tests.len());
        let found = count as f64;
        return Err(SimulationError::Value { option: "damper: --runs", found, expected });
    }
    tests.truncate(count);
    let mut log = Log { columns: COLUMNS.map(str::to_owned).to_vec(), runs: Vec::new() };
    let mut test_records = Vec::new();
    for (index, test) in tests.into_iter().enumerate() {
        let Test { name, tension_n, seconds, position } = test;
        let seconds = request.seconds.unwrap_or(seconds);
        let seed = request.seed.wrapping_mul(1000).wrapping_add(index as u64);
        let rows = damper.record(tension_n, seconds, rate_hz, seed, position);
        let column = |of: &dyn Fn(&crate::banded_damper::Row) -> f64| rows.iter().map(of).collect();
        let columns = vec![
            column(&|row| row.time_s),
            column(&|row| row.position_m),
            column(&|row| row.velocity_m_s),
            column(&|row| row.force_n),
            column(&|_| tension_n),
            column(&|row| row.actuators_n[0]),
            column(&|row| row.actuators_n[1]),
        ];
        test_records.push(json!({"run": name, "tension_n": tension_n, "seconds": seconds}));
        log.runs.push(LoggedRun { name, columns });
    }
    let truth = json!({
        "schema": 1, "scenario": "damper", "seed": request.seed, "simulated": true, "runs": test_records,
        "effects": ["backlash", "direction-asymmetry", "tension (saturating)"],
        "actuators": "consequences of the friction: force = 2 (a2 - a1)",
    });
    Ok(Simulated { truth, log, hidden: Vec::new() })
}

/// Returns all tests: the sine tests in the order of the paper's tables, then wind.
fn tests(seed: u64) -> Vec<Test> {
    let mut tests = Vec::new();
    for tension_lb in TENSIONS_LB {
        for frequency in FREQUENCIES_HZ {
            let seconds = CYCLES / frequency;
            tests.push(Test {
                name: format!("{tension_lb}lb@{frequency}Hz"),
                tension_n: tension_lb * NEWTON_PER_POUND,
                seconds,
                position: Box::new(move |t| {
                    let fade = (t * frequency).min(CYCLES - t * frequency).min(2.0) / 2.0;
                    AMPLITUDE_M * fade.max(0.0) * (TAU * frequency * t).sin()
                }),
            });
        }
    }
    for index in 0..WIND_TESTS {
        tests.push(Test {
            name: format!("wind{}", index + 1),
            tension_n: WIND_TENSION_LB * NEWTON_PER_POUND,
            seconds: WIND_SECONDS,
            position: wind(seed.wrapping_add(7919 * (index as u64 + 1))),
        });
    }
    tests
}

/// Draws the displacement of a storey under wind, as a function of time.
///
/// It has a mean displacement and oscillations from 0.05 to 3 Hz whose amplitude decreases with frequency. As in the
/// paper, a part of it exceeds the frequencies of the sine tests.
fn wind(seed: u64) -> Box<dyn Fn(f64) -> f64> {
    const PARTS: usize = 24;
    let mut random = Pcg64::seed_from_u64(seed);
    let mean_m = random.random_range(0.004..0.012);
    let parts: [(f64, f64, f64); PARTS] = std::array::from_fn(|part| {
        let frequency =
            0.05 * 60f64.powf((part as f64 + random.random_range(0.0..1.0)) / PARTS as f64);
        let amplitude = 0.004 / (1.0 + (frequency / 0.4).powi(2)).sqrt();
        (frequency, amplitude, random.random_range(0.0..TAU))
    });
    Box::new(move |t| {
        let rise = (t / 5.0).min(1.0);
        let gusts =
            parts.iter().map(|(f, a, phase)| a * ((TAU * f * t + phase).sin() - phase.sin()));
        rise * (mean_m + gusts.sum::<f64>())
    })
}

#[cfg(test)]
mod damper_tests {
    use super::*;

    #[test]
    fn simulate_returns_all_tests_and_is_reproducible() {
        let request = Request { seed: 3, ..Request::default() };
        let found = DAMPER.simulate(&request).unwrap();
        assert_eq!(found.log.runs.len(), 29);
        assert_eq!(found.log.runs[0].name, "20lb@0.05Hz");
        assert_eq!(found.log.runs[28].name, "wind5");
        assert_eq!(found.log, DAMPER.simulate(&request).unwrap().log);
        let fastest = |name: &str| {
            let run = found.log.runs.iter().find(|run| run.name == name).unwrap();
            let speeds = found.log.column(run, "velocity_m_s").unwrap();
            speeds.iter().map(|speed| speed.abs()).fold(0.0, f64::max)
        };
        assert!((0.15..0.20).contains(&fastest("35lb@1Hz")), "{}", fastest("35lb@1Hz"));
        assert!((0.005..0.3).contains(&fastest("wind1")), "{}", fastest("wind1"));
    }

    #[test]
    fn simulate_with_unsupported_option_returns_error() {
        let error_of = |request: Request| DAMPER.simulate(&request).unwrap_err().to_string();
        assert!(error_of(Request { steady: true, ..Request::default() }).contains("--steady"));
        assert!(error_of(Request { runs: Some(30), ..Request::default() }).contains("at most 29"));
        assert!(error_of(Request { rate_hz: Some(1e5), ..Request::default() }).contains("2048"));
    }
}

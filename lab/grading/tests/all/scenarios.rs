//! Checks that simulated scenarios contain exactly the hidden effects that their truth states.
//!
//! The grading of the diagnosis relies on these properties. Two scenarios that differ only in the size of one effect
//! have the same noise. The difference of their torques is therefore the effect, and the tests compare it with the
//! formula of the catalogue.

use joint_log::{Dataset, Quantity, ReadOptions, Run, read};
use joint_rig::simulated;
use rayon::prelude::*;
use simulated_machines::scenarios::{self, HiddenCause, Hide, Options, ScenarioTruth};
use std::fs;
use unkind_worlds::planned::{self, Kind, PAIRS, benchmark};

/// A detectable size of each effect.
fn size(effect: HiddenCause) -> f64 {
    match effect {
        HiddenCause::RadialForceCoulomb => 4e-3,
        HiddenCause::RadialForceRate => 2e-6,
        HiddenCause::PressureCoulomb => 1e-6,
        HiddenCause::TemperatureViscous => 0.03,
        HiddenCause::PositionRipple | HiddenCause::DirectionAsymmetry => 0.08,
        HiddenCause::TemperatureCoulomb => 0.01,
        HiddenCause::GravityImbalance
        | HiddenCause::TorqueRipple
        | HiddenCause::TorqueOffset
        | HiddenCause::DwellTimeStatic => 0.15,
        HiddenCause::QuadraticDrag | HiddenCause::ChannelDelay => 5e-3,
        HiddenCause::TimeDrift => -0.15,
        HiddenCause::WarmUp => 0.3,
        HiddenCause::LoadTorqueCoulomb | HiddenCause::UnmodelledInertia => 0.03,
        HiddenCause::Backlash => 1e-3,
        HiddenCause::StribeckShape => 0.8,
        HiddenCause::OutsideCatalogue => 0.2,
    }
}

fn catalogue() -> impl Iterator<Item = HiddenCause> {
    HiddenCause::ALL.into_iter().filter(|effect| *effect != HiddenCause::OutsideCatalogue)
}

const NOISE_NM: f64 = 0.05;

/// A scenario with its log as a data set.
struct Scenario {
    csv: String,
    data: Dataset,
    truth: ScenarioTruth,
}

fn of(scenarios::Scenario { log, truth }: scenarios::Scenario) -> Scenario {
    Scenario { csv: log.csv(), data: simulated::dataset(&log), truth }
}

fn draw(kind: Kind, seed: u64) -> Scenario {
    of(planned::draw(kind, seed))
}

fn draw_with(effect: HiddenCause, size: Option<f64>, seed: u64, options: &Options) -> Scenario {
    of(scenarios::draw_with(&[Hide { effect: Some(effect), size }], seed, options))
}

fn sized(effect: HiddenCause, size: f64, seed: u64, finer: u32) -> Scenario {
    let options = Options {
        runs: Some(8),
        seconds: Some(5.0),
        rate_hz: Some(400.0),
        noise_nm: Some(NOISE_NM),
        finer,
        ..Options::default()
    };
    draw_with(effect, Some(size), seed, &options)
}

/// Returns the scenario and, for each run, the torque with the effect minus the torque without it.
fn shown(effect: HiddenCause, size: f64, seed: u64) -> (Scenario, Vec<Vec<f64>>) {
    let with = sized(effect, size, seed, 1);
    let without = sized(effect, effect.neutral(), seed, 1);
    let differences = differences(&with.data, &without.data);
    (with, differences)
}

fn differences(a: &Dataset, b: &Dataset) -> Vec<Vec<f64>> {
    let run = |(a, b): (&Run, &Run)| {
        assert_eq!(
            (&a.time_s, &a.velocity, a.get(Quantity::Position)),
            (&b.time_s, &b.velocity, b.get(Quantity::Position))
        );
        a.torque.iter().zip(&b.torque).map(|(a, b)| a - b).collect()
    };
    a.runs.iter().zip(&b.runs).map(run).collect()
}

fn rms(runs: &[Vec<f64>]) -> f64 {
    let rows: usize = runs.iter().map(Vec::len).sum();
    (runs.iter().flatten().map(|x| x * x).sum::<f64>() / rows as f64).sqrt()
}

fn same(a: &Scenario, b: &Scenario) -> bool {
    a.data.runs == b.data.runs && a.truth == b.truth
}

#[test]
fn draw_with_same_seed_is_identical_on_any_number_of_threads() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for (kind, seed) in benchmark(11, 1).step_by(5) {
        let one = pool.install(|| draw(kind, seed));
        let other = draw(kind, seed);
        assert!(same(&one, &other), "{kind:?}");
        assert!(!same(&one, &draw(kind, seed + 1)), "{kind:?}");
    }
}

#[test]
fn hidden_effect_has_the_size_of_the_truth() {
    catalogue().for_each(|effect| {
        let (scenario, difference) = shown(effect, size(effect), 3);
        let hidden = &scenario.truth.hidden[0];
        assert_eq!((hidden.cause, hidden.size), (effect.name(), size(effect)));
        let seen = rms(&difference);
        assert!(seen > 0.2 * NOISE_NM, "{}: {seen}", effect.name());
        assert!((seen - hidden.visible_rms_nm).abs() < 2e-6, "{}", effect.name());
    });
}

#[test]
fn hidden_effect_of_neutral_size_changes_nothing() {
    for effect in catalogue() {
        let neutral = sized(effect, effect.neutral(), 4, 1);
        assert_eq!(neutral.truth.hidden[0].visible_rms_nm, 0.0, "{}", effect.name());
    }
}

/// Returns the rows in steady sliding: ten rows in one direction, well above the Stribeck velocity.
fn sliding(scenario: &Scenario, run: &Run) -> Vec<usize> {
    let fast = 8.0 * scenario.truth.seal.stribeck_rad_s;
    let all = |row: usize| {
        (row - 10..=row).all(|at| run.velocity[at] * run.velocity[row].signum() > fast)
    };
    (10..run.len()).filter(|&row| all(row)).collect()
}

/// Compares the effect in sliding with a formula of the row, within an absolute tolerance, Nm.
fn assert_in_sliding(
    effect: HiddenCause,
    tolerance: f64,
    formula: impl Fn(&Scenario, &Run, usize) -> f64,
) {
    let (scenario, difference) = shown(effect, size(effect), 5);
    let mut rows = 0;
    for (run, difference) in scenario.data.runs.iter().zip(&difference) {
        for row in sliding(&scenario, run) {
            let (found, expected) = (difference[row], formula(&scenario, run, row));
            let name = effect.name();
            assert!((found - expected).abs() < tolerance, "{name}: {found} is not {expected}");
            rows += 1;
        }
    }
    assert!(rows > 500, "{}: only {rows} rows", effect.name());
}

fn value(run: &Run, quantity: Quantity, row: usize) -> f64 {
    run.get(quantity).unwrap()[row]
}

#[test]
fn load_effects_in_sliding_match_their_formula() {
    let (k, p, l) = (4e-3, 1e-6, 0.03);
    assert_in_sliding(HiddenCause::RadialForceCoulomb, 2e-3, |_, run, row| {
        k * value(run, Quantity::RadialForce, row) * run.velocity[row].signum()
    });
    assert_in_sliding(HiddenCause::PressureCoulomb, 1e-3, |_, run, row| {
        p * value(run, Quantity::Pressure, row) * run.velocity[row].signum()
    });
    assert_in_sliding(HiddenCause::LoadTorqueCoulomb, 3e-3, |_, run, row| {
        l * value(run, Quantity::LoadTorque, row).abs() * run.velocity[row].signum()
    });
}

#[test]
fn additive_effects_in_sliding_match_their_formula() {
    assert_in_sliding(HiddenCause::TorqueOffset, 2e-6, |_, _, _| 0.15);
    // Some scenarios log the velocity with an encoder error.
    assert_in_sliding(HiddenCause::QuadraticDrag, 4e-3, |_, run, row| {
        5e-3 * run.velocity[row] * run.velocity[row].abs()
    });
    assert_in_sliding(HiddenCause::GravityImbalance, 1e-5, |scenario, run, row| {
        let (_, phase) = scenario.truth.hidden[0].details[0];
        0.15 * (value(run, Quantity::Position, row) + phase).sin()
    });
    assert_in_sliding(HiddenCause::TorqueRipple, 1e-3, |scenario, run, row| {
        // Order and phase of the first wave; for each other wave also its amplitude relative to the first.
        let details = scenario.truth.hidden[0].details.iter().map(|(_, value)| *value);
        let details: Vec<f64> = details.collect();
        let angle = value(run, Quantity::Position, row);
        let beside = details[2..].chunks(3).map(|wave| wave[1] * (wave[0] * angle + wave[2]).sin());
        0.15 * ((details[0] * angle + details[1]).sin() + beside.sum::<f64>())
    });
    let (scenario, difference) = shown(HiddenCause::UnmodelledInertia, 0.03, 5);
    let (mut products, mut squares) = (0.0, 0.0);
    for (run, difference) in scenario.data.runs.iter().zip(&difference) {
        for (a, torque) in run.acceleration_or_derived().iter().zip(difference) {
            products += a * torque;
            squares += a * a;
        }
    }
    let inertia = products / squares;
    assert!((inertia / 0.03 - 1.0).abs() < 0.05, "{inertia}");
}

#[test]
fn level_factor_effects_in_sliding_match_their_formula() {
    assert_in_sliding(HiddenCause::DirectionAsymmetry, 4e-3, |scenario, run, row| {
        let (seal, v) = (&scenario.truth.seal, run.velocity[row]);
        0.08 * (seal.coulomb_nm + seal.k2 * v.abs())
    });
    let end = |scenario: &Scenario| {
        let last = scenario.data.runs.last().unwrap();
        last.time_s[0].floor() + 5.0
    };
    assert_in_sliding(HiddenCause::TimeDrift, 0.16 * 2.4, |scenario, run, row| {
        // The drift is linear or exponential and reaches its full size at the end; the tolerance covers both.
        let share = (run.time_s[row] / end(scenario)).min(1.0);
        -0.15 * share * scenario.truth.seal.coulomb_nm * run.velocity[row].signum()
    });
    assert_in_sliding(HiddenCause::TemperatureViscous, 5e-4, |scenario, run, row| {
        let (_, reference) = scenario.truth.hidden[0].details[0];
        let film = (-0.03 * (value(run, Quantity::Temperature, row) - reference)).exp();
        scenario.truth.seal.k2 * (film - 1.0) * run.velocity[row]
    });
    assert_in_sliding(HiddenCause::TemperatureCoulomb, 4e-3, |scenario, run, row| {
        let (_, reference) = scenario.truth.hidden[0].details[0];
        let grip = (-0.01 * (value(run, Quantity::Temperature, row) - reference)).exp();
        scenario.truth.seal.coulomb_nm * (grip - 1.0) * run.velocity[row].signum()
    });
}

#[test]
fn finer_integration_changes_torque_negligibly() {
    let finer = |effect| {
        let (one, two) = (sized(effect, size(effect), 6, 1), sized(effect, size(effect), 6, 2));
        (effect, differences(&one.data, &two.data))
    };
    let all: Vec<_> = catalogue().collect();
    for (effect, difference) in all.into_par_iter().map(finer).collect::<Vec<_>>() {
        let worst = difference.iter().flatten().fold(0.0f64, |most, x| most.max(x.abs()));
        println!("{}: {worst:.2e} Nm at most, {:.2e} Nm RMS", effect.name(), rms(&difference));
        assert!(rms(&difference) < 1e-3 * NOISE_NM, "{}", effect.name());
        assert!(worst < 5e-3 * NOISE_NM, "{}: {worst}", effect.name());
    }
}

/// Correlation over all rows.
fn correlation(data: &Dataset, one: &str, other: &str) -> f64 {
    let all = |name: &str| -> Vec<f64> {
        data.runs
            .iter()
            .flat_map(|run| data.column(run, name).unwrap().iter().map(|x| x.abs()))
            .collect()
    };
    let (a, b) = (all(one), all(other));
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let (ma, mb) = (mean(&a), mean(&b));
    let sum =
        |f: &dyn Fn(f64, f64) -> f64| a.iter().zip(&b).map(|(a, b)| f(a - ma, b - mb)).sum::<f64>();
    sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt()
}

/// Returns the column that a level effect depends on.
fn column(cause: &str) -> &'static str {
    HiddenCause::parse(cause).and_then(HiddenCause::column).unwrap()
}

#[test]
fn confounded_columns_correlate_fully_and_decoys_partly() {
    (0..12u64).into_par_iter().for_each(|seed| {
        let scenario = draw(Kind::Confounded, seed);
        let twin = scenario.truth.confusable_with[0];
        assert_ne!(twin, scenario.truth.cause());
        let found = correlation(&scenario.data, column(scenario.truth.cause()), column(twin));
        assert!(found > 0.999, "{seed}: {found}");

        let scenario = draw(Kind::Decoy, seed);
        let decoy = &scenario.truth.decoys[0];
        let found = correlation(&scenario.data, decoy.follows, decoy.column);
        assert!((0.78..0.96).contains(&found), "{seed}: {found}, truth {}", decoy.correlation);
        assert!((found - decoy.correlation).abs() < 0.03, "{seed}: {found}");
        assert_eq!(decoy.follows, column(scenario.truth.cause()));
    });
}

#[test]
fn benchmark_scenarios_have_valid_logs_and_effect_sizes() {
    let scenarios: Vec<(Kind, u64)> = benchmark(21, 1).collect();
    scenarios.into_par_iter().for_each(|(kind, seed)| {
        let Scenario { data, truth, .. } = draw(kind, seed);
        assert!((6..=40).contains(&data.runs.len()), "{kind:?} {seed}");
        assert!((8_000..=40_000).contains(&data.rows), "{kind:?} {seed}: {} rows", data.rows);
        assert!((100.0..=2000.0).contains(&truth.rate_hz));
        assert!((0.02..=0.2).contains(&truth.noise_nm), "{kind:?} {seed}: {}", truth.noise_nm);
        let mut before = f64::NEG_INFINITY;
        for run in &data.runs {
            for &t in &run.time_s {
                assert!(t > before, "{kind:?} {seed}: time does not increase at {t}");
                before = t;
            }
            // Bounds: 100 rpm, and the torque of a seal under all loads.
            assert!(run.velocity.iter().all(|v| v.abs() < 10.6), "{kind:?} {seed}");
            assert!(run.torque.iter().all(|t| t.abs() < 15.0), "{kind:?} {seed}");
        }
        let expected = match kind {
            Kind::None => 0,
            Kind::Two(..) => 2,
            _ => 1,
        };
        assert_eq!(truth.hidden.len(), expected);
        for hidden in &truth.hidden {
            let over_noise = hidden.visible_rms_nm / truth.noise_nm;
            let over_level = hidden.visible_rms_nm / truth.seal.coulomb_nm;
            assert!((0.3..=3.0).contains(&over_noise), "{kind:?} {seed}: {over_noise}");
            assert!((0.01..=0.4).contains(&over_level), "{kind:?} {seed}: {over_level}");
            for name in &hidden.columns {
                let there = data.column(&data.runs[0], name).is_some();
                assert!(there || *name == "acceleration_rad_s2", "{kind:?} {seed}: no {name}");
            }
        }
        let order =
            truth.hidden.windows(2).all(|two| two[0].visible_rms_nm >= two[1].visible_rms_nm);
        assert!(order, "{kind:?} {seed}: effects must be sorted by size");
    });
}

#[test]
fn draw_without_own_columns_omits_the_column_of_the_effect() {
    let options = Options { without_own_columns: true, ..Options::default() };
    let effects = [
        HiddenCause::PressureCoulomb,
        HiddenCause::TemperatureViscous,
        HiddenCause::PositionRipple,
    ];
    for effect in effects {
        let scenario = draw_with(effect, None, 8, &options);
        let name = effect.column().unwrap();
        assert_eq!(scenario.data.column(&scenario.data.runs[0], name), None);
        assert_eq!(scenario.truth.missing_columns, [name]);
    }
}

#[test]
fn csv_of_scenario_read_back_equals_its_data_set() {
    let folder = tempfile::tempdir().unwrap();
    for (at, (kind, seed)) in benchmark(31, 1).step_by(3).enumerate() {
        let scenario = draw(kind, seed);
        let path = folder.path().join(format!("{at}.csv"));
        fs::write(&path, &scenario.csv).unwrap();
        let back = read(&[path], &ReadOptions::default(), &|_, _| {}).unwrap();
        assert_eq!(back.runs, scenario.data.runs, "{kind:?} {seed}");
        assert_eq!(back.covariates, scenario.data.covariates);
        assert_eq!((back.rows, back.bad_rows.count), (scenario.data.rows, 0));
    }
}

#[test]
fn pairs_consist_of_different_causes_of_the_catalogue() {
    for (one, other) in PAIRS {
        assert!(one != other && ![one, other].contains(&HiddenCause::OutsideCatalogue));
    }
}

//! Fits simulated joints with known parameters and checks the estimates and their standard errors.
//!
//! The joints are drawn from the ranges of Ding et al. [`simulated_machines`] simulates them with its own state and
//! integrator, without code of the core. Two standard errors must contain the true parameter in 95.4 % of the cases. A
//! smaller share indicates a bias or standard errors that are too small, a larger share standard errors that are too
//! large. The test has limits on both sides.

use compensator_core::ParameterId as Id;
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Outcome, Rows, State, identify, tracks};
use joint_rig::simulated;
use rayon::prelude::*;
use simulated_machines::{Recording, Truth, record};
use std::ops::Range;

/// Number of joints, and limits on the deviations of the estimates, in standard errors.
struct CoverageLimits {
    seeds: u64,
    /// Minimum number of deviations below two, for each parameter.
    hits: usize,
    /// Range of the root mean square deviation of each parameter.
    rms: Range<f64>,
    /// Range of the share of all deviations below two, %.
    share: Range<f64>,
}

/// Of 100 deviations, 95.4 are expected below two; fewer than 89 have a probability of 1/300. The parameters of one fit
/// are correlated, so 900 deviations have the weight of about 300, and the standard error of the share is 1.2 %.
const LONG: CoverageLimits =
    CoverageLimits { seeds: 100, hits: 89, rms: 0.75..1.25, share: 92.5..98.0 };

/// Of 25 deviations, fewer than 20 below two have a probability of 1/1000. The standard error of the share is 2.4 %.
const SHORT: CoverageLimits =
    CoverageLimits { seeds: 25, hits: 20, rms: 0.6..1.4, share: 89.0..99.5 };

fn limits() -> CoverageLimits {
    if crate::is_long() { LONG } else { SHORT }
}

fn fit(truth: &Truth, model: &str) -> Outcome {
    let tracks = tracks(&simulated::dataset(truth.log()));
    let rows = Rows { tracks: &tracks, decimate: 1 };
    let spec = Spec::parse(model).unwrap();
    let options = FitOptions { starts: 1, ..FitOptions::default() };
    identify(&spec, &spec.parameters().unwrap(), rows, rows, &options)
}

fn true_value(truth: &Truth, id: Id) -> f64 {
    let seal = &truth.seal;
    match id {
        Id::CoulombTorque => seal.coulomb_nm,
        Id::StaticTorque => seal.static_nm,
        Id::StribeckVelocity => seal.stribeck_rad_s,
        Id::BristleStiffness => seal.k0,
        Id::BristleDamping => seal.k1,
        Id::ViscousFriction => seal.k2,
        Id::RadialForceCoulomb => seal.per_force,
        Id::PressureCoulomb => seal.per_pressure,
        Id::RadialForceRate => seal.eta3,
        other => panic!("{} is not in the plant", other.name()),
    }
}

/// Returns the deviations of each parameter over all seeds, in standard errors.
fn deviations(model: &str, how: Recording, seeds: u64) -> Vec<(Id, Vec<f64>)> {
    let fits: Vec<(Truth, Outcome)> = (0..seeds)
        .into_par_iter()
        .map(|seed| {
            let truth = record(1000 + seed, how);
            let outcome = fit(&truth, model);
            (truth, outcome)
        })
        .collect();
    let fitted = fits[0].1.estimates.iter().filter(|estimate| estimate.std_error.is_some());
    let ids: Vec<Id> = fitted.map(|estimate| estimate.id).collect();
    let deviation = |(truth, outcome): &(Truth, Outcome), id: Id| {
        let estimate = outcome.estimates.iter().find(|estimate| estimate.id == id).unwrap();
        (estimate.value - true_value(truth, id)) / estimate.std_error.unwrap()
    };
    ids.into_iter().map(|id| (id, fits.iter().map(|fit| deviation(fit, id)).collect())).collect()
}

fn assert_covered(model: &str, how: Recording) {
    let limits = limits();
    let deviations = deviations(model, how, limits.seeds);
    let within = |all: &[f64]| all.iter().filter(|d| d.abs() <= 2.0).count();
    let (mut hits, mut total) = (0, 0);
    for (id, all) in &deviations {
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let rms = (all.iter().map(|d| d * d).sum::<f64>() / all.len() as f64).sqrt();
        let hit = within(all);
        eprintln!("{model} {:24} {hit:3} of {} mean {mean:+.2} rms {rms:.2}", id.name(), all.len());
        assert!(hit >= limits.hits, "{}: only {hit} within two standard errors", id.name());
        assert!(limits.rms.contains(&rms), "{}: errors wrong by {rms:.2}", id.name());
        hits += hit;
        total += all.len();
    }
    let share = 100.0 * hits as f64 / total as f64;
    eprintln!("{model}: {share:.1} % of {total} within two standard errors");
    assert!(limits.share.contains(&share), "{share:.1} % within two standard errors");
}

#[test]
fn identify_lugre_covers_true_parameters_within_errors() {
    let how = Recording { runs: 4, seconds: 5.0, loaded: false, ..Recording::default() };
    assert_covered("lugre", how);
}

#[test]
fn identify_improved_lugre_covers_true_parameters_within_errors() {
    if !crate::is_long() {
        println!("skipped: coverage of the improved LuGre model's parameters: tests/run --all");
        return;
    }
    let how = Recording { runs: 8, seconds: 3.0, ..Recording::default() };
    assert_covered("improved-lugre", how);
}

#[test]
fn identify_with_steady_sliding_reports_bristles_not_determined() {
    let how = Recording { steady: true, loaded: false, runs: 6, ..Recording::default() };
    let truth = record(7, how);
    // Use the middle of each run, where sliding is steady.
    let mut data = simulated::dataset(truth.log());
    for run in &mut data.runs {
        *run = run.slice(2000..run.len());
    }
    let tracks = tracks(&data);
    let rows = Rows { tracks: &tracks, decimate: 1 };
    let spec = Spec::parse("lugre").unwrap();
    let base = spec.parameters().unwrap();
    let outcome = identify(&spec, &base, rows, rows, &FitOptions::default());
    let state = |id| outcome.estimates.iter().find(|e| e.id == id).unwrap().state;
    for id in [Id::BristleStiffness, Id::BristleDamping, Id::StribeckVelocity, Id::StaticTorque] {
        assert_ne!(state(id), State::Determined, "{}", id.name());
    }
    for id in [Id::CoulombTorque, Id::ViscousFriction] {
        assert_eq!(state(id), State::Determined, "{}", id.name());
    }
    let verdicts = outcome.verdicts.join("\n");
    assert!(verdicts.contains("always fully slipping"), "{verdicts}");
    assert!(verdicts.contains("bristle_stiffness: "), "{verdicts}");
}

//! The compared arms: one driver with seven friction models, all but the last identified on the plant's bench runs.
//!
//! | arm | fitted on |
//! |---|---|
//! | none | - (compensation share 0) |
//! | coulomb + viscous | all bench runs |
//! | LuGre, as published | runs without side load and pressure (II-B) |
//! | LuGre, refitted | all bench runs |
//! | improved LuGre | all bench runs (eq. 16) |
//! | diagnosed | all bench runs, base and terms by `diagnose` |
//! | perfect | - the plant's own friction, from an ideal actuator at the same share and current limit |

use super::campaign::BenchRuns;
use crate::PaperError;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::configuration::Configuration;
use compensator_core::{LawKind, Parameters};
use firmware::control::MotorParameters;
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::Thresholds;
use friction_diagnose::{Diagnosis, DiagnosisOptions, diagnose};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Outcome, Rows, identify, tracks};
use joint_log::log_check::{self, Corrections};
use joint_log::{Dataset, SplitRule, split};
use rayon::prelude::*;

/// Compensated share of the friction, the driver's default; the same for all arms.
pub const COMPENSATED_SHARE: f64 = 0.9;

/// Specified maximum side load, N; a landing goes far beyond the loads of the bench.
const RADIAL_FORCE_MAX_N: f32 = 400.0;

/// A compared driver.
#[derive(Clone, Debug)]
pub struct DriverArm {
    /// Name on the page.
    pub name: &'static str,
    /// Parameter set of the driver.
    pub set: ParameterSet,
    /// Share of the plant's friction that an ideal actuator compensates.
    pub perfect: Option<f64>,
    /// The fit; `None` for the first and the last arm.
    pub fit: Option<Outcome>,
}

/// Name of the arm; the names below are in the order of the arms.
pub const NONE: &str = "no compensation";
/// See [`NONE`].
pub const COULOMB: &str = "Coulomb + viscous";
/// See [`NONE`].
pub const PUBLISHED: &str = "LuGre, as published";
/// See [`NONE`].
pub const REFITTED: &str = "LuGre, refitted";
/// See [`NONE`].
pub const IMPROVED: &str = "improved LuGre";
/// See [`NONE`].
pub const DIAGNOSED: &str = "diagnosed";
/// See [`NONE`].
pub const PERFECT: &str = "perfect model";

/// Current at which the driver stops a joint that has not moved, A. The leg holds its weight with 5.7 A before it jumps, so
/// that the default of 5 A would stop it as `motor-stands`.
const STALL_CURRENT_A: f32 = 12.0;

/// Returns the driver's parameter set with this model and compensated share.
pub fn driver_set(model: Parameters<f32>, share: f64) -> ParameterSet {
    let compensator =
        CompensatorParameters { scale: share as f32, ..CompensatorParameters::default() };
    let mut set = ParameterSet {
        friction: Configuration { model, compensator },
        motor: MotorParameters { inertia_kg_m2: 0.12, ..MotorParameters::default() },
        thresholds: Thresholds { stall_current_a: STALL_CURRENT_A, ..Thresholds::default() },
        ..ParameterSet::default()
    };
    let envelope = &mut set.friction.model.envelope;
    *envelope = compensator_core::parameters::Envelope::default();
    envelope.radial_force_max_n = RADIAL_FORCE_MAX_N;
    envelope.pressure_diff_max_pa = 4e5;
    set
}

fn fit_arm(name: &'static str, spec: &str, data: &[&Dataset]) -> Result<DriverArm, PaperError> {
    let spec = Spec::parse(spec).map_err(PaperError::source)?;
    let tracks: Vec<_> = data.iter().flat_map(|data| tracks(data)).collect();
    let rows = Rows { tracks: &tracks, decimate: 1 };
    // A joint driver requires a passive law.
    let options = FitOptions { passive: true, starts: 2, ..FitOptions::default() };
    let parameters = spec.parameters().map_err(PaperError::source)?;
    let fit = identify(&spec, &parameters, rows, rows, &options);
    Ok(arm_from_fit(name, fit))
}

fn arm_from_fit(name: &'static str, fit: Outcome) -> DriverArm {
    let form = fit.for_driver();
    let mut set = driver_set(form.parameters.convert::<f32>(), COMPENSATED_SHARE);
    // The band of the watch is the error on the fitted rows.
    set.watch.band_nm = form.train.rmse as f32;
    DriverArm { name, set, perfect: None, fit: Some(fit) }
}

/// Diagnoses the runs with a third of them held out once. Leaving every run out once would take minutes.
fn diagnose_bench_runs(data: &Dataset) -> Result<Diagnosis, PaperError> {
    let checked = log_check::check(data.clone(), Corrections::default());
    let parts = split(&checked.data, &SplitRule::default(), 0).map_err(PaperError::source)?;
    let question =
        DiagnosisOptions { log_findings: checked.findings, ..DiagnosisOptions::default() };
    diagnose(&checked.data, &parts, &question, &|_| {}).map_err(PaperError::source)
}

/// Returns the diagnosed model for the driver, refitted as passive if it is active.
fn diagnosed_arm(diagnosis: &Diagnosis, data: &Dataset) -> Result<DriverArm, PaperError> {
    let found = diagnosis.transferable_model();
    if !found.parameters.choices.allow_active {
        return Ok(arm_from_fit(DIAGNOSED, found));
    }
    let mut start = found.parameters.clone();
    start.choices.allow_active = false;
    let free: Vec<_> =
        found.estimates.iter().filter(|e| e.std_error.is_some()).map(|e| e.id).collect();
    let fixed = start.active().filter(|id| !free.contains(id)).collect();
    let options = FitOptions {
        passive: true,
        starts: 1,
        start: Some(start.clone()),
        fixed,
        ..FitOptions::default()
    };
    let follows = diagnosis.auxiliary.as_deref();
    let tracks = friction_fit::tracks_with(data, follows);
    let rows = Rows { tracks: &tracks, decimate: 1 };
    let fit = identify(&found.spec, &start, rows, rows, &options);
    Ok(arm_from_fit(DIAGNOSED, fit))
}

/// Returns all arms, and the diagnosis of the sixth.
///
/// # Errors
/// Returns one line if a fit or the diagnosis fails.
pub fn arms(campaign: &BenchRuns) -> Result<(Vec<DriverArm>, Diagnosis), PaperError> {
    let plain = || driver_set(Parameters::new(LawKind::Lugre), 0.0);
    let all = &campaign.all;
    let jobs: [(&'static str, &str, &Dataset); 4] = [
        (COULOMB, "linear", all),
        (PUBLISHED, "lugre", &campaign.unloaded),
        (REFITTED, "lugre", all),
        (IMPROVED, "improved-lugre", all),
    ];
    let (fits, diagnosis) = rayon::join(
        || {
            let fits = jobs.par_iter().map(|(name, spec, data)| fit_arm(name, spec, &[data]));
            fits.collect::<Result<Vec<DriverArm>, PaperError>>()
        },
        || diagnose_bench_runs(&campaign.diagnosed),
    );
    let (fits, diagnosis) = (fits?, diagnosis?);
    let mut arms = vec![DriverArm { name: NONE, set: plain(), perfect: None, fit: None }];
    arms.extend(fits);
    arms.push(diagnosed_arm(&diagnosis, all)?);
    arms.push(DriverArm {
        name: PERFECT,
        set: plain(),
        perfect: Some(COMPENSATED_SHARE),
        fit: None,
    });
    Ok((arms, diagnosis))
}

//! Who is compared: the same driver with seven friction models, all but the last identified on the plant's own bench runs.
//!
//! | arm | fitted on |
//! |---|---|
//! | none | - (compensation share 0) |
//! | coulomb + viscous | all bench runs |
//! | LuGre, as published | runs without side load and pressure (II-B) |
//! | LuGre, refitted | all bench runs |
//! | improved LuGre | all bench runs (eq. 16) |
//! | diagnosed | all bench runs, base and terms by `diagnose` |
//! | perfect | - the plant's own friction, given back by an ideal actuator at the same share, within the same current limit |

use super::campaign::Campaign;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::configuration::Configuration;
use compensator_core::{LawKind, Parameters};
use firmware::control::MotorParameters;
use firmware::parameter_set::ParameterSet;
use firmware::supervisor::Thresholds;
use friction_identification::data::{Dataset, SplitRule, split};
use friction_identification::diagnose::{Diagnosis, Question, diagnose};
use friction_identification::fit::{FitOptions, Outcome, Rows, identify, tracks};
use friction_identification::log_check::{self, Correct};
use friction_identification::spec::Spec;
use rayon::prelude::*;

/// Share of the friction that is compensated: the driver's default, of all arms.
pub const SHARE: f64 = 0.9;

/// Side load the models are declared for, N: a landing is far beyond what the bench knew.
const RADIAL_FORCE_MAX_N: f32 = 400.0;

/// One of those compared.
#[derive(Clone, Debug)]
pub struct Arm {
    /// Its name on the page.
    pub name: &'static str,
    /// The driver's whole set.
    pub set: ParameterSet,
    /// Share of the plant's friction an ideal actuator gives back.
    pub perfect: Option<f64>,
    /// The fit; none of the first and last.
    pub fit: Option<Outcome>,
}

/// Names of the arms, in order.
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

/// A current at which a joint that has not moved yet is stopped, A: the leg holds its weight by 5.7 before it jumps, and at the 5 of
/// the default the driver stopped it as `motor-stands` before its jump.
const STALL_A: f32 = 12.0;

/// The driver's set with this model, at a share of its friction.
pub fn driver_set(model: Parameters<f32>, share: f64) -> ParameterSet {
    let compensator =
        CompensatorParameters { scale: share as f32, ..CompensatorParameters::default() };
    let mut set = ParameterSet {
        friction: Configuration { model, compensator },
        motor: MotorParameters { inertia_kg_m2: 0.12, ..MotorParameters::default() },
        thresholds: Thresholds { stall_current_a: STALL_A, ..Thresholds::default() },
        ..ParameterSet::default()
    };
    let envelope = &mut set.friction.model.envelope;
    *envelope = compensator_core::parameters::Envelope::default();
    envelope.radial_force_max_n = RADIAL_FORCE_MAX_N;
    envelope.pressure_diff_max_pa = 4e5;
    set
}

fn fitted(name: &'static str, spec: &str, data: &[&Dataset]) -> Result<Arm, String> {
    let spec = Spec::parse(spec).map_err(|error| error.to_string())?;
    let tracks: Vec<_> = data.iter().flat_map(|data| tracks(data)).collect();
    let rows = Rows { tracks: &tracks, decimate: 1 };
    // As a joint driver asks for: a law that gives out no energy.
    let options = FitOptions { passive: true, starts: 2, ..FitOptions::default() };
    let parameters = spec.parameters().map_err(|error| error.to_string())?;
    let fit = identify(&spec, &parameters, rows, rows, &options).map_err(|e| e.to_string())?;
    Ok(arm_of(name, fit))
}

fn arm_of(name: &'static str, fit: Outcome) -> Arm {
    let mut set = driver_set(fit.parameters.convert::<f32>(), SHARE);
    // What the model promises is what it left on the runs it was fitted on.
    set.watch.band_nm = fit.train.rmse as f32;
    Arm { name, set, perfect: None, fit: Some(fit) }
}

/// The diagnosis, judged on a third of the runs, held out once: every run left out once would take minutes.
fn diagnosis_of(data: &Dataset) -> Result<Diagnosis, String> {
    let checked = log_check::check(data.clone(), Correct::default());
    let parts = split(&checked.data, &SplitRule::default(), 0).map_err(|e| e.to_string())?;
    let question = Question { log_findings: checked.findings, ..Question::default() };
    diagnose(&checked.data, &parts, &question, &|_| {}).map_err(|e| e.to_string())
}

/// The diagnosed model as a driver takes it: made passive, where the runs would have it active.
fn diagnosed(diagnosis: &Diagnosis, data: &Dataset) -> Result<Arm, String> {
    let found = diagnosis.handed_out();
    if !found.parameters.choices.allow_active {
        return Ok(arm_of(DIAGNOSED, found));
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
    let tracks = friction_identification::fit::tracks_with(data, follows);
    let rows = Rows { tracks: &tracks, decimate: 1 };
    let fit = identify(&found.spec, &start, rows, rows, &options).map_err(|e| e.to_string())?;
    Ok(arm_of(DIAGNOSED, fit))
}

/// All arms, and the diagnosis behind the sixth.
///
/// # Errors
/// A fit or the diagnosis fails; one line.
pub fn arms(campaign: &Campaign) -> Result<(Vec<Arm>, Diagnosis), String> {
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
            let fits = jobs.par_iter().map(|(name, spec, data)| fitted(name, spec, &[data]));
            fits.collect::<Result<Vec<Arm>, String>>()
        },
        || diagnosis_of(&campaign.diagnosed),
    );
    let (fits, diagnosis) = (fits?, diagnosis?);
    let mut arms = vec![Arm { name: NONE, set: plain(), perfect: None, fit: None }];
    arms.extend(fits);
    arms.push(diagnosed(&diagnosis, all)?);
    arms.push(Arm { name: PERFECT, set: plain(), perfect: Some(SHARE), fit: None });
    Ok((arms, diagnosis))
}

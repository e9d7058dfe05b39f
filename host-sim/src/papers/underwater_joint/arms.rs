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
//! | perfect | - the plant's own friction, given back by an ideal actuator at the same share |

use super::campaign::Campaign;
use crate::benchmark::ask;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::configuration::Configuration;
use compensator_core::{LawKind, Parameters};
use firmware::control::MotorParameters;
use firmware::parameter_set::ParameterSet;
use friction_identification::data::Dataset;
use friction_identification::diagnose::{Diagnosis, Question};
use friction_identification::fit::{FitOptions, Outcome, Rows, identify, tracks};
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

/// The driver's set with this model, at a share of its friction.
pub fn driver_set(model: Parameters<f32>, share: f64) -> ParameterSet {
    let compensator =
        CompensatorParameters { scale: share as f32, ..CompensatorParameters::default() };
    let mut set = ParameterSet {
        friction: Configuration { model, compensator },
        motor: MotorParameters { inertia_kg_m2: 0.12, ..MotorParameters::default() },
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
    let set = driver_set(fit.parameters.convert::<f32>(), SHARE);
    Arm { name, set, perfect: None, fit: Some(fit) }
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
        || ask(all.clone(), &Question::default()),
    );
    let (fits, (diagnosis, _)) = (fits?, diagnosis?);
    let mut arms = vec![Arm { name: NONE, set: plain(), perfect: None, fit: None }];
    arms.extend(fits);
    arms.push(arm_of(DIAGNOSED, diagnosis.handed_out()));
    arms.push(Arm { name: PERFECT, set: plain(), perfect: Some(SHARE), fit: None });
    Ok((arms, diagnosis))
}

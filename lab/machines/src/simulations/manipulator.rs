//! Simulation of the manipulator.

use crate::manipulator::course::{FILLED_PA, SECONDS};
use crate::manipulator::{Campaign, Recording, campaign, friction, rigid_body};
use serde_json::{Value, json};
use simulated_machines::{Request, Simulated, Simulation, SimulationError};

/// The arm with three joints and fluidic muscles: the course of the paper, and others for validation.
pub const MANIPULATOR: Simulation = Simulation {
    name: "manipulator",
    about: "An arm of three joints on fluidic muscles, all joints in one log, ten repeats averaged",
    run: simulate,
};

/// Default number of runs: the course of the paper and one more.
const DEFAULT_RUNS: usize = 2;

/// Maximum number of rows of all runs.
const MAX_ROWS: f64 = 5e6;

/// Runs the simulation.
fn simulate(request: &Request) -> Result<Simulated, SimulationError> {
    if request.unloaded || request.steady || !request.hide.is_empty() {
        let options = "manipulator: --unloaded, --steady and --hide are not supported";
        return Err(SimulationError::Unsupported { options });
    }
    let default = Recording::default();
    let how = Recording {
        seconds: request.seconds.unwrap_or(SECONDS),
        rate_hz: request.rate_hz.unwrap_or(default.rate_hz),
        noise_nm: request.noise_nm.unwrap_or(default.noise_nm),
        ..default
    };
    let runs = request.runs.unwrap_or(DEFAULT_RUNS);
    if how.seconds * how.rate_hz * runs as f64 > MAX_ROWS {
        return Err(SimulationError::TooManyRows { most: MAX_ROWS });
    }
    let campaign = campaign(request.seed, runs.saturating_sub(1), &how);
    let log = campaign.log().rounded();
    let truth = truth(request.seed, &how, &campaign);
    Ok(Simulated { truth, log, hidden: Vec::new() })
}

/// Returns the content of `truth.json`.
fn truth(seed: u64, how: &Recording, campaign: &Campaign) -> Value {
    let links = rigid_body::TABLE_2;
    let releases = |course: &crate::manipulator::Course| -> Value {
        let joint = |of: &Vec<crate::manipulator::course::Release>| -> Value {
            of.iter()
                .map(|release| {
                    json!({
                        "muscle": format!("{:?}", release.side).to_lowercase(),
                        "from_s": release.from_s, "until_s": release.until_s, "by_pa": release.by_pa,
                    })
                })
                .collect()
        };
        course.joints.iter().map(joint).collect()
    };
    let friction = |of: &friction::Friction| {
        json!({
            "coulomb_nm": of.coulomb_nm, "static_nm": of.static_nm, "stribeck_rad_s": of.stribeck_rad_s,
            "viscous_nm_s_rad": of.viscous, "thinning_rad_s": of.thinning_rad_s, "asymmetry": of.asymmetry,
            "by_pull": of.by_pull, "stiffness_nm_rad": of.stiffness,
        })
    };
    json!({
        "schema": 1,
        "origin": "simulated",
        "scenario": "manipulator",
        "seed": seed,
        "hidden": [],
        "recording": {
            "runs": campaign.runs.len(), "seconds": how.seconds, "rate_hz": how.rate_hz,
            "repeats_averaged": how.repeats, "torque_noise_nm": how.noise_nm, "filled_pa": FILLED_PA,
        },
        "rigid_body": {
            "length_2_m": links.length_2_m, "centre_2_m": links.centre_2_m, "centre_3_m": links.centre_3_m,
            "mass_2_kg": links.mass_2_kg, "mass_3_kg": links.mass_3_kg, "inertia_1_kg_m2": links.inertia_1_kg_m2,
            "inertia_2_kg_m2": links.inertia_2_kg_m2, "inertia_3_kg_m2": links.inertia_3_kg_m2,
        },
        "friction": friction::JOINTS.iter().map(friction).collect::<Vec<_>>(),
        "courses": campaign.courses.iter().map(releases).collect::<Vec<_>>(),
    })
}

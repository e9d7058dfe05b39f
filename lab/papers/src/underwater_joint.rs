//! The underwater joint of Ding et al.: identified on a bench, certified, and run in closed loop, on a simulated joint.
//!
//! ```text
//! bench runs of the plant -> fits and diagnosis -> arms          campaign, arms
//! held-out runs           -> estimation errors, CV tables        estimation
//! arms in the driver      -> three pool tests over seeds         tasks, experiments, measures
//! diagnosed parameters    -> into a running joint, over CAN      parameter_transfer
//! wrong models, sensors   -> harm, and reports of the watch      harm
//!                         -> rows, goals, page                   rows, goals, findings, page
//! ```
//! The authors' data are not public. Their protocol is repeated on [`simulated_machines::joint_plant`], which is richer than
//! any model here, and every result is marked as simulated.

mod arms;
mod campaign;
mod estimation;
mod experiments;
mod findings;
mod goals;
mod harm;
mod measures;
mod page;
mod parameter_transfer;
mod rows;
mod tasks;

use super::{Paper, PaperError, PaperOutcome, PaperRequest};
use arms::DriverArm;
use campaign::BenchRuns;
use friction_diagnose::Diagnosis;
use joint_log::Dataset;
use measures::Spread;
use paper_machines::bench::{Amount, Bench};
use simulated_machines::joint_plant::Parameters;
use simulated_machines::joint_plant::parameters::PHASE_RAD;
use stochastic_extension::Certificate;
use tasks::{Conditions, Task};

/// Water temperature of the joint's specification and of the bench runs, deg C; the paper states none.
///
/// With a constant temperature on the bench no model includes it, and the watch raises false alarms on warm days. In this
/// range the diagnosis names the temperature. Half the range (15 to 25) is too narrow for that.
const WATER_C: [f64; 2] = [10.0, 30.0];

/// The paper of the underwater joint.
pub struct UnderwaterJoint;

/// Extent of the computation.
#[derive(Clone, Copy, Debug)]
struct Extent {
    amount: Amount,
    seeds: u64,
    /// Days between two checks of the watch in the wear campaign.
    wear_days: u32,
    /// Days without wear, for counting false alarms.
    sound_days: u64,
    /// Duration of the sine in the map of harm, s.
    harm_s: f64,
}

const QUICK: Extent = Extent {
    amount: Amount { seconds: 4.0, both_motions: false, learned: 2, held_out: 8 },
    seeds: 3,
    wear_days: 10,
    sound_days: 2,
    harm_s: 8.0,
};
const FULL: Extent = Extent {
    // The paper's 8 x 50 runs. Runs twice as long take twice the time to fit.
    amount: Amount { seconds: 4.0, both_motions: true, learned: 10, held_out: 40 },
    seeds: 20,
    wear_days: 1,
    sound_days: 365,
    harm_s: 25.0,
};

/// All results.
struct JointStudy {
    amount: Amount,
    seeds: u64,
    parameters: Parameters,
    arms: Vec<DriverArm>,
    diagnosis: Diagnosis,
    /// Errors of the fitted arms at the three speeds, %.
    errors: Vec<(&'static str, [Spread; 3])>,
    /// Mean curves of the published and the diagnosed model.
    curves: Vec<(&'static str, Vec<estimation::Curves>)>,
    /// Certificates of the published, the improved and the diagnosed model.
    certificates: Vec<(&'static str, Certificate)>,
    tasks: Vec<(Task, Vec<experiments::TaskResult>)>,
    transfers: Vec<parameter_transfer::TransferResult>,
    round: parameter_transfer::RoundSealErrors,
    harm: Vec<harm::Circumstance>,
    harm_s: f64,
    wear: harm::WearCampaign,
}

impl Paper for UnderwaterJoint {
    fn name(&self) -> &'static str {
        "underwater-joint"
    }

    fn about(&self) -> &'static str {
        "The improved LuGre model of a sealed underwater joint (Ding et al.), on a simulated joint"
    }

    fn usual_minutes(&self, quick: bool) -> f64 {
        if quick { 1.0 } else { 6.0 }
    }

    fn title(&self) -> &'static str {
        "The underwater joint of Ding et al., simulated"
    }

    fn preface(&self) -> &'static str {
        "The data of Ding et al. (\"Enhancing Joint Dynamics Modeling for Underwater Robotics Through Stochastic Extension\") are not public. Their protocol is repeated on a simulated joint that is \
         richer than any model here, and every number on this page is simulated. Seven drivers are compared, one joint: without \
         compensation; with Coulomb and viscous friction; with plain LuGre fitted as published (unloaded runs alone), and refitted on \
         all runs; with the improved LuGre; with the model that `diagnose` finds; and with a perfect model, the plant's own friction."
    }

    fn run(&self, request: &PaperRequest) -> Result<PaperOutcome, PaperError> {
        let study = run_study(request)?;
        let rows = rows::rows(&study);
        let drops = goals::goals(&study);
        let summary = goals::summary(&study, &drops);
        let blocks = page::blocks(&study, &drops);
        let goals = goals::all(&study, &drops);
        let digest = vec![rows::digest(&rows, &study.arms), page::goal_table(&drops)];
        let rows = rows.into_iter().chain(goals::rows(&drops)).collect();
        Ok(PaperOutcome { rows, goals, summary, blocks, digest, files: Vec::new() })
    }
}

fn run_study(request: &PaperRequest) -> Result<JointStudy, PaperError> {
    let Extent { amount, seeds, wear_days, sound_days, harm_s } =
        if request.quick { QUICK } else { FULL };
    let parameters = Parameters::default();
    (request.progress)("bench runs");
    let bench =
        Bench { parameters, phase_rad: PHASE_RAD, temperature_c: WATER_C, seed: request.seed };
    let campaign = BenchRuns::measure(&bench, &amount);
    (request.progress)("fits and diagnosis");
    let (arms, diagnosis) = arms::arms(&campaign)?;
    (request.progress)("estimation errors");
    let fitted = || arms.iter().filter_map(|arm| Some((arm.name, arm.fit.as_ref()?)));
    let held_out = &campaign.held_out;
    let errors = fitted().map(|(name, fit)| (name, estimation::errors(fit, held_out))).collect();
    let shown = fitted().filter(|(name, _)| [arms::PUBLISHED, arms::DIAGNOSED].contains(name));
    let tracks = friction_fit::tracks(held_out);
    let curves = shown
        .map(|(name, fit)| (name, estimation::curves(fit, held_out, &tracks, |_| true)))
        .collect();
    (request.progress)("stochastic extension");
    let certificates = certificates(&arms, held_out, request.seed);
    let joint = Conditions {
        parameters,
        phase_rad: PHASE_RAD,
        faults: joint_rig::RigFaults::default(),
        temperature_c: parameters.water_temperature_c,
        wear: 1.0,
        seed: request.seed.wrapping_mul(1000),
        max_duration_s: f64::INFINITY,
    };
    let tasks = [Task::VelocityTracking, Task::LowSpeed, Task::Impact]
        .into_iter()
        .map(|task| {
            (request.progress)(task.title());
            Ok((task, experiments::run_experiment(task, &arms, &joint, seeds)?))
        })
        .collect::<Result<_, PaperError>>()?;
    let by_name = |name: &str| arms.iter().find(|arm| arm.name == name).ok_or(PaperError::NoArm);
    let (ours, perfect) = (by_name(arms::DIAGNOSED)?, by_name(arms::PERFECT)?);
    (request.progress)("diagnosed parameters into a running joint");
    let published = by_name(arms::PUBLISHED)?;
    let transfers = parameter_transfer::transfer_in_all_tasks(published, ours, &joint, seeds)?;
    let round = parameter_transfer::measure_round_seal(ours, perfect, &joint)?;
    (request.progress)("harm");
    let shorter = Conditions { max_duration_s: harm_s, ..joint };
    let harm = harm::harm_map(ours, by_name(arms::NONE)?, perfect, &shorter)?;
    (request.progress)("wear and watch");
    let wear = harm::simulate_wear(ours, &joint, wear_days, sound_days)?;
    Ok(JointStudy {
        amount,
        seeds,
        parameters,
        arms,
        diagnosis,
        errors,
        curves,
        certificates,
        tasks,
        transfers,
        round,
        harm,
        harm_s,
        wear,
    })
}

/// Certifies the published, the improved and the diagnosed model. One that cannot be certified is left out.
fn certificates(
    arms: &[DriverArm],
    held_out: &Dataset,
    seed: u64,
) -> Vec<(&'static str, Certificate)> {
    let names = [arms::PUBLISHED, arms::IMPROVED, arms::DIAGNOSED];
    let certified: Vec<&DriverArm> = arms.iter().filter(|arm| names.contains(&arm.name)).collect();
    let certificates = estimation::certificates(&certified, held_out, seed);
    let arms = certified.iter().zip(certificates);
    arms.filter_map(|(arm, certificate)| Some((arm.name, certificate?))).collect()
}

impl JointStudy {
    /// Returns the results of a task.
    fn task(&self, task: Task) -> &[experiments::TaskResult] {
        self.tasks.iter().find(|(known, _)| *known == task).map_or(&[], |(_, results)| results)
    }

    /// Returns a measure of a task for an arm.
    fn measured(&self, task: Task, arm: &str, measure: usize) -> Option<Spread> {
        self.task(task).iter().find(|result| result.arm == arm).map(|result| result.spread(measure))
    }

    /// Returns an arm's estimation error at a speed, %.
    fn error(&self, arm: &str, speed: usize) -> Option<Spread> {
        self.errors.iter().find(|(known, _)| *known == arm).map(|(_, errors)| errors[speed])
    }
}

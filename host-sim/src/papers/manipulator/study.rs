//! What is fitted and judged: each model inside the arm, as printed and properly, and on torques.

use super::arm::{Arm, Drive, JOINTS};
use super::bounded::Search;
use super::fit::{self, Course, Fitted, Judged, Problem, judge};
use super::printed::{MODELS, Model};
use super::torques::{Joint, OnTorques};
use ParameterId as Id;
use compensator_core::{LawKind, ParameterId, Parameters, TermKind};
use friction_identification::data::Dataset;
use friction_identification::fit::Outcome;
use rayon::prelude::*;
use simulated_machines::manipulator::record::COLUMNS;
use simulated_machines::manipulator::{Averaged, Campaign, Recording};
use simulated_machines::manipulator::{muscle::PAIRS, rigid_body::TABLE_2};

/// What is known of the arm.
pub const ARM: Arm = Arm { links: TABLE_2, pairs: PAIRS };

/// The search of the paper's tool, whose tolerances for values and sum are 1e-3 and whose limit is a hundred steps
/// unless told otherwise; the paper tells no other.
pub const PRINTED_SEARCH: Search = Search { scaled: false, tolerance: 1e-3, steps: 100 };

/// A search to the bottom.
const PROPER_SEARCH: Search = Search { scaled: true, tolerance: 1e-6, steps: 150 };

/// One that tells starts from each other.
const TRIAL_SEARCH: Search = Search { scaled: true, tolerance: 1e-4, steps: 40 };

/// Rows to a step of a trial.
const TRIAL_STRIDE: usize = 10;

/// How much is done.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Repeats that are averaged.
    pub repeats: usize,
    /// Courses to judge by.
    pub others: usize,
    /// Rows to a step of the fits on angles; they are judged with a step per row.
    pub stride: usize,
    /// Starts of a proper fit besides the one from torques.
    pub starts: usize,
    /// Campaigns the printed protocol is repeated on: the same arm on other days.
    pub again: u64,
    /// Every how many rows a torque is fitted.
    pub torque_stride: usize,
}

impl Extent {
    /// The short form.
    pub const QUICK: Self =
        Self { repeats: 3, others: 1, stride: 5, starts: 2, again: 1, torque_stride: 10 };
    /// The paper's ten repeats.
    pub const FULL: Self =
        Self { repeats: 10, others: 2, stride: 2, starts: 8, again: 3, torque_stride: 5 };
}

/// A model fitted one way, and how it does on every course, the one of the fit first.
pub struct Judgement {
    /// The fit.
    pub fitted: Fitted,
    /// How it does.
    pub judged: Vec<Judged>,
}

/// A model fitted both ways.
pub struct Study {
    /// Which.
    pub model: &'static Model,
    /// With the printed start and bounds.
    pub printed: Judgement,
    /// Properly.
    pub proper: Judgement,
    /// With what the joints' torques gave, nothing of it fitted to an angle.
    pub by_torques: Judgement,
}

/// A model on the torques of a joint, both ways.
pub struct TorqueStudy {
    /// With the printed start and bounds.
    pub printed: OnTorques,
    /// Properly.
    pub proper: Outcome,
}

/// What was logged, as what drove the arm and what it did.
pub fn courses(campaign: &Campaign, how: &Recording) -> Vec<Course> {
    let of = |(index, run): (usize, &Averaged)| {
        let column = |joint: usize, name: &str| {
            let at = COLUMNS.iter().position(|own| *own == name);
            run.joints[joint][at.unwrap_or_else(|| unreachable!("a column of the arm"))].clone()
        };
        let angles_rad: [Vec<f64>; JOINTS] = std::array::from_fn(|i| column(i, "position_rad"));
        let pressures_pa = std::array::from_fn(|i| {
            [column(i, "pressure_left_pa"), column(i, "pressure_right_pa")]
        });
        let start_rad = std::array::from_fn(|i| angles_rad[i][0]);
        let drive = Drive { period_s: 1.0 / how.rate_hz, pressures_pa, start_rad };
        let name =
            if index == 0 { "printed course".into() } else { format!("other course {index}") };
        Course { name, drive, angles_rad }
    };
    campaign.runs.iter().enumerate().map(of).collect()
}

/// The models of the paper on the torques of each joint: a list of joints for each model.
///
/// # Errors
/// One line: what of the log cannot be fitted.
pub fn torques(campaign: &Campaign, stride: usize) -> Result<Vec<Vec<TorqueStudy>>, String> {
    let names: Vec<String> =
        std::iter::once("time_s").chain(COLUMNS).take(4).map(str::to_owned).collect();
    let joints: Vec<Joint> = (0..JOINTS)
        .map(|joint| {
            let runs = campaign.runs.iter().enumerate().map(|(index, run)| {
                let thin = |column: &Vec<f64>| column.iter().step_by(stride).copied().collect();
                let own = run.joints[joint].iter().take(3);
                (index.to_string(), std::iter::once(&run.time_s).chain(own).map(thin).collect())
            });
            let data = Dataset::of_columns(&names, runs)?;
            let others: Vec<String> = (1..campaign.runs.len()).map(|i| i.to_string()).collect();
            let others: Vec<&str> = others.iter().map(String::as_str).collect();
            Joint::new(data, &others, &[])
        })
        .collect::<Result<_, String>>()?;
    MODELS
        .par_iter()
        .map(|model| joints.iter().map(|joint| both(joint, model.law)).collect())
        .collect()
}

/// A model on a joint's torques, both ways.
///
/// # Errors
/// One line.
pub fn both(joint: &Joint, law: LawKind) -> Result<TorqueStudy, String> {
    let rigid_body = joint.properly(LawKind::Linear)?.parameters;
    Ok(TorqueStudy {
        printed: joint.as_printed(law, &rigid_body, PRINTED_SEARCH)?,
        proper: joint.properly(law)?,
    })
}

/// A model inside the arm, both ways, fitted on the first course.
pub fn study(
    model: &'static Model,
    courses: &[Course],
    torques: &[TorqueStudy],
    extent: &Extent,
) -> Study {
    let judgement = |fitted: Fitted| {
        let on = |course: &Course| judge(&ARM, course, &fitted.parameters, fitted.deflection_rad);
        Judgement { judged: courses.iter().map(on).collect(), fitted }
    };
    Study {
        model,
        printed: judgement(as_printed(model, &courses[..1], extent)),
        proper: judgement(properly(model, &courses[..1], torques, extent)),
        by_torques: judgement(by_torques(torques)),
    }
}

/// Errors, deg, of a model fitted and judged by the printed protocol on another campaign.
pub fn printed_again(model: &Model, courses: &[Course], extent: &Extent) -> [f64; JOINTS] {
    let fitted = as_printed(model, courses, extent);
    judge(&ARM, &courses[0], &fitted.parameters, fitted.deflection_rad).rmse_deg
}

/// What the torques gave, as if it had been fitted to angles.
fn by_torques(torques: &[TorqueStudy]) -> Fitted {
    let of = |joint: usize| {
        let mut parameters = torques[joint].proper.parameters.clone();
        parameters.envelope.velocity_max_rad_s = f32::MAX;
        parameters
    };
    Fitted {
        parameters: std::array::from_fn(of),
        deflection_rad: [0.0; JOINTS],
        values: Vec::new(),
        start: Vec::new(),
        sum: 0.0,
        evaluations: 0,
        converged: true,
    }
}

fn base(law: LawKind) -> Parameters<f64> {
    let mut parameters = Parameters::new(law);
    // No speed is cut off: a fit is to see all of a trajectory.
    parameters.envelope.velocity_max_rad_s = f32::MAX;
    parameters
}

/// A joint with the printed form of the law, nothing of it fitted.
pub fn printed_base(law: LawKind) -> Parameters<f64> {
    let mut base = base(law);
    base.choices.printed_extended = true;
    base.choices.allow_active = true;
    base
}

fn problem<'a>(
    courses: &'a [Course],
    base: Parameters<f64>,
    free: Vec<fit::Free>,
    stride: usize,
) -> Problem<'a> {
    Problem { arm: &ARM, courses, base: std::array::from_fn(|_| base.clone()), free, stride }
}

fn as_printed(model: &Model, courses: &[Course], extent: &Extent) -> Fitted {
    let free = fit::printed_free(model.law);
    let start = vec![fit::PRINTED_START; free.len()];
    problem(courses, printed_base(model.law), free, extent.stride).fit(&start, PRINTED_SEARCH)
}

/// Levels of friction to begin from, Nm: a thirtieth of what the muscles of each joint can drive.
const LEVELS_NM: [f64; JOINTS] = [0.2, 0.6, 0.1];

/// Viscous coefficients to begin from, Nm s/rad: what damps each joint within some swings.
const VISCOUS: [f64; JOINTS] = [1.0, 2.0, 0.1];

/// Starts: a level beside [`LEVELS_NM`], and the travel over which bristles take it up, rad.
const STARTS: [(f64, f64); 8] = [
    (1.0, 0.01),
    (0.3, 0.003),
    (1.0, 0.03),
    (0.3, 0.03),
    (3.0, 0.01),
    (1.0, 0.003),
    (3.0, 0.1),
    (0.1, 0.01),
];

/// A model inside the arm, fitted on these courses from several starts, one of them what the torques gave.
pub fn properly(
    model: &Model,
    courses: &[Course],
    torques: &[TorqueStudy],
    extent: &Extent,
) -> Fitted {
    let mut with_offset = base(model.law);
    with_offset.add_term(TermKind::TorqueOffset);
    let fine = problem(courses, with_offset, fit::proper_free(model.law), extent.stride);
    let trial = Problem { stride: TRIAL_STRIDE, ..fine.clone() };
    let guess = |joint: usize, id: Option<Id>, share: f64, travel: f64| match id {
        Some(Id::CoulombTorque) => share * LEVELS_NM[joint],
        Some(Id::StaticTorque) => 1.3,
        Some(Id::StribeckVelocity) => 0.1,
        Some(Id::BristleStiffness) => share * LEVELS_NM[joint] / travel,
        Some(Id::BristleDamping) => 0.01,
        Some(Id::ViscousFriction) => VISCOUS[joint],
        Some(Id::AtanTorque) => 0.1 * share * LEVELS_NM[joint],
        Some(Id::AtanSlope) => 10.0,
        _ => 0.0,
    };
    // What the torques say is the best guess there is.
    let by_torques = |free: &fit::Free| {
        let found = &torques[free.joint].proper.parameters;
        match free.id {
            Some(Id::StaticTorque) => found.get(Id::StaticTorque) / found.get(Id::CoulombTorque),
            Some(id) => found.get(id),
            None => 0.0,
        }
    };
    let guessed = STARTS[..extent.starts].iter().map(|(share, travel)| {
        let of = |free: &fit::Free| guess(free.joint, free.id, *share, *travel);
        fine.free.iter().map(of).collect::<Vec<f64>>()
    });
    let starts = guessed.chain([fine.free.iter().map(by_torques).collect()]);
    let trials: Vec<Fitted> = starts.map(|start| trial.fit(&start, TRIAL_SEARCH)).collect();
    let tried: usize = trials.iter().map(|trial| trial.evaluations).sum();
    // The joints hang together loosely: the best of each, put together, is one more start.
    let errors: Vec<[f64; JOINTS]> = trials
        .iter()
        .map(|trial| judge(&ARM, &courses[0], &trial.parameters, trial.deflection_rad).sse_deg2)
        .collect();
    let best_on = |joint: usize| {
        let order =
            (0..trials.len()).min_by(|a, b| errors[*a][joint].total_cmp(&errors[*b][joint]));
        &trials[order.unwrap_or(0)]
    };
    let together: Vec<f64> =
        fine.free.iter().enumerate().map(|(at, free)| best_on(free.joint).values[at]).collect();
    let together = trial.fit(&together, TRIAL_SEARCH);
    let best = trials.iter().chain([&together]).min_by(|a, b| a.sum.total_cmp(&b.sum));
    let mut fitted = fine.fit(&best.unwrap_or(&together).values, PROPER_SEARCH);
    fitted.evaluations += tried + together.evaluations;
    fitted
}

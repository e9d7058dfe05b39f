//! Fits and evaluates each model within the arm, as printed and properly, and on torques.

use super::arm::{Arm, Drive, JOINTS};
use super::bounded::SearchOptions;
use super::fit::{self, ArmFit, Course, CourseErrors, Fitted, evaluate};
use super::printed::{MODELS, PrintedModel};
use super::torques::{Joint, TorqueFit};
use crate::PaperError;
use ParameterId as Id;
use compensator_core::{LawKind, ParameterId, Parameters, TermKind};
use friction_fit::Outcome;
use joint_log::Dataset;
use paper_machines::manipulator::record::COLUMNS;
use paper_machines::manipulator::{Averaged, Campaign, Recording};
use paper_machines::manipulator::{muscle::PAIRS, rigid_body::TABLE_2};
use rayon::prelude::*;

/// Known dynamics of the arm.
pub const ARM: Arm = Arm { links: TABLE_2, pairs: PAIRS };

/// Search of the paper's tool, with its default tolerances of 1e-3 and limit of 100 steps; the paper states no others.
pub const PRINTED_SEARCH: SearchOptions =
    SearchOptions { scaled: false, tolerance: 1e-3, steps: 100 };

/// Search for the minimum.
const PROPER_SEARCH: SearchOptions = SearchOptions { scaled: true, tolerance: 1e-6, steps: 150 };

/// Search for comparing starts.
const TRIAL_SEARCH: SearchOptions = SearchOptions { scaled: true, tolerance: 1e-4, steps: 40 };

/// Rows per step in a trial search.
const TRIAL_STRIDE: usize = 10;

/// Extent of the computation.
#[derive(Clone, Copy, Debug)]
pub struct Extent {
    /// Repeats of a run that are averaged.
    pub repeats: usize,
    /// Runs that are evaluated but not fitted.
    pub others: usize,
    /// Rows per step in the fits to angles; evaluation uses one step per row.
    pub stride: usize,
    /// Starts of a proper fit, besides the one from torques.
    pub starts: usize,
    /// Further campaigns for the printed protocol: the same arm on other days.
    pub repeated_campaigns: u64,
    /// Row interval of the fits to torques.
    pub torque_stride: usize,
}

impl Extent {
    /// The short form.
    pub const QUICK: Self = Self {
        repeats: 3,
        others: 1,
        stride: 5,
        starts: 2,
        repeated_campaigns: 1,
        torque_stride: 10,
    };
    /// The long form, with the paper's ten repeats.
    pub const FULL: Self = Self {
        repeats: 10,
        others: 2,
        stride: 2,
        starts: 8,
        repeated_campaigns: 3,
        torque_stride: 5,
    };
}

/// A fitted model with its errors in every run, the fitted run first.
pub struct EvaluatedFit {
    /// The fit.
    pub fitted: Fitted,
    /// Errors by run.
    pub errors: Vec<CourseErrors>,
}

/// A model fitted by every protocol.
pub struct ModelStudy {
    /// The model.
    pub model: &'static PrintedModel,
    /// With the printed start and bounds.
    pub printed: EvaluatedFit,
    /// By the proper protocol.
    pub proper: EvaluatedFit,
    /// With the parameters of the fit to the joints' torques, without a fit to angles.
    pub by_torques: EvaluatedFit,
}

/// A model fitted to the torques of a joint by both protocols.
pub struct TorqueStudy {
    /// With the printed start and bounds.
    pub printed: TorqueFit,
    /// By the proper protocol.
    pub proper: Outcome,
}

/// Returns the runs of a campaign as input pressures and angles.
pub fn courses(campaign: &Campaign, how: &Recording) -> Vec<Course> {
    let of = |(index, run): (usize, &Averaged)| {
        let column = |joint: usize, name: &str| {
            let at = COLUMNS.iter().position(|known| *known == name);
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

/// Fits the paper's models to the torques of each joint; returns a list of joints for each model.
///
/// # Errors
/// Returns one line if a log cannot be fitted.
pub fn fit_torques(
    campaign: &Campaign,
    stride: usize,
) -> Result<Vec<Vec<TorqueStudy>>, PaperError> {
    let names: Vec<String> =
        std::iter::once("time_s").chain(COLUMNS).take(4).map(str::to_owned).collect();
    let joints: Vec<Joint> = (0..JOINTS)
        .map(|joint| {
            let runs = campaign.runs.iter().enumerate().map(|(index, run)| {
                let thin = |column: &Vec<f64>| column.iter().step_by(stride).copied().collect();
                let columns = run.joints[joint].iter().take(3);
                (index.to_string(), std::iter::once(&run.time_s).chain(columns).map(thin).collect())
            });
            let data = Dataset::from_columns(&names, runs).map_err(PaperError::source)?;
            let others: Vec<String> = (1..campaign.runs.len()).map(|i| i.to_string()).collect();
            let others: Vec<&str> = others.iter().map(String::as_str).collect();
            Joint::new(data, &others, &[])
        })
        .collect::<Result<_, PaperError>>()?;
    MODELS
        .par_iter()
        .map(|model| joints.iter().map(|joint| fit_by_both_protocols(joint, model.law)).collect())
        .collect()
}

/// Fits a model to a joint's torques by both protocols.
///
/// # Errors
/// Returns one line if the model has too many terms.
pub fn fit_by_both_protocols(joint: &Joint, law: LawKind) -> Result<TorqueStudy, PaperError> {
    let rigid_body = joint.fit_properly(LawKind::Linear)?.parameters;
    Ok(TorqueStudy {
        printed: joint.fit_as_printed(law, &rigid_body, PRINTED_SEARCH)?,
        proper: joint.fit_properly(law)?,
    })
}

/// Fits a model within the arm by both protocols, to the first run, and evaluates it on all.
pub fn study_model(
    model: &'static PrintedModel,
    courses: &[Course],
    torques: &[TorqueStudy],
    extent: &Extent,
) -> ModelStudy {
    let evaluated = |fitted: Fitted| {
        let on =
            |course: &Course| evaluate(&ARM, course, &fitted.parameters, fitted.deflection_rad);
        EvaluatedFit { errors: courses.iter().map(on).collect(), fitted }
    };
    ModelStudy {
        model,
        printed: evaluated(fit_as_printed(model, &courses[..1], extent)),
        proper: evaluated(fit_properly(model, &courses[..1], torques, extent)),
        by_torques: evaluated(by_torques(torques)),
    }
}

/// Returns the errors, deg, of a model fitted and evaluated by the printed protocol in another campaign.
pub fn printed_protocol_errors(
    model: &PrintedModel,
    courses: &[Course],
    extent: &Extent,
) -> [f64; JOINTS] {
    let fitted = fit_as_printed(model, courses, extent);
    evaluate(&ARM, &courses[0], &fitted.parameters, fitted.deflection_rad).rmse_deg
}

/// Returns the parameters of the fit to torques as the result of a fit to angles.
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
    // No speed is limited, because a fit needs the whole trajectory.
    parameters.envelope.velocity_max_rad_s = f32::MAX;
    parameters
}

/// Returns the printed form of a law, with default parameters.
pub fn printed_base(law: LawKind) -> Parameters<f64> {
    let mut base = base(law);
    base.choices.printed_extended = true;
    base.choices.allow_active = true;
    base
}

fn problem<'a>(
    courses: &'a [Course],
    base: Parameters<f64>,
    free: Vec<fit::FreeValue>,
    stride: usize,
) -> ArmFit<'a> {
    ArmFit { arm: &ARM, courses, base: std::array::from_fn(|_| base.clone()), free, stride }
}

fn fit_as_printed(model: &PrintedModel, courses: &[Course], extent: &Extent) -> Fitted {
    let free = fit::printed_free(model.law);
    let start = vec![fit::PRINTED_START; free.len()];
    problem(courses, printed_base(model.law), free, extent.stride).fit(&start, PRINTED_SEARCH)
}

/// Initial friction levels, Nm: a thirtieth of the largest muscle torque of each joint.
const LEVELS_NM: [f64; JOINTS] = [0.2, 0.6, 0.1];

/// Initial viscous coefficients, Nm s/rad: they damp each joint within a few swings.
const VISCOUS: [f64; JOINTS] = [1.0, 2.0, 0.1];

/// Starts: friction level relative to [`LEVELS_NM`], and bristle deflection at sliding, rad.
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

/// Fits a model within the arm to these runs from several starts, one of them from the fit to torques.
pub fn fit_properly(
    model: &PrintedModel,
    courses: &[Course],
    torques: &[TorqueStudy],
    extent: &Extent,
) -> Fitted {
    let mut with_offset = base(model.law);
    with_offset.add_term(TermKind::TorqueOffset);
    let fine = problem(courses, with_offset, fit::proper_free(model.law), extent.stride);
    let trial = ArmFit { stride: TRIAL_STRIDE, ..fine.clone() };
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
    // The fit to torques gives the best start.
    let by_torques = |free: &fit::FreeValue| {
        let found = &torques[free.joint].proper.parameters;
        match free.id {
            Some(Id::StaticTorque) => found.get(Id::StaticTorque) / found.get(Id::CoulombTorque),
            Some(id) => found.get(id),
            None => 0.0,
        }
    };
    let guessed = STARTS[..extent.starts].iter().map(|(share, travel)| {
        let of = |free: &fit::FreeValue| guess(free.joint, free.id, *share, *travel);
        fine.free.iter().map(of).collect::<Vec<f64>>()
    });
    let starts = guessed.chain([fine.free.iter().map(by_torques).collect()]);
    let trials: Vec<Fitted> = starts.map(|start| trial.fit(&start, TRIAL_SEARCH)).collect();
    let tried: usize = trials.iter().map(|trial| trial.evaluations).sum();
    // The joints are weakly coupled, so the best values of each joint together give one more start.
    let errors: Vec<[f64; JOINTS]> = trials
        .iter()
        .map(|trial| evaluate(&ARM, &courses[0], &trial.parameters, trial.deflection_rad).sse_deg2)
        .collect();
    let best_on = |joint: usize| {
        let order =
            (0..trials.len()).min_by(|a, b| errors[*a][joint].total_cmp(&errors[*b][joint]));
        &trials[order.unwrap_or(0)]
    };
    let combined: Vec<f64> =
        fine.free.iter().enumerate().map(|(at, free)| best_on(free.joint).values[at]).collect();
    let combined = trial.fit(&combined, TRIAL_SEARCH);
    let best = trials.iter().chain([&combined]).min_by(|a, b| a.sum.total_cmp(&b.sum));
    let mut fitted = fine.fit(&best.unwrap_or(&combined).values, PROPER_SEARCH);
    fitted.evaluations += tried + combined.evaluations;
    fitted
}

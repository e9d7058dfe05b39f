//! The comparison of four friction models in an arm of three joints (the third paper; see `docs/references.md`).
//!
//! The paper fits linear, extended, atan and LuGre friction to the angles of its arm, from one start, between one
//! pair of bounds for every coefficient, on the very run it then judges by. Nobody has its data: here a simulated arm
//! of its Table 2 ([`simulated_machines::manipulator`]) follows its control signals, and the models are fitted
//! inside what is known of that arm ([`arm`], [`fit`]), once as the paper did it and once properly, both judged on a
//! run of other commands as well.

mod arm;
mod bounded;
mod fit;
mod printed;

use super::{Outcome, Paper, Request, Row};
use arm::{Arm, Drive, JOINTS};
use bounded::Search;
use compensator_core::{LawKind, ParameterId as Id, Parameters};
use fit::{Course, Fitted, Judged, Problem, judge};
use printed::{MODELS, Model};
use rayon::prelude::*;
use simulated_machines::manipulator::{Averaged, Campaign, Recording, campaign};
use simulated_machines::manipulator::{muscle::PAIRS, rigid_body::TABLE_2};

/// The paper.
pub struct Manipulator;

/// What is known of the arm.
const ARM: Arm = Arm { links: TABLE_2, pairs: PAIRS };

/// The search of the paper's tool, whose tolerances for values and sum are 1e-3 and whose limit is a hundred steps
/// unless told otherwise; the paper tells no other.
const PRINTED_SEARCH: Search = Search { scaled: false, tolerance: 1e-3, steps: 100 };

/// A search to the bottom.
const PROPER_SEARCH: Search = Search { scaled: true, tolerance: 1e-6, steps: 150 };

/// How much is done.
struct Extent {
    repeats: usize,
    others: usize,
    stride: usize,
    starts: usize,
}

impl Paper for Manipulator {
    fn name(&self) -> &'static str {
        "manipulator"
    }

    fn about(&self) -> &'static str {
        "Four friction models in an arm of three joints, as printed and done properly"
    }

    fn title(&self) -> &'static str {
        "Four friction models in an arm of three joints"
    }

    fn run(&self, request: &Request) -> Result<Outcome, String> {
        let extent = if request.quick {
            Extent { repeats: 3, others: 1, stride: 5, starts: 2 }
        } else {
            Extent { repeats: 10, others: 2, stride: 2, starts: 4 }
        };
        (request.progress)("recording the arm");
        let how = Recording { repeats: extent.repeats, ..Recording::default() };
        let campaign = campaign(request.seed, extent.others, &how);
        let courses = courses(&campaign, &how);
        let mut outcome = Outcome::default();
        for (protocol, fitted) in [
            (
                "printed",
                MODELS
                    .par_iter()
                    .map(|model| as_printed(model, &courses[0], &extent))
                    .collect::<Vec<_>>(),
            ),
            (
                "proper",
                MODELS
                    .par_iter()
                    .map(|model| proper(model, &courses[0], &extent))
                    .collect::<Vec<_>>(),
            ),
        ] {
            for (model, fitted) in MODELS.iter().zip(&fitted) {
                for (index, course) in courses.iter().enumerate() {
                    let Judged { rmse_deg, sse_deg2, largest_held_nm, .. } =
                        judge(&ARM, course, &fitted.parameters, fitted.deflection_rad);
                    eprintln!(
                        "{protocol} {} {}: {rmse_deg:.4?} held {largest_held_nm:.3?}",
                        model.name, course.name
                    );
                    for joint in 0..JOINTS {
                        let row = |column: &str, unit: &str, ours: f64, printed: f64| {
                            let name = format!("joint {}", joint + 1);
                            let row = Row::simulated(
                                &model.table.to_string(),
                                &name,
                                &format!("{column}, {protocol}, {}", course.name),
                                unit,
                                ours,
                            );
                            if index == 0 && protocol == "printed" {
                                row.printed(printed)
                            } else {
                                row
                            }
                        };
                        outcome.rows.push(row(
                            "RMSE",
                            "deg",
                            rmse_deg[joint],
                            model.rmse_deg[joint],
                        ));
                        outcome.rows.push(row("SSE", "deg^2", sse_deg2[joint], model.sse[joint]));
                    }
                }
                eprintln!(
                    "   {} evaluations converged {} {:.4?}",
                    fitted.evaluations, fitted.converged, fitted.values
                );
            }
        }
        Ok(outcome)
    }
}

/// What was logged, as what drove the arm and what it did.
fn courses(campaign: &Campaign, how: &Recording) -> Vec<Course> {
    let of = |(index, run): (usize, &Averaged)| {
        let joint = |joint: usize| &run.joints[joint];
        let drive = Drive {
            period_s: 1.0 / how.rate_hz,
            pressures_pa: std::array::from_fn(|i| [joint(i)[3].clone(), joint(i)[4].clone()]),
            start_rad: std::array::from_fn(|i| joint(i)[2][0]),
        };
        let name =
            if index == 0 { "printed course".into() } else { format!("other course {index}") };
        Course { name, drive, angles_rad: std::array::from_fn(|i| joint(i)[2].clone()) }
    };
    campaign.runs.iter().enumerate().map(of).collect()
}

fn base(law: LawKind) -> Parameters<f64> {
    let mut parameters = Parameters::new(law);
    // No speed is cut off: a fit is to see all of a trajectory.
    parameters.envelope.velocity_max_rad_s = f32::MAX;
    parameters
}

fn as_printed(model: &Model, course: &Course, extent: &Extent) -> Fitted {
    let mut base = base(model.law);
    base.choices.printed_extended = true;
    base.choices.allow_active = true;
    let free = fit::printed_free(model.law);
    let start = vec![fit::PRINTED_START; free.len()];
    let courses = std::slice::from_ref(course);
    let problem = Problem {
        arm: &ARM,
        courses,
        base: std::array::from_fn(|_| base.clone()),
        free,
        stride: extent.stride,
    };
    problem.fit(&start, PRINTED_SEARCH)
}

fn proper(model: &Model, course: &Course, extent: &Extent) -> Fitted {
    let free = fit::proper_free(model.law);
    let courses = std::slice::from_ref(course);
    let base = base(model.law);
    let problem = Problem {
        arm: &ARM,
        courses,
        base: std::array::from_fn(|_| base.clone()),
        free,
        stride: extent.stride,
    };
    let guess = |joint: usize, id: Option<Id>, level: f64, travel: f64| match id {
        Some(Id::CoulombTorque) => level,
        Some(Id::StaticTorque) => 1.3 * level,
        Some(Id::StribeckVelocity) => 0.1,
        Some(Id::BristleStiffness) => level / travel,
        Some(Id::BristleDamping) => 0.01,
        Some(Id::ViscousFriction) => [1.0, 2.0, 0.1][joint],
        Some(Id::AtanTorque) => 0.1 * level,
        Some(Id::AtanSlope) => 10.0,
        _ => 0.0,
    };
    let starts: Vec<(f64, f64)> = vec![(1.0, 0.01), (0.3, 0.003), (1.0, 0.05), (0.2, 0.03)];
    let fits: Vec<Fitted> = starts[..extent.starts]
        .iter()
        .map(|(share, travel)| {
            let start: Vec<f64> = problem
                .free
                .iter()
                .map(|free| {
                    guess(free.joint, free.id, share * [0.5, 2.0, 0.2][free.joint], *travel)
                })
                .collect();
            let fitted = problem.fit(&start, PROPER_SEARCH);
            eprintln!(
                "  proper {} start {share} {travel}: {} {} {}",
                model.name, fitted.sum, fitted.evaluations, fitted.converged
            );
            fitted
        })
        .collect();
    fits.into_iter().min_by(|a, b| a.sum.total_cmp(&b.sum)).expect("one start at least")
}

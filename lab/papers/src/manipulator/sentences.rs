//! Sentences about the results, made from the values: other values give other sentences.

use super::arm::JOINTS;
use super::fit::{Coordinate, Course, PRINTED_BOUNDS, PRINTED_START, printed_free, proper_free};
use super::measured::{HELD_OUT, RobotAxis};
use super::plausibility::{self, DrivingPower, SearchedValue};
use super::printed::{MODELS, SAMPLES};
use super::study::{ARM, EvaluatedFit, ModelStudy, TorqueStudy, printed_base};
use crate::Goal;
use compensator_core::{ParameterId as Id, Parameters};
use joint_log::number::significant;

/// Returns the models' indices, smallest error first.
fn rank(errors: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..errors.len()).collect();
    order.sort_by(|a, b| errors[*a].total_cmp(&errors[*b]));
    order
}

/// Lists the models with their errors, best first.
fn ranking_text(errors: &[f64]) -> String {
    let one = |model: &usize| format!("{} {}", MODELS[*model].name, significant(errors[*model], 3));
    rank(errors).iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Pairs of models, and how many of them two lists of errors put in the same order.
#[derive(Clone, Copy, Default)]
struct ModelPairs {
    same_order: usize,
    all: usize,
}

impl ModelPairs {
    /// Adds the pairs of two lists of errors of the same models.
    fn add(&mut self, ours: &[f64], theirs: &[f64]) {
        for (i, j) in (0..ours.len()).flat_map(|i| (0..i).map(move |j| (i, j))) {
            self.same_order += usize::from((ours[i] < ours[j]) == (theirs[i] < theirs[j]));
            self.all += 1;
        }
    }

    /// Compares the errors by the printed protocol with the printed ones, on all joints.
    fn as_in_print(studies: &[ModelStudy]) -> Self {
        let mut pairs = Self::default();
        (0..JOINTS).for_each(|joint| {
            pairs.add(&errors(studies, PRINTED, 0, joint), &printed_errors(joint));
        });
        pairs
    }
}

/// Returns the printed errors of the models on a joint, deg.
fn printed_errors(joint: usize) -> Vec<f64> {
    MODELS.iter().map(|model| model.rmse_deg[joint]).collect()
}

type Way = fn(&ModelStudy) -> &EvaluatedFit;

const PRINTED: Way = |study| &study.printed;
const PROPER: Way = |study| &study.proper;
const BY_TORQUES: Way = |study| &study.by_torques;

fn errors(studies: &[ModelStudy], way: Way, course: usize, joint: usize) -> Vec<f64> {
    studies.iter().map(|study| way(study).errors[course].rmse_deg[joint]).collect()
}

/// Returns the root mean square error over the runs that were not fitted.
fn held_out_errors(studies: &[ModelStudy], way: Way, joint: usize) -> Vec<f64> {
    let each = studies.iter().map(|study| {
        let others = &way(study).errors[1..];
        let squares: f64 = others.iter().map(|errors| errors.rmse_deg[joint].powi(2)).sum();
        (squares / others.len() as f64).sqrt()
    });
    each.collect()
}

/// Joins one text for each joint.
fn by_joint(of: impl Fn(usize) -> String) -> String {
    let joints = (0..JOINTS).map(|joint| format!("joint {}: {}", joint + 1, of(joint)));
    joints.collect::<Vec<_>>().join("; ")
}

/// Returns the summary sentences, most important first.
pub fn summary(
    studies: &[ModelStudy],
    courses: &[Course],
    torques: &[Vec<TorqueStudy>],
    repeats: &[Vec<[f64; JOINTS]>],
) -> Vec<String> {
    let mut sentences = vec![orders(studies)];
    sentences.extend(repeated(studies, repeats));
    sentences.push(protocol(studies, courses));
    sentences.extend(lugre_sentences(studies, courses, torques));
    sentences.extend(print_checks(courses));
    sentences.push(
        "simulated: the paper's data are not public; the arm is that of its Table 2, and we chose its muscles and the friction in \
         its joints, which is none of the four models"
            .to_owned(),
    );
    sentences
}

/// Returns the goals.
pub fn goals(
    studies: &[ModelStudy],
    courses: &[Course],
    torques: &[Vec<TorqueStudy>],
    measured: &[Option<RobotAxis>],
) -> Vec<Goal> {
    let pairs = ModelPairs::as_in_print(studies);
    let mut goals = vec![
        Goal::at_least(
            "with the printed start and bounds: pairs of models that stand as in print",
            "",
            pairs.same_order as f64,
            pairs.all as f64,
        )
        .remark(order_remark(studies)),
    ];
    let Some(lugre) = studies.iter().position(|study| study.model.law.has_bristles()) else {
        return goals;
    };
    let last = |all: &[f64]| rank(all).last() == Some(&lugre);
    let by_angles =
        (0..JOINTS).filter(|joint| last(&held_out_errors(studies, PROPER, *joint))).count();
    let by_torque = (0..JOINTS).filter(|joint| {
        last(&torques.iter().map(|joints| joints[*joint].proper.test.rmse).collect::<Vec<_>>())
    });
    let why = lugre_sentences(studies, courses, torques).split_off(1);
    goals.push(
        Goal::at_most(
            "properly, angles of unseen courses: joints on which LuGre is last",
            "",
            by_angles as f64,
            0.0,
        )
        .remark(why.join(". ") + "."),
    );
    goals.push(Goal::at_most(
        "properly, torques of unseen runs: joints on which LuGre is last",
        "",
        by_torque.count() as f64,
        0.0,
    ));
    goals.extend(measured_goals(measured, lugre));
    goals
}

/// States how far the models' errors are from each other and from the printed ones.
fn order_remark(studies: &[ModelStudy]) -> String {
    let (mut apart, mut least_below, mut most_below) = (0.0f64, f64::INFINITY, 0.0f64);
    for joint in 0..JOINTS {
        let ours = errors(studies, PRINTED, 0, joint);
        let order = rank(&ours);
        apart = apart.max(ours[order[ours.len() - 1]] / ours[order[0]]);
        for (ours, printed) in ours.iter().zip(printed_errors(joint)) {
            least_below = least_below.min(printed / ours);
            most_below = most_below.max(printed / ours);
        }
    }
    format!(
        "The friction in our arm's joints is our choice, and that of the paper is unknown. The four models' errors here lie within \
         a factor of {} of each other on every joint, and are {} to {} times below the printed: what separates the models in print is \
         not friction alone. Whether the order belongs to the arm or to one campaign is stated below, on further campaigns.",
        significant(apart, 2),
        significant(least_below, 2),
        significant(most_below, 2),
    )
}

/// Goals of the measured arm; `lugre` is the index of LuGre.
fn measured_goals(measured: &[Option<RobotAxis>], lugre: usize) -> [Goal; 2] {
    let axes: Vec<&RobotAxis> = measured.iter().flatten().collect();
    let last_axes = axes.iter().filter(|axis| {
        let errors: Vec<f64> = axis.models.iter().map(|study| study.proper.test.rmse).collect();
        rank(&errors).last() == Some(&lugre)
    });
    [
        Goal::at_least(
            "axes of a measured industrial arm in the same table",
            "",
            axes.len() as f64,
            measured.len() as f64,
        ),
        Goal::at_most(
            "properly, measured, run held out: axes on which LuGre is last",
            "",
            last_axes.count() as f64,
            0.0,
        ),
    ]
}

/// Compares the printed order of the models with ours.
fn orders(studies: &[ModelStudy]) -> String {
    let joints = by_joint(|joint| {
        let ours = errors(studies, PRINTED, 0, joint);
        format!("{} deg (printed {})", ranking_text(&ours), ranking_text(&printed_errors(joint)))
    });
    let ModelPairs { same_order, all } = ModelPairs::as_in_print(studies);
    let verdict = if same_order == all {
        "is reproduced".to_owned()
    } else {
        format!(
            "is not fully reproduced: {same_order} of {all} pairs of models stand as in print, chance gives {}",
            all / 2
        )
    };
    let same_worst: Vec<String> = (0..JOINTS)
        .filter(|joint| {
            let ours = errors(studies, PRINTED, 0, *joint);
            rank(&ours).last() == rank(&printed_errors(*joint)).last()
        })
        .map(|joint| (joint + 1).to_string())
        .collect();
    let worst = match same_worst.len() {
        0 => "on no joint the printed one".to_owned(),
        _ => format!("the printed one on joint {}", same_worst.join(" and ")),
    };
    format!(
        "with the printed start and bounds the printed order {verdict}; the worst model is {worst}. From the best: {joints}"
    )
}

/// States whether the order by the printed protocol is the same in other campaigns.
fn repeated(studies: &[ModelStudy], repeats: &[Vec<[f64; JOINTS]>]) -> Option<String> {
    let mut pairs = ModelPairs::default();
    for joint in 0..JOINTS {
        let first = errors(studies, PRINTED, 0, joint);
        for campaign in repeats {
            pairs.add(&first, &campaign.iter().map(|model| model[joint]).collect::<Vec<f64>>());
        }
    }
    let ModelPairs { same_order, all } = pairs;
    let meaning = if same_order == all {
        "the order belongs to the arm"
    } else {
        "the order depends on the campaign as well as on the models"
    };
    (all > 0).then(|| {
        format!(
            "the same arm in {} more campaign(s) (other noise, valves and levels within some percent), by the printed protocol: \
             {same_order} of {all} pairs of models stand as in the first; {meaning}",
            repeats.len()
        )
    })
}

/// States how errors grow on runs that were not fitted.
fn protocol(studies: &[ModelStudy], courses: &[Course]) -> String {
    let grown = |way: Way, joint: usize| {
        let (seen, held_out) =
            (errors(studies, way, 0, joint), held_out_errors(studies, way, joint));
        let worst = (0..seen.len())
            .max_by(|a, b| (held_out[*a] / seen[*a]).total_cmp(&(held_out[*b] / seen[*b])));
        let worst = worst.unwrap_or(0);
        format!("{} {} times", MODELS[worst].name, significant(held_out[worst] / seen[worst], 2))
    };
    format!(
        "fitted and evaluated on the same data: the paper has one run of {SAMPLES} samples for both. On {} of other commands the error \
         of the printed protocol grows most for {}",
        if courses.len() == 2 {
            "a course".to_owned()
        } else {
            format!("{} courses", courses.len() - 1)
        },
        by_joint(|joint| grown(PRINTED, joint))
    )
}

/// States whether LuGre is last in the proper protocol, and why.
fn lugre_sentences(
    studies: &[ModelStudy],
    courses: &[Course],
    torques: &[Vec<TorqueStudy>],
) -> Vec<String> {
    let Some(lugre) = studies.iter().position(|study| study.model.law.has_bristles()) else {
        return Vec::new();
    };
    let held_out =
        by_joint(|joint| format!("{} deg", ranking_text(&held_out_errors(studies, PROPER, joint))));
    let mut sentences = vec![format!(
        "done properly (scaled, several starts, an offset in each), on unseen courses: {held_out}"
    )];
    let last =
        (0..JOINTS).filter_map(|joint| last_sentence(studies, courses, torques, lugre, joint));
    sentences.extend(last);
    if sentences.len() == 1 {
        sentences.push("done properly, LuGre is last on no joint, on no course".into());
    }
    sentences
}

/// States on which courses LuGre is last on a joint, and why; `None` if it is last on none. `lugre` is its index.
fn last_sentence(
    studies: &[ModelStudy],
    courses: &[Course],
    torques: &[Vec<TorqueStudy>],
    lugre: usize,
    joint: usize,
) -> Option<String> {
    let last_on: Vec<String> = (0..courses.len())
        .filter(|course| rank(&errors(studies, PROPER, *course, joint)).last() == Some(&lugre))
        .map(|course| {
            let all = errors(studies, PROPER, course, joint);
            format!(
                "the {} ({} deg; {} {})",
                courses[course].name,
                significant(all[lugre], 3),
                MODELS[rank(&all)[0]].name,
                significant(all[rank(&all)[0]], 3)
            )
        })
        .collect();
    if last_on.is_empty() {
        return None;
    }
    let by_torque: Vec<f64> = torques.iter().map(|joints| joints[joint].proper.test.rmse).collect();
    let stiffness =
        |parameters: &Parameters<f64>| significant(parameters.get(Id::BristleStiffness), 3);
    let lugre_error = |way: Way| significant(held_out_errors(studies, way, joint)[lugre], 3);
    let [by_angles, by_torques] =
        [PROPER, BY_TORQUES].map(|way| held_out_errors(studies, way, joint)[lugre]);
    let why = if by_torques < by_angles {
        "one course of angles does not determine its bristle"
    } else {
        "neither the values from angles nor those from torques follow it on unseen courses"
    };
    Some(format!(
        "joint {}: LuGre done properly is last on {}: {why}. The fit gave {} Nm/rad, the \
         joint's torques give {} and rank LuGre {} of {} on unseen runs ({}). With the torques' values the arm is {} deg off on \
         unseen courses instead of {}",
        joint + 1,
        last_on.join(" and "),
        stiffness(&studies[lugre].proper.fitted.parameters[joint]),
        stiffness(&torques[lugre][joint].proper.parameters),
        rank(&by_torque).iter().position(|model| *model == lugre).map_or(0, |place| place + 1),
        studies.len(),
        ranking_text(&by_torque) + " Nm",
        lugre_error(BY_TORQUES),
        lugre_error(PROPER),
    ))
}

/// Returns the range of a joint's angle in a run, rad.
fn travel(course: &Course, joint: usize) -> f64 {
    let angles = course.angles_rad[joint].iter().copied();
    angles.clone().fold(f64::MIN, f64::max) - angles.fold(f64::MAX, f64::min)
}

/// Checks the values of our fits.
pub fn fit_checks(studies: &[ModelStudy], courses: &[Course]) -> Vec<String> {
    let mut sentences = Vec::new();
    for study in studies {
        for (way, has_one_start, evaluated, free) in [
            ("as printed", true, &study.printed, printed_free(study.model.law)),
            ("properly", false, &study.proper, proper_free(study.model.law)),
        ] {
            let whose = format!("{}, ours fitted {way}", study.model.name);
            let symbol = |id: Option<Id>| {
                let coefficient = study.model.coefficients.iter().find(|of| of.id == id);
                coefficient.map_or("f_0", |of| of.symbol)
            };
            let fitted = &evaluated.fitted;
            let values = free.iter().enumerate().map(|(index, free)| {
                let ratio = if free.axis == Coordinate::TimesCoulomb { "/F_C" } else { "" };
                SearchedValue {
                    name: format!("{}{ratio} (joint {})", symbol(free.id), free.joint + 1),
                    value: fitted.values[index],
                    start: has_one_start.then(|| fitted.start[index]),
                    bounds: free.bounds,
                }
            });
            sentences.extend(plausibility::check_values(&whose, values));
            if !fitted.converged {
                sentences.push(format!("{whose}: the search stopped at its limit of steps"));
            }
            for joint in 0..JOINTS {
                let parameters = &fitted.parameters[joint];
                let whose = format!("{whose}, joint {}", joint + 1);
                if study.model.law.has_bristles() {
                    let held = evaluated.errors[0].largest_held_nm[joint];
                    sentences.extend(plausibility::check_bristle(
                        &whose,
                        parameters,
                        held,
                        travel(&courses[0], joint),
                    ));
                } else {
                    sentences.extend(driving_sentence(&whose, parameters));
                }
            }
        }
    }
    sentences
}

fn driving_sentence(whose: &str, parameters: &Parameters<f64>) -> Option<String> {
    plausibility::max_driving_power(parameters).map(|DrivingPower { speed_rad_s, power_w }| {
        let [speed, power] = [speed_rad_s, power_w].map(|number| significant(number, 2));
        format!(
            "{whose}: the law drives instead of braking: it supplies {power} W at {speed} rad/s"
        )
    })
}

/// Checks the printed tables.
fn print_checks(courses: &[Course]) -> Vec<String> {
    let (mut bristles, mut values, mut units, mut drive) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for model in &MODELS {
        values.extend(plausibility::check_printed(model));
        units.extend(plausibility::check_units(model, true));
        for joint in 0..JOINTS {
            let whose = format!("{} as printed, joint {}", model.name, joint + 1);
            let parameters =
                plausibility::printed_parameters(model, joint, &printed_base(model.law));
            if model.law.has_bristles() {
                // The largest deflection that the bristle can have: the range of our joint.
                let travel = travel(&courses[0], joint);
                let most = parameters.get(Id::BristleStiffness) * travel;
                bristles.extend(plausibility::check_bristle(&whose, &parameters, most, travel));
            } else {
                drive.extend(driving_sentence(&whose, &parameters));
            }
        }
    }
    let (least, most) = PRINTED_BOUNDS;
    let same_order = format!(
        "one start ({PRINTED_START}) and one pair of bounds ({least} to {most}) are used for torques, stiffnesses and speeds alike in print"
    );
    [bristles, values, vec![same_order], units, drive, plausibility::check_bodies(&ARM.links)]
        .concat()
}

/// Returns the sentences about the measured arm.
pub fn measured_sentences(axes: &[Option<RobotAxis>]) -> Vec<String> {
    let mut sentences = Vec::new();
    for (index, axis) in axes.iter().enumerate() {
        let Some(axis) = axis else {
            sentences.push(format!(
                "skipped: robot-axis{}.csv is not in the folder of measured logs",
                index + 1
            ));
            continue;
        };
        let of =
            |error: fn(&TorqueStudy) -> f64| axis.models.iter().map(error).collect::<Vec<f64>>();
        let at_bound: Vec<String> = axis
            .models
            .iter()
            .zip(&MODELS)
            .flat_map(|(study, model)| {
                let parameters = &study.printed.parameters;
                let values = model.law.parameters().iter().map(|id| SearchedValue {
                    name: id.name().to_owned(),
                    value: parameters.get(*id),
                    start: Some(PRINTED_START),
                    bounds: PRINTED_BOUNDS,
                });
                plausibility::check_values(model.name, values)
            })
            .collect();
        sentences.push(format!(
            "measured, industrial arm, axis {}, run {HELD_OUT} held out, from the best: properly {} Nm; with the printed start and \
             bounds {} Nm ({})",
            axis.number,
            ranking_text(&of(|study| study.proper.test.rmse)),
            ranking_text(&of(|study| study.printed.test.rmse)),
            if at_bound.is_empty() { "no value at a bound".to_owned() } else { at_bound.join("; ") },
        ));
    }
    sentences
}

//! What came out, in sentences: made from the numbers, so that other numbers make other sentences.

use super::arm::JOINTS;
use super::fit::{Axis as Moved, Course, PRINTED_BOUNDS, PRINTED_START, printed_free, proper_free};
use super::measured::{Axis, HELD_OUT};
use super::printed::{MODELS, SAMPLES};
use super::sayings;
use super::study::{ARM, Judgement, Study, TorqueStudy, printed_base};
use crate::papers::Goal;
use compensator_core::{ParameterId as Id, Parameters};
use friction_identification::number::significant;

/// Models from the best to the worst by some errors.
fn order(errors: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..errors.len()).collect();
    order.sort_by(|a, b| errors[*a].total_cmp(&errors[*b]));
    order
}

/// The order with its errors.
fn ranked(errors: &[f64]) -> String {
    let one = |model: &usize| format!("{} {}", MODELS[*model].name, significant(errors[*model], 3));
    order(errors).iter().map(one).collect::<Vec<_>>().join(", ")
}

/// Pairs of models that stand the same way round in both lists of errors, and pairs in all.
fn pairs_alike(ours: &[f64], theirs: &[f64]) -> [usize; 2] {
    let all = (0..ours.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    all.fold([0, 0], |[alike, of], (i, j)| {
        [alike + usize::from((ours[i] < ours[j]) == (theirs[i] < theirs[j])), of + 1]
    })
}

type Way = fn(&Study) -> &Judgement;

const PRINTED: Way = |study| &study.printed;
const PROPER: Way = |study| &study.proper;
const BY_TORQUES: Way = |study| &study.by_torques;

fn errors(studies: &[Study], way: Way, course: usize, joint: usize) -> Vec<f64> {
    studies.iter().map(|study| way(study).judged[course].rmse_deg[joint]).collect()
}

/// Root mean square over the courses no fit has seen.
fn unseen(studies: &[Study], way: Way, joint: usize) -> Vec<f64> {
    let each = studies.iter().map(|study| {
        let others = &way(study).judged[1..];
        let squares: f64 = others.iter().map(|judged| judged.rmse_deg[joint].powi(2)).sum();
        (squares / others.len() as f64).sqrt()
    });
    each.collect()
}

/// Joint by joint, in one sentence.
fn by_joint(of: impl Fn(usize) -> String) -> String {
    let joints = (0..JOINTS).map(|joint| format!("joint {}: {}", joint + 1, of(joint)));
    joints.collect::<Vec<_>>().join("; ")
}

/// What is to be read first.
pub fn summary(
    studies: &[Study],
    courses: &[Course],
    torques: &[Vec<TorqueStudy>],
    again: &[Vec<[f64; JOINTS]>],
) -> Vec<String> {
    let mut said = vec![orders(studies)];
    said.extend(repeated(studies, again));
    said.push(protocol(studies, courses));
    said.extend(of_lugre(studies, courses, torques));
    said.extend(of_print(courses));
    said.push(
        "simulated: nobody has the paper's data; the arm is that of its Table 2, and its muscles and the friction in \
         its joints, which is none of the four models, are chosen by us"
            .to_owned(),
    );
    said
}

/// What was to be reached, and what was.
pub fn goals(
    studies: &[Study],
    courses: &[Course],
    torques: &[Vec<TorqueStudy>],
    measured: &[Option<Axis>],
) -> Vec<Goal> {
    let theirs =
        |joint: usize| MODELS.iter().map(|model| model.rmse_deg[joint]).collect::<Vec<_>>();
    let pairs =
        (0..JOINTS).map(|joint| pairs_alike(&errors(studies, PRINTED, 0, joint), &theirs(joint)));
    let [alike, of] = pairs.fold([0, 0], |sum, pair| [sum[0] + pair[0], sum[1] + pair[1]]);
    let (mut apart, mut below) = (0.0f64, [f64::INFINITY, 0.0f64]);
    for joint in 0..JOINTS {
        let (ours, printed) = (errors(studies, PRINTED, 0, joint), theirs(joint));
        let ends = |all: &[f64]| [order(all)[0], order(all)[all.len() - 1]].map(|at| all[at]);
        let [least, most] = ends(&ours);
        apart = apart.max(most / least);
        for (ours, printed) in ours.iter().zip(&printed) {
            below = [below[0].min(printed / ours), below[1].max(printed / ours)];
        }
    }
    let mut goals = vec![
        Goal::at_least(
            "with the printed start and bounds: pairs of models that stand as in print",
            "",
            alike as f64,
            of as f64,
        )
        .remark(format!(
            "The friction in our arm's joints is chosen by us, and the print's is not known. The four models' errors here lie within \
             a factor of {} of each other on every joint, and are {} to {} times below the printed: what parts the models in print is not friction \
             alone. Whether the order is the arm's or the day's is said below, on further campaigns.",
            significant(apart, 2),
            significant(below[0], 2),
            significant(below[1], 2),
        )),
    ];
    let Some(lugre) = studies.iter().position(|study| study.model.law.has_bristles()) else {
        return goals;
    };
    let last = |all: &[f64]| order(all).last() == Some(&lugre);
    let by_angles = (0..JOINTS).filter(|joint| last(&unseen(studies, PROPER, *joint))).count();
    let by_torque = (0..JOINTS).filter(|joint| {
        last(&torques.iter().map(|joints| joints[*joint].proper.test.rmse).collect::<Vec<_>>())
    });
    let why = of_lugre(studies, courses, torques).split_off(1);
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
    let axes: Vec<&Axis> = measured.iter().flatten().collect();
    goals.push(Goal::at_least(
        "axes of a measured industrial arm in the same table",
        "",
        axes.len() as f64,
        measured.len() as f64,
    ));
    let last_axes = axes.iter().filter(|axis| {
        last(&axis.models.iter().map(|study| study.proper.test.rmse).collect::<Vec<_>>())
    });
    goals.push(Goal::at_most(
        "properly, measured, run held out: axes on which LuGre is last",
        "",
        last_axes.count() as f64,
        0.0,
    ));
    goals
}

/// The printed order beside ours.
fn orders(studies: &[Study]) -> String {
    let theirs =
        |joint: usize| MODELS.iter().map(|model| model.rmse_deg[joint]).collect::<Vec<_>>();
    let mut sum = [0, 0];
    let joints = by_joint(|joint| {
        let ours = errors(studies, PRINTED, 0, joint);
        format!("{} deg (printed {})", ranked(&ours), ranked(&theirs(joint)))
    });
    for joint in 0..JOINTS {
        let [alike, of] = pairs_alike(&errors(studies, PRINTED, 0, joint), &theirs(joint));
        sum = [sum[0] + alike, sum[1] + of];
    }
    let [alike, of] = sum;
    let verdict = if alike == of {
        "comes out".to_owned()
    } else {
        format!(
            "does not come out in full: {alike} of {of} pairs of models stand as in print, chance gives {}",
            of / 2
        )
    };
    let same_worst: Vec<String> = (0..JOINTS)
        .filter(|joint| {
            order(&errors(studies, PRINTED, 0, *joint)).last() == order(&theirs(*joint)).last()
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

/// Whether the order of the printed protocol is the arm's, or the day's.
fn repeated(studies: &[Study], again: &[Vec<[f64; JOINTS]>]) -> Option<String> {
    let mut sum = [0, 0];
    for joint in 0..JOINTS {
        let first = errors(studies, PRINTED, 0, joint);
        for campaign in again {
            let theirs: Vec<f64> = campaign.iter().map(|of| of[joint]).collect();
            let [alike, of] = pairs_alike(&first, &theirs);
            sum = [sum[0] + alike, sum[1] + of];
        }
    }
    let [alike, of] = sum;
    let meaning = if alike == of {
        "the order is the arm's"
    } else {
        "the order is of the day as well as of the models"
    };
    (of > 0).then(|| {
        format!(
            "the same arm on {} more campaign(s) (other noise, valves and levels within some percent), by the printed protocol: \
             {alike} of {of} pairs of models stand as on the first; {meaning}",
            again.len()
        )
    })
}

/// What a run of other commands makes of the fits.
fn protocol(studies: &[Study], courses: &[Course]) -> String {
    let grown = |way: Way, joint: usize| {
        let (seen, unseen) = (errors(studies, way, 0, joint), unseen(studies, way, joint));
        let worst = (0..seen.len())
            .max_by(|a, b| (unseen[*a] / seen[*a]).total_cmp(&(unseen[*b] / seen[*b])));
        let worst = worst.unwrap_or(0);
        format!("{} {} times", MODELS[worst].name, significant(unseen[worst] / seen[worst], 2))
    };
    format!(
        "fitted and judged on the same data: print has one run of {SAMPLES} samples for both. On {} of other commands the error \
         of the printed protocol grows most for {}",
        if courses.len() == 2 {
            "a course".to_owned()
        } else {
            format!("{} courses", courses.len() - 1)
        },
        by_joint(|joint| grown(PRINTED, joint))
    )
}

/// Whether LuGre is last though done properly, and why.
fn of_lugre(studies: &[Study], courses: &[Course], torques: &[Vec<TorqueStudy>]) -> Vec<String> {
    let Some(lugre) = studies.iter().position(|study| study.model.law.has_bristles()) else {
        return Vec::new();
    };
    let held_out = by_joint(|joint| format!("{} deg", ranked(&unseen(studies, PROPER, joint))));
    let mut said = vec![format!(
        "done properly (scaled, several starts, an offset in each), on unseen courses: {held_out}"
    )];
    let mut is_last = false;
    for joint in 0..JOINTS {
        let last_on: Vec<String> = (0..courses.len())
            .filter(|course| order(&errors(studies, PROPER, *course, joint)).last() == Some(&lugre))
            .map(|course| {
                let all = errors(studies, PROPER, course, joint);
                format!(
                    "the {} ({} deg; {} {})",
                    courses[course].name,
                    significant(all[lugre], 3),
                    MODELS[order(&all)[0]].name,
                    significant(all[order(&all)[0]], 3)
                )
            })
            .collect();
        if last_on.is_empty() {
            continue;
        }
        is_last = true;
        let by_torque: Vec<f64> =
            torques.iter().map(|joints| joints[joint].proper.test.rmse).collect();
        let stiffness =
            |parameters: &Parameters<f64>| significant(parameters.get(Id::BristleStiffness), 3);
        let lugre_error = |way: Way| significant(unseen(studies, way, joint)[lugre], 3);
        let [own, torques_own] = [PROPER, BY_TORQUES].map(|way| unseen(studies, way, joint)[lugre]);
        let why = if torques_own < own {
            "one course of angles leaves its bristle open"
        } else {
            "neither the angles' values nor the torques' follow it on unseen courses"
        };
        said.push(format!(
            "joint {}: LuGre done properly is last on {}: {why}. The fit took {} Nm/rad, the \
             joint's torques say {} and rank LuGre {} of {} on unseen runs ({}). With the torques' values the arm is {} deg off on \
             unseen courses instead of {}",
            joint + 1,
            last_on.join(" and "),
            stiffness(&studies[lugre].proper.fitted.parameters[joint]),
            stiffness(&torques[lugre][joint].proper.parameters),
            order(&by_torque).iter().position(|model| *model == lugre).map_or(0, |place| place + 1),
            studies.len(),
            ranked(&by_torque) + " Nm",
            lugre_error(BY_TORQUES),
            lugre_error(PROPER),
        ));
    }
    if !is_last {
        said.push("done properly, LuGre is last on no joint, on no course".into());
    }
    said
}

/// How far a joint turns in all on a course, rad.
fn travel(course: &Course, joint: usize) -> f64 {
    let angles = course.angles_rad[joint].iter().copied();
    angles.clone().fold(f64::MIN, f64::max) - angles.fold(f64::MAX, f64::min)
}

/// What our fits say of their own values.
pub fn of_fits(studies: &[Study], courses: &[Course]) -> Vec<String> {
    let mut said = Vec::new();
    for study in studies {
        for (way, judgement, free) in [
            ("as printed", &study.printed, printed_free(study.model.law)),
            ("properly", &study.proper, proper_free(study.model.law)),
        ] {
            let whose = format!("{}, ours fitted {way}", study.model.name);
            let symbol = |id: Option<Id>| {
                let own = study.model.coefficients.iter().find(|of| of.id == id);
                own.map_or("f_0", |of| of.symbol)
            };
            let fitted = &judgement.fitted;
            // A proper fit begins at several places: only bounds are told of it.
            let start =
                |index: usize| if way == "as printed" { fitted.start[index] } else { f64::NAN };
            let values = free.iter().enumerate().map(|(index, free)| {
                let ratio = if free.axis == Moved::TimesCoulomb { "/F_C" } else { "" };
                let name = format!("{}{ratio} (joint {})", symbol(free.id), free.joint + 1);
                (name, fitted.values[index], start(index), free.bounds)
            });
            said.extend(sayings::of_values(&whose, values));
            if !fitted.converged {
                said.push(format!("{whose}: the search stopped at its limit of steps"));
            }
            for joint in 0..JOINTS {
                let parameters = &fitted.parameters[joint];
                let whose = format!("{whose}, joint {}", joint + 1);
                if study.model.law.has_bristles() {
                    let held = judgement.judged[0].largest_held_nm[joint];
                    said.extend(sayings::of_bristles(
                        &whose,
                        parameters,
                        held,
                        travel(&courses[0], joint),
                    ));
                } else {
                    said.extend(driving(&whose, parameters));
                }
            }
        }
    }
    said
}

fn driving(whose: &str, parameters: &Parameters<f64>) -> Option<String> {
    sayings::drives(parameters).map(|(speed, power)| {
        let [speed, power] = [speed, power].map(|number| significant(number, 2));
        format!(
            "{whose}: the law drives instead of braking: it gives out {power} W at {speed} rad/s"
        )
    })
}

/// What the printed tables say of themselves.
fn of_print(courses: &[Course]) -> Vec<String> {
    let (mut bristles, mut values, mut units, mut drive) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for model in &MODELS {
        values.extend(sayings::of_printed(model));
        units.extend(sayings::of_units(model, true));
        for joint in 0..JOINTS {
            let whose = format!("{} as printed, joint {}", model.name, joint + 1);
            let parameters = sayings::printed_parameters(model, joint, &printed_base(model.law));
            if model.law.has_bristles() {
                // As far as our joint ever turns: what the bristle could have been bent to at most.
                let travel = travel(&courses[0], joint);
                let most = parameters.get(Id::BristleStiffness) * travel;
                bristles.extend(sayings::of_bristles(&whose, &parameters, most, travel));
            } else {
                drive.extend(driving(&whose, &parameters));
            }
        }
    }
    let (least, most) = PRINTED_BOUNDS;
    let alike = format!(
        "one start ({PRINTED_START}) and one pair of bounds ({least} to {most}) serve torques, stiffnesses and speeds alike in print"
    );
    [bristles, values, vec![alike], units, drive, sayings::of_bodies(&ARM.links)].concat()
}

/// What the measured arm says.
pub fn of_measured(axes: &[Option<Axis>]) -> Vec<String> {
    let mut said = Vec::new();
    for (index, axis) in axes.iter().enumerate() {
        let Some(axis) = axis else {
            said.push(format!(
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
                let values = model.law.parameters().iter().map(|id| {
                    (id.name().to_owned(), parameters.get(*id), PRINTED_START, PRINTED_BOUNDS)
                });
                sayings::of_values(model.name, values)
            })
            .collect();
        said.push(format!(
            "measured, industrial arm, axis {}, run {HELD_OUT} held out, from the best: properly {} Nm; with the printed start and \
             bounds {} Nm ({})",
            axis.number,
            ranked(&of(|study| study.proper.test.rmse)),
            ranked(&of(|study| study.printed.test.rmse)),
            if at_bound.is_empty() { "no value at a bound".to_owned() } else { at_bound.join("; ") },
        ));
    }
    said
}

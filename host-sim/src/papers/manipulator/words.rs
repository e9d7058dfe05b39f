//! What came out, in sentences: made from the numbers, so that other numbers make other sentences.

use super::arm::JOINTS;
use super::fit::{Axis as Moved, Course, PRINTED_BOUNDS, PRINTED_START, printed_free, proper_free};
use super::measured::Axis;
use super::printed::{MODELS, SAMPLES};
use super::sayings;
use super::study::{ARM, Judgement, Study, TorqueStudy, printed_base};
use compensator_core::ParameterId as Id;
use friction_identification::number::significant;

/// Models from the best to the worst by some errors.
fn order(errors: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..errors.len()).collect();
    order.sort_by(|a, b| errors[*a].total_cmp(&errors[*b]));
    order
}

fn named(order: &[usize]) -> String {
    order.iter().map(|model| MODELS[*model].name).collect::<Vec<_>>().join(" < ")
}

/// Pairs of models that stand the same way round in both lists of errors.
fn pairs_alike(ours: &[f64], theirs: &[f64]) -> [usize; 2] {
    let all = (0..ours.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    all.fold([0, 0], |[alike, of], (i, j)| {
        [alike + usize::from((ours[i] < ours[j]) == (theirs[i] < theirs[j])), of + 1]
    })
}

fn rmse(studies: &[Study], way: fn(&Study) -> &Judgement, course: usize, joint: usize) -> Vec<f64> {
    studies.iter().map(|study| way(study).judged[course].rmse_deg[joint]).collect()
}

fn printed(study: &Study) -> &Judgement {
    &study.printed
}

fn proper(study: &Study) -> &Judgement {
    &study.proper
}

/// Everything there is to say of the simulated arm.
pub fn summary(studies: &[Study], courses: &[Course], torques: &[Vec<TorqueStudy>]) -> Vec<String> {
    let mut said = vec![
        "simulated: nobody has the paper's data; the arm is of its Table 2, its muscles and its friction are chosen here".to_owned(),
    ];
    said.extend(orders(studies));
    said.extend(held_out(studies, courses));
    said.extend(of_lugre(studies, courses, torques));
    said.extend(of_fits(studies, courses));
    said.extend(of_print(courses));
    said
}

/// The printed order beside ours, joint by joint.
fn orders(studies: &[Study]) -> Vec<String> {
    let mut said = Vec::new();
    let mut sum = [0, 0];
    for joint in 0..JOINTS {
        let theirs: Vec<f64> = MODELS.iter().map(|model| model.rmse_deg[joint]).collect();
        let ours = rmse(studies, printed, 0, joint);
        let [alike, of] = pairs_alike(&ours, &theirs);
        sum = [sum[0] + alike, sum[1] + of];
        said.push(format!(
            "joint {}, with the printed start and bounds, from the best: {} (printed: {}); {alike} of {of} pairs of models \
             stand as in print; worst of ours {} ({} deg), of print {}",
            joint + 1,
            named(&order(&ours)),
            named(&order(&theirs)),
            MODELS[order(&ours)[3]].name,
            significant(ours[order(&ours)[3]], 3),
            MODELS[order(&theirs)[3]].name,
        ));
    }
    let [alike, of] = sum;
    let verdict = if alike == of {
        "the printed order comes out"
    } else {
        "the printed order does not come out in full"
    };
    said.push(format!(
        "{verdict}: {alike} of {of} pairs in all; a toss of a coin would give {}",
        of / 2
    ));
    said
}

/// What a run of other commands makes of the fits.
fn held_out(studies: &[Study], courses: &[Course]) -> Vec<String> {
    let mut said = vec![format!(
        "print fits and judges on the same {SAMPLES} samples; here each fit is judged on {} it has not seen as well",
        match courses.len() - 1 {
            1 => "a course".to_owned(),
            count => format!("{count} courses"),
        }
    )];
    for (way, of) in [("as printed", printed as fn(&Study) -> &Judgement), ("properly", proper)] {
        for joint in 0..JOINTS {
            let unseen: Vec<f64> = studies
                .iter()
                .map(|study| {
                    let squares: f64 = (1..courses.len())
                        .map(|c| of(study).judged[c].rmse_deg[joint].powi(2))
                        .sum();
                    (squares / (courses.len() - 1) as f64).sqrt()
                })
                .collect();
            let seen = rmse(studies, of, 0, joint);
            let grown = |model: &usize| unseen[*model] / seen[*model];
            let worst =
                (0..studies.len()).max_by(|a, b| grown(a).total_cmp(&grown(b))).unwrap_or(0);
            said.push(format!(
                "joint {}, fitted {way}, held out, from the best: {} ({}); the error of {} grows most, {} times",
                joint + 1,
                named(&order(&unseen)),
                order(&unseen).iter().map(|m| significant(unseen[*m], 3)).collect::<Vec<_>>().join(", ") + " deg",
                MODELS[worst].name,
                significant(grown(&worst), 2),
            ));
        }
    }
    said
}

/// Where LuGre is last though done properly, why.
fn of_lugre(studies: &[Study], courses: &[Course], torques: &[Vec<TorqueStudy>]) -> Vec<String> {
    let bristles = studies.iter().position(|study| study.model.law.has_bristles());
    let Some(lugre) = bristles else { return Vec::new() };
    let mut said = Vec::new();
    let mut last = Vec::new();
    for joint in 0..JOINTS {
        let mut places = Vec::new();
        for (index, course) in courses.iter().enumerate() {
            let errors = rmse(studies, proper, index, joint);
            if order(&errors).last() == Some(&lugre) {
                places.push(format!(
                    "the {} ({} deg, the best has {})",
                    course.name,
                    significant(errors[lugre], 3),
                    significant(errors[order(&errors)[0]], 3)
                ));
            }
        }
        if places.is_empty() {
            continue;
        }
        let by_torque: Vec<f64> =
            torques.iter().map(|joints| joints[joint].proper.test.rmse).collect();
        let rank = order(&by_torque).iter().position(|model| *model == lugre).unwrap_or(0) + 1;
        let found = &studies[lugre].proper.fitted.parameters[joint];
        let measured = &torques[lugre][joint].proper.parameters;
        last.push(joint);
        said.push(format!(
            "joint {}: LuGre done properly is last on {}. Its torques place it {rank} of {} on unseen runs, with a stiffness of {} Nm/rad; \
             the angles took {}",
            joint + 1,
            places.join(" and "),
            studies.len(),
            significant(measured.get(Id::BristleStiffness), 3),
            significant(found.get(Id::BristleStiffness), 3),
        ));
    }
    if last.is_empty() {
        said.push("done properly, LuGre is last on no joint, on no course".into());
    }
    said
}

/// What our fits say of their own values.
fn of_fits(studies: &[Study], courses: &[Course]) -> Vec<String> {
    let travel = |joint: usize| {
        let angles = &courses[0].angles_rad[joint];
        angles.iter().copied().fold(f64::MIN, f64::max)
            - angles.iter().copied().fold(f64::MAX, f64::min)
    };
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
                    said.extend(sayings::of_bristles(&whose, parameters, held, travel(joint)));
                } else {
                    said.extend(driving(&whose, parameters));
                }
            }
        }
    }
    said
}

fn driving(whose: &str, parameters: &compensator_core::Parameters<f64>) -> Option<String> {
    sayings::drives(parameters).map(|(speed, power)| {
        format!(
            "{whose}: the law drives instead of braking: it gives out {} W at {} rad/s",
            significant(power, 2),
            significant(speed, 2)
        )
    })
}

/// What the printed tables say of themselves.
fn of_print(courses: &[Course]) -> Vec<String> {
    let mut said = Vec::new();
    for model in &MODELS {
        said.extend(sayings::of_printed(model));
        said.extend(sayings::of_units(model, true));
        for joint in 0..JOINTS {
            let whose = format!("{} as printed, joint {}", model.name, joint + 1);
            let parameters = sayings::printed_parameters(model, joint, &printed_base(model.law));
            if model.law.has_bristles() {
                // As far as the joint ever turns: what a bristle could have been bent to at most.
                let angles = &courses[0].angles_rad[joint];
                let travel = angles.iter().copied().fold(f64::MIN, f64::max)
                    - angles.iter().copied().fold(f64::MAX, f64::min);
                let most = parameters.get(Id::BristleStiffness) * travel;
                said.extend(sayings::of_bristles(&whose, &parameters, most, travel));
            } else {
                said.extend(driving(&whose, &parameters));
            }
        }
    }
    said.extend(sayings::of_bodies(&ARM.links));
    let (least, most) = PRINTED_BOUNDS;
    said.push(format!("one start ({PRINTED_START}) and one pair of bounds ({least} to {most}) serve torques, stiffnesses and speeds alike in print"));
    said
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
        let line = |way: &str, errors: Vec<f64>| {
            let order = order(&errors);
            let numbers: Vec<String> =
                order.iter().map(|model| significant(errors[*model], 4)).collect();
            format!("{way}: {} ({} Nm)", named(&order), numbers.join(", "))
        };
        let of =
            |error: fn(&TorqueStudy) -> f64| axis.models.iter().map(error).collect::<Vec<f64>>();
        said.push(format!(
            "measured, industrial arm, axis {}, run {} held out, from the best: {}; {}",
            axis.number,
            super::measured::HELD_OUT,
            line("with the printed start and bounds", of(|study| study.printed.test.rmse)),
            line("properly", of(|study| study.proper.test.rmse)),
        ));
    }
    said
}

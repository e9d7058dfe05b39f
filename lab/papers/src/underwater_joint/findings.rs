//! Summary sentences beyond the goals: certificates, parameter transfer, harm, and the watch.

use super::JointStudy;
use super::arms::{DIAGNOSED, IMPROVED, NONE, PERFECT, PUBLISHED};
use super::harm::{AS_IDENTIFIED, Circumstance, MAX_TRACKING_RATIO, TASKS, WearCampaign};
use super::rows::printed_sums;
use super::tasks::Task;
use crate::Goal;
use crate::row::percent;
use joint_log::number::significant;

/// Compares the sums of CV of the published, the improved and the diagnosed model with the paper's.
pub fn certificates(study: &JointStudy) -> Option<String> {
    let sums = |arm| {
        let of = study.certificates.iter().find(|(known, _)| *known == arm);
        of.map(|(_, certificate)| certificate.sum_cv_by_class.as_slice())
    };
    let list = |sums: &[f64]| {
        let all: Vec<String> = sums.iter().map(|sum| significant(*sum, 3)).collect();
        all.join(" / ")
    };
    let (published, improved, ours) = (sums(PUBLISHED)?, sums(IMPROVED)?, sums(DIAGNOSED)?);
    let in_print = |arm| printed_sums(study, arm).map(|sums| list(&sums));
    let fallen = published.iter().zip(improved).filter(|(before, after)| after < before).count();
    Some(format!(
        "Sums of CV (standard deviation over mean) of the published model {}, of the improved one {}, of the diagnosed one {}: smaller in {fallen} of {} \
         classes with the improved one. In the paper's form (variance over mean, a sum of units) {}, {} and {}, where the paper's fall in all classes, from \
         19.82 / 30.19 / 48.28 to 9.52 / 16.55 / 33.54.",
        list(published),
        list(improved),
        list(ours),
        published.len(),
        in_print(PUBLISHED)?,
        in_print(IMPROVED)?,
        in_print(DIAGNOSED)?
    ))
}

/// States the errors before and after the transfer of the diagnosed parameters.
pub fn transfer_sentence(study: &JointStudy) -> Option<String> {
    let first = study.transfers.first()?;
    let each: Vec<String> = study
        .transfers
        .iter()
        .map(|of| {
            let drop = 100.0 * (of.after.mean / of.before.mean - 1.0);
            let unit = super::experiments::measures(of.task)[0].unit;
            let [before, after] = [of.before, of.after].map(|of| significant(of.mean, 3));
            format!("{} {before} -> {after} {unit} ({})", of.task.title(), percent(drop))
        })
        .collect();
    Some(format!(
        "Parameters into the running joint: a joint that runs with the LuGre fitted as published is disarmed and receives the diagnosed set over its bus (as `params set` \
         does: {} frames, {} s). While it is armed it rejects the set. Its error before and after, without a restart: {}.",
        first.frames,
        significant(first.written_s, 2),
        each.join("; ")
    ))
}

/// States which circumstances did harm.
pub fn harm(study: &JointStudy) -> Vec<String> {
    let mut lines = vec![broken_requirements(study)];
    lines.extend(perfect_comparison(study));
    lines.push(over_compensation(study));
    lines
}

/// States how many circumstances break a requirement, and which.
fn broken_requirements(study: &JointStudy) -> String {
    let names = |of: Vec<&Circumstance>| {
        of.iter().map(|of| of.name.as_str()).collect::<Vec<_>>().join(", ")
    };
    let harmful: Vec<&Circumstance> = study.harm.iter().filter(|of| !of.is_harmless()).collect();
    let refused = study.harm.iter().filter(|of| of.tracking_ratio.is_none()).count();
    let by_task: Vec<String> = TASKS
        .iter()
        .enumerate()
        .filter_map(|(at, task)| {
            let tracking_ratio = |of: &&Circumstance| {
                of.tracking_ratio
                    .is_some_and(|tracking_ratio| tracking_ratio[at] > MAX_TRACKING_RATIO)
            };
            let count = study.harm.iter().filter(tracking_ratio).count();
            (count > 0).then(|| format!("{} in {count}", task.title()))
        })
        .collect();
    let others: Vec<&Circumstance> =
        harmful.iter().copied().filter(|of| of.tracks_within_limit()).collect();
    let mut broken = by_task;
    if !others.is_empty() {
        broken.push(format!("swing or current with {}", names(others)));
    }
    let colon = if broken.is_empty() { "" } else { ": " };
    let worst: Vec<String> = TASKS
        .iter()
        .enumerate()
        .filter_map(|(at, task)| {
            let met = study.harm.iter().filter_map(|of| Some((of, of.tracking_ratio?[at])));
            let (of, tracking_ratio) = met.max_by(|a, b| a.1.total_cmp(&b.1))?;
            Some(format!("{} {} ({})", task.title(), significant(tracking_ratio, 3), of.name))
        })
        .collect();
    format!(
        "Harm, checked in all three tasks and while holding 2 kg: of {} circumstances {} break a requirement (tracking at most 5 % worse than without \
         compensation, no limit cycle while holding, current within its limit){colon}{}; {refused} sets were rejected by the driver. Largest error over that without: {}.",
        study.harm.len(),
        harmful.len(),
        broken.join(", "),
        worst.join(", ")
    )
}

/// Compares the model as identified with the perfect one; `None` if one of them was rejected.
fn perfect_comparison(study: &JointStudy) -> Option<String> {
    let ratios = |name: &str| {
        let tracking_ratio = study.harm.iter().find(|of| of.name == name)?.tracking_ratio?;
        Some(tracking_ratio.map(|tracking_ratio| significant(tracking_ratio, 3)).join(", "))
    };
    let position = |name: &str| {
        let found = study.harm.iter().find(|of| of.name == name);
        found.and_then(|of| of.jump_position_ratio).map_or("-".into(), |of| significant(of, 3))
    };
    let position = format!("{} and {}", position(AS_IDENTIFIED), position(PERFECT));
    let (ours, perfect) = (ratios(AS_IDENTIFIED)?, ratios(PERFECT)?);
    Some(format!(
        "Error over that without compensation (lifting, sine, jump): {ours} as identified, {perfect} with the perfect model. What is worse with ours and not with \
         the perfect one is due to our model. The jump by position: {position}."
    ))
}

/// States how often the driver detects a model with more friction than the seal.
fn over_compensation(study: &JointStudy) -> String {
    let over: Vec<&Circumstance> =
        study.harm.iter().filter(|of| of.over_compensates && of.tracking_ratio.is_some()).collect();
    let reported = over.iter().filter_map(|of| {
        of.reported_s.map(|s| format!("{} after {} s", of.name, significant(s, 2)))
    });
    let reported: Vec<String> = reported.collect();
    let sound = study.harm.first().is_some_and(|of| of.reported_s.is_none());
    format!(
        "The driver itself detects over-compensation in {} of {} models with more friction than the seal, within {} s of sliding{}{}; for the model as identified it reports {}.",
        reported.len(),
        over.len(),
        significant(study.harm_s, 3),
        if reported.is_empty() { "" } else { ": " },
        reported.join(", "),
        if sound { "nothing" } else { "the same" }
    )
}

/// Goals of harm and of the watch.
pub fn goals(study: &JointStudy) -> Vec<Goal> {
    let mut goals = Vec::new();
    let met = || study.harm.iter().filter(|of| of.tracking_ratio.is_some());
    for (at, task) in TASKS.iter().enumerate() {
        let count = met()
            .filter(|of| {
                of.tracking_ratio
                    .is_some_and(|tracking_ratio| tracking_ratio[at] > MAX_TRACKING_RATIO)
            })
            .count();
        let what = format!(
            "{}: circumstances in which tracking is more than 5 % worse than without compensation",
            task.title()
        );
        let goal = Goal::at_most(what, "", count as f64, 0.0);
        goals.push(match task {
            Task::Impact if !goal.is_reached() => {
                goal.remark(format!("Of {}. {}", met().count(), explain_jump(study)))
            }
            _ => goal,
        });
    }
    let what = "Jump with impact, by position: circumstances in which tracking is more than 5 % worse than without compensation";
    let count = met()
        .filter(|of| {
            of.jump_position_ratio.is_some_and(|tracking_ratio| tracking_ratio > MAX_TRACKING_RATIO)
        })
        .count();
    goals.push(Goal::at_most(what, "", count as f64, 0.0));
    let swings = met().filter(|of| !of.is_harmless() && of.tracks_within_limit()).count();
    let what = "circumstances in which the joint is made to swing, or its current passes the limit";
    goals.push(Goal::at_most(what, "", swings as f64, 0.0));
    let over = || met().filter(|of| of.over_compensates);
    let reported = over().filter(|of| of.reported_s.is_some()).count();
    goals.push(Goal::at_least(
        "models with more friction than the seal that the driver finds by itself",
        "",
        reported as f64,
        over().count() as f64,
    ));
    let wear = &study.wear;
    let years = wear.sound_days as f64 / 365.0;
    let what = "false alarms of the watch, a year of days without wear";
    let alarms = wear.false_alarms as f64 / years;
    goals.push(Goal::at_most(what, "", alarms, 1.0).remark(explain_watch(wear)));
    goals
}

/// States the reports of the watch with and without wear.
pub fn watch(study: &JointStudy) -> Vec<String> {
    let wear = &study.wear;
    let flagged = wear.flagged_day.map_or_else(
        || format!("reports nothing in {} days", wear.last_day),
        |day| format!("reports \"model out of band\" on day {day}, the first of the checked days"),
    );
    vec![format!(
        "The watch, friction worn by 1 % a day: {flagged}. {} false alarms on {} days without wear (goal: at most one in a year). Each day is shortened to one task of 25 s \
         with a temperature and a noise of its own: the model's errors from day to day are included, hours of noise are not (the watch is \
         designed for those: one alarm in 1000 h of sliding).",
        wear.false_alarms, wear.sound_days
    )]
}

/// Currents above this count as limited, A: the limit of 26 less the converter's noise.
const LIMITED_CURRENT_A: f64 = 25.5;

/// Explains a larger velocity error in the jump by the error of position.
fn explain_jump(study: &JointStudy) -> String {
    let of = |name: &str| {
        let found = study.harm.iter().find(|of| of.name == name)?;
        Some([found.tracking_ratio?[2], found.jump_position_ratio?])
    };
    let time = |arm| study.measured(Task::Impact, arm, 0).map(|of| significant(of.mean, 3));
    let course = &study
        .task(Task::Impact)
        .iter()
        .find(|result| result.arm == DIAGNOSED)
        .map(|result| &result.course);
    let at_limit = course.map_or(0, |course| {
        course.current_a.iter().filter(|current| current.abs() > LIMITED_CURRENT_A).count()
    });
    let words = || {
        let ([ours, position], [perfect, perfect_position]) = (of(AS_IDENTIFIED)?, of(PERFECT)?);
        let whose =
            if perfect > MAX_TRACKING_RATIO { "compensation, not the model" } else { "model" };
        let [ours, position, perfect, perfect_position] =
            [ours, position, perfect, perfect_position].map(|of| significant(of, 3));
        Some(format!(
            "The cause is the {whose}: as identified {ours}, the perfect model within the same current limit {perfect}. The commanded course is \
             faster than the current allows: for {} ms the current is at its limit, where no model can add to it. The joint then catches up \
             faster with less friction, which counts as a velocity error. In position, which the loop of the jump controls, the error \
             is {position} of that without ({perfect_position} with the perfect model), and the target is reached after {} s instead of {}.",
            // A row each millisecond.
            at_limit,
            time(DIAGNOSED)?,
            time(NONE)?,
        ))
    };
    words().unwrap_or_default()
}

/// Explains the days of the watch.
fn explain_watch(wear: &WearCampaign) -> String {
    let found = wear.flagged_day.map_or_else(
        || format!("A seal that wears by 1 % a day is not detected in {} days.", wear.last_day),
        |day| format!("A seal that wears by 1 % a day is detected on day {day}."),
    );
    format!(
        "Checked on {} days. {found} Each day begins at a temperature of its own. The bench's water temperature varies so that the diagnosis can detect its effect; \
         with a constant one, warm days look like a fault.",
        wear.sound_days
    )
}

//! What came out beside the goals, in sentences: certificates, the loop closed once more, harm, the watch.

use super::arms::{DIAGNOSED, IMPROVED, PERFECT, PUBLISHED};
use super::harm::{Circumstance, TASKS, WORSE};
use super::rows::printed_sums;
use super::{Study, goals::percent};
use friction_identification::number::significant;

/// Whether the sums of CV fall from the published to the improved and the diagnosed model as the paper's do.
pub fn certificates(study: &Study) -> Option<String> {
    let sums = |arm| {
        let of = study.certificates.iter().find(|(own, _)| *own == arm);
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

/// What the diagnosed parameters did to the running joint.
pub fn closed(study: &Study) -> Option<String> {
    let first = study.closed.first()?;
    let each: Vec<String> = study
        .closed
        .iter()
        .map(|of| {
            let drop = 100.0 * (of.after.mean / of.before.mean - 1.0);
            let unit = super::experiments::measures(of.task)[0].unit;
            let [before, after] = [of.before, of.after].map(|of| significant(of.mean, 3));
            format!("{} {before} -> {after} {unit} ({})", of.task.title(), percent(drop))
        })
        .collect();
    Some(format!(
        "The loop closed once more: a joint that runs on the LuGre fitted as published is disarmed and given the diagnosed set over its bus (as `params set` \
         does: {} frames, {} s), refused while it is armed. Its error before and after, without a restart: {}.",
        first.frames,
        significant(first.written_s, 2),
        each.join("; ")
    ))
}

/// What did harm.
pub fn harm(study: &Study) -> Vec<String> {
    let names = |of: Vec<&Circumstance>| {
        of.iter().map(|of| of.name.as_str()).collect::<Vec<_>>().join(", ")
    };
    let harmful: Vec<&Circumstance> = study.harm.iter().filter(|of| !of.harmless()).collect();
    let refused = study.harm.iter().filter(|of| of.worse.is_none()).count();
    let by_task: Vec<String> = TASKS
        .iter()
        .enumerate()
        .filter_map(|(at, task)| {
            let worse = |of: &&Circumstance| of.worse.is_some_and(|worse| worse[at] > WORSE);
            let count = study.harm.iter().filter(worse).count();
            (count > 0).then(|| format!("{} in {count}", task.title()))
        })
        .collect();
    let others: Vec<&Circumstance> = harmful.iter().copied().filter(|of| of.follows()).collect();
    let mut broken = by_task;
    if !others.is_empty() {
        broken.push(format!("swing or current with {}", names(others)));
    }
    let colon = if broken.is_empty() { "" } else { ": " };
    let worst: Vec<String> = TASKS
        .iter()
        .enumerate()
        .filter_map(|(at, task)| {
            let met = study.harm.iter().filter_map(|of| Some((of, of.worse?[at])));
            let (of, worse) = met.max_by(|a, b| a.1.total_cmp(&b.1))?;
            Some(format!("{} {} ({})", task.title(), significant(worse, 3), of.name))
        })
        .collect();
    let mut lines = vec![format!(
        "Harm, looked for in all three tasks and while holding 2 kg: of {} circumstances {} break a demand (tracking at most 5 % worse than without \
         compensation, no limit cycle while holding, current within its limit){colon}{}; {refused} sets were refused by the driver. Worst error over that without: {}.",
        study.harm.len(),
        harmful.len(),
        broken.join(", "),
        worst.join(", ")
    )];
    let ratios = |name: &str| {
        let worse = study.harm.iter().find(|of| of.name == name)?.worse?;
        Some(worse.map(|worse| significant(worse, 3)).join(", "))
    };
    if let (Some(ours), Some(perfect)) = (ratios("as identified"), ratios(PERFECT)) {
        lines.push(format!(
            "Error over that without compensation (lifting, sine, jump): {ours} as identified, {perfect} with the perfect model. What is worse with ours and not with \
             the perfect one is our model's doing."
        ));
    }
    let over: Vec<&Circumstance> =
        study.harm.iter().filter(|of| of.over_compensates && of.worse.is_some()).collect();
    let told = over
        .iter()
        .filter_map(|of| of.told_s.map(|s| format!("{} after {} s", of.name, significant(s, 2))));
    let told: Vec<String> = told.collect();
    let sound = study.harm.first().is_some_and(|of| of.told_s.is_none());
    lines.push(format!(
        "Over-compensation is found by the driver itself in {} of {} models with more friction than the seal, within {} s of sliding{}{}; of the model as identified it says {}.",
        told.len(),
        over.len(),
        significant(study.harm_s, 3),
        if told.is_empty() { "" } else { ": " },
        told.join(", "),
        if sound { "nothing" } else { "the same" }
    ));
    lines
}

/// What the watch says of wear, and of days without.
pub fn watch(study: &Study) -> Vec<String> {
    let wear = &study.wear;
    let flagged = wear.flagged_day.map_or_else(
        || format!("says nothing in {} days", wear.last_day),
        |day| format!("says \"model out of band\" on day {day} of those looked at"),
    );
    vec![format!(
        "The watch, friction worn by 1 % a day: {flagged}. {} false alarms on {} days without wear (goal: at most one in a year). Each day is shortened to one task of 25 s \
         under a temperature and a noise of its own: what the model gets wrong from day to day is in it, hours of noise are not (for those the watch is \
         laid out: one alarm in 1000 h of sliding).",
        wear.false_alarms, wear.sound_days
    )]
}

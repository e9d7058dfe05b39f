//! Sentences and figures of the page of a tuning session.
//!
//! A *change* is `after / before - 1` in percent: negative if the new set is better. It is the gain with the other sign.

use crate::page::words::{capitalised, counted, listed, quantity};
use crate::report::{Answers, Benefit};
use crate::tune::{TuneArm, TuneGain, TuneOutcome, TuneQuantity, TuneReport};
use friction_diagnose::{cause, probability_in_words};
use joint_log::number::{fixed, significant};

/// Text for a value that was not measured.
pub(super) const NOT_MEASURED: &str = "not measured";

/// Length from which an angle is shown in rad, rad.
const LARGE_ANGLE_RAD: f64 = 0.1;

/// What a gain shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// The whole interval is an improvement.
    Better,
    /// The whole interval is a deterioration.
    Worse,
    /// The interval includes zero.
    Open,
    /// There is no gain: a value or its interval is missing.
    NotMeasured,
}

impl Verdict {
    pub fn of(gain: &TuneGain) -> Self {
        let [low, high] = gain.ci95;
        if ![gain.gain, low, high].iter().all(|value| value.is_finite()) {
            Self::NotMeasured
        } else if low > 0.0 {
            Self::Better
        } else if high < 0.0 {
            Self::Worse
        } else {
            Self::Open
        }
    }

    pub fn in_words(self) -> &'static str {
        match self {
            Self::Better => "smaller",
            Self::Worse => "larger",
            Self::Open => "no difference shown",
            Self::NotMeasured => NOT_MEASURED,
        }
    }
}

/// Formats a gain as the change in percent, without the sign of percent.
fn percent(gain: f64) -> String {
    let change = -100.0 * gain;
    let text = fixed(change, if change.abs() < 9.95 { 1 } else { 0 });
    if change > 0.0 && text.contains(|letter: char| ('1'..='9').contains(&letter)) {
        format!("+{text}")
    } else {
        text
    }
}

/// Returns a text of a gain, or that it was not measured.
fn if_measured(gain: &TuneGain, text: String) -> String {
    if Verdict::of(gain) == Verdict::NotMeasured { NOT_MEASURED.to_owned() } else { text }
}

/// Returns the change: `−67 %`.
pub(super) fn change(gain: &TuneGain) -> String {
    if_measured(gain, format!("{}\u{a0}%", percent(gain.gain)))
}

/// Returns the 95 % interval of the change: `−72 to −60 %`.
pub(super) fn interval(gain: &TuneGain) -> String {
    let [low, high] = gain.ci95.map(percent);
    if_measured(gain, format!("{high} to {low}\u{a0}%"))
}

/// Returns the change with its interval: `−67 % (−72 to −60 %)`.
pub(super) fn change_with_interval(gain: &TuneGain) -> String {
    if_measured(gain, format!("{} ({})", change(gain), interval(gain)))
}

/// Returns what each part of the new set takes of a quantity; `None` unless both were compared.
pub(super) fn parts(report: &TuneReport, of: TuneQuantity) -> Option<String> {
    let [loop_gains, model] = [&report.parts.loop_gains, &report.parts.friction_model]
        .map(|gains| gains.iter().find(|gain| gain.quantity == of).map(change));
    Some(format!("loop gains {}, then model {}", loop_gains?, model?))
}

/// Returns the unit in which values of a quantity are shown, and the factor to it. Small angles are shown in mrad.
pub(super) fn shown_unit(unit: &'static str, values: &[f64]) -> (&'static str, f64) {
    let largest = values
        .iter()
        .filter(|value| value.is_finite())
        .fold(0.0, |most: f64, value| most.max(value.abs()));
    if unit == "rad" && largest < LARGE_ANGLE_RAD { ("mrad", 1e3) } else { (unit, 1.0) }
}

/// Returns both means of a gain: `12.0 → 4.00 mrad`.
pub(super) fn means(gain: &TuneGain) -> String {
    let (unit, factor) = shown_unit(gain.unit, &[gain.before, gain.after]);
    let [before, after] = [factor * gain.before, factor * gain.after];
    if before.is_finite() && after.is_finite() {
        format!("{} → {}", significant(before, 3), quantity(after, unit))
    } else {
        format!("{} → {}", finite(before, unit), finite(after, unit))
    }
}

/// Formats a value with its unit, or says that it was not measured.
pub(super) fn finite(value: f64, unit: &str) -> String {
    if value.is_finite() { quantity(value, unit) } else { NOT_MEASURED.to_owned() }
}

/// Returns a duration: `4 min 52 s`.
pub(super) fn duration(seconds: f64) -> String {
    if !seconds.is_finite() {
        return NOT_MEASURED.to_owned();
    }
    let whole = seconds.round() as u64;
    match (whole / 60, whole % 60) {
        (0, _) if seconds < 10.0 => quantity(seconds, "s"),
        (0, rest) => format!("{rest}\u{a0}s"),
        (minutes, 0) => format!("{minutes}\u{a0}min"),
        (minutes, rest) => format!("{minutes}\u{a0}min {rest}\u{a0}s"),
    }
}

/// Returns the title of the page.
pub(super) fn title(report: &TuneReport) -> String {
    let result = match report.outcome {
        TuneOutcome::Saved => "it moves better",
        TuneOutcome::Returned(_) => "nothing changed",
    };
    format!("{}: {result}", report.joint)
}

/// Returns what happened to the parameters.
fn happened(report: &TuneReport) -> String {
    match &report.outcome {
        TuneOutcome::Returned(why) => {
            let tried = match (report.parameters.len(), report.trial.blocks.len()) {
                (0, _) | (_, 0) => String::new(),
                (values, blocks) => format!(
                    " after a trial of {} in {}",
                    counted(values, "new value"),
                    counted(blocks, "block")
                ),
            };
            format!("The former parameters are back{tried}. {}", sentence(why))
        }
        TuneOutcome::Saved => saved(report).to_owned(),
    }
}

/// Returns the answers of the page.
pub(super) fn answers(report: &TuneReport) -> Answers {
    let tested = match report.trial.blocks.len() {
        0 => "Not tested: no set was tried.".to_owned(),
        blocks => format!(
            "{blocks} runs of the same motion in a balanced order, with 95\u{a0}% intervals."
        ),
    };
    let joint = if report.is_simulated { ", on a simulated joint" } else { "" };
    let certainty = format!("{tested} The session took {}{joint}.", duration(report.seconds));
    let (gain, next) = match report.outcome {
        TuneOutcome::Returned(_) => (
            "Nothing: the joint is as it was.".to_owned(),
            "Read below what was not learnt, change it, and tune again.",
        ),
        TuneOutcome::Saved => (
            differences(report).unwrap_or("The trial shows no difference".into()) + ".",
            "Use the joint. To bring the former set back: `host-sim tune --undo`",
        ),
    };
    let next = next.to_owned();
    Answers { what: happened(report), certainty, benefit: Benefit::Gain(gain), next }
}

/// Returns what was saved, as a sentence.
fn saved(report: &TuneReport) -> &'static str {
    match report.arm {
        TuneArm::NewLoop => "The new loop gains are saved; the friction model is the former one.",
        TuneArm::Former | TuneArm::New => "The new parameters are saved.",
    }
}

/// Returns what is smaller and what is larger with the new set: "Error at reversals and current are smaller". `None` if the
/// trial shows no difference.
fn differences(report: &TuneReport) -> Option<String> {
    let named = |wanted: Verdict| {
        let gains = report.gains.iter().filter(|gain| Verdict::of(gain) == wanted);
        let names: Vec<&str> = gains.map(|gain| gain.quantity.in_words()).collect();
        let is_or_are = if names.len() == 1 { "is" } else { "are" };
        let named = || format!("{} {is_or_are} {}", listed(&names, usize::MAX), wanted.in_words());
        (!names.is_empty()).then(named)
    };
    let parts: Vec<String> =
        [Verdict::Better, Verdict::Worse].into_iter().filter_map(named).collect();
    (!parts.is_empty()).then(|| capitalised(&parts.join(", ")))
}

/// Returns a text as a sentence: with a capital letter and a full stop.
fn sentence(text: &str) -> String {
    let stop = if text.trim().ends_with(['.', '!', '?']) { "" } else { "." };
    match text.trim() {
        "" => "No reason is recorded.".to_owned(),
        text => capitalised(text) + stop,
    }
}

/// Returns the cause with its meaning and probability.
pub(super) fn cause(report: &TuneReport) -> String {
    let name = report.cause.as_str();
    let probability = match report.probability {
        known if known.is_finite() => format!("probability {}", probability_in_words(known)),
        _ => "probability not known".to_owned(),
    };
    match cause::named(name) {
        _ if name == "none" => "None: the model explains what was recorded.".to_owned(),
        Some(known) => format!("{} ({name}), {probability}", capitalised(known.meaning())),
        None => format!("{name}, {probability}"),
    }
}

/// Explains the trial above its table.
pub(super) fn trial(report: &TuneReport) -> String {
    let arms = report.trial.arms().into_iter();
    let sets: Vec<String> =
        arms.map(|arm| format!("{} is {}", arm.letter(), arm.in_words())).collect();
    // Blanks between the letters, so that a line can break in the order.
    let order: Vec<&str> = report.trial.blocks.iter().map(|block| block.arm.letter()).collect();
    format!(
        "The same motion was performed {} times in the order {}. {}. In this order, a steady drift of the joint favours no set. \
         The interval of a change is Student's over the rounds. It shows a difference only if it does not include zero.",
        report.trial.blocks.len(),
        order.join(" "),
        sets.join(", ")
    )
}

/// Returns the name of a quantity with a capital letter.
pub(super) fn name(quantity: TuneQuantity) -> String {
    capitalised(quantity.in_words())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gain(gain: f64, ci95: [f64; 2]) -> TuneGain {
        let quantity = TuneQuantity::TrackingRms;
        TuneGain { quantity, unit: quantity.unit(), before: 0.02, after: 0.01, gain, ci95 }
    }

    #[test]
    fn change_has_sign_of_the_new_value_against_the_former() {
        assert_eq!(change(&gain(0.673, [0.6, 0.72])), "−67\u{a0}%");
        assert_eq!(interval(&gain(0.673, [0.6, 0.72])), "−72 to −60\u{a0}%");
        assert_eq!(change(&gain(-0.031, [-0.05, -0.012])), "+3.1\u{a0}%");
        assert_eq!(interval(&gain(0.01, [-0.02, 0.04])), "−4.0 to +2.0\u{a0}%");
        assert_eq!(change(&gain(-0.0, [0.0, 0.0])), "0.0\u{a0}%");
    }

    #[test]
    fn verdict_follows_the_interval() {
        let of = |ci95| Verdict::of(&gain(0.1, ci95));
        assert_eq!(of([0.05, 0.2]), Verdict::Better);
        assert_eq!(of([-0.2, -0.05]), Verdict::Worse);
        assert_eq!(of([0.0, 0.2]), Verdict::Open);
        assert_eq!(of([f64::NAN, 0.2]), Verdict::NotMeasured);
        assert_eq!(Verdict::of(&gain(f64::INFINITY, [0.1, 0.2])), Verdict::NotMeasured);
    }

    #[test]
    fn small_angles_are_in_mrad() {
        assert_eq!(means(&gain(0.5, [0.4, 0.6])), "20.0 → 10.0\u{a0}mrad");
        assert_eq!(shown_unit("rad", &[0.2, f64::NAN]), ("rad", 1.0));
        assert_eq!(shown_unit("A", &[0.01]), ("A", 1.0));
    }

    #[test]
    fn durations_are_in_minutes_and_seconds() {
        let texts = [3.25, 59.6, 292.0, f64::NAN].map(duration);
        assert_eq!(texts, ["3.25\u{a0}s", "1\u{a0}min", "4\u{a0}min 52\u{a0}s", NOT_MEASURED]);
    }

    #[test]
    fn reason_becomes_a_sentence() {
        assert_eq!(sentence("the energy grew "), "The energy grew.");
        let missing = sentence("");
        assert!(missing.ends_with('.') && missing.len() > 1, "{missing}");
    }
}

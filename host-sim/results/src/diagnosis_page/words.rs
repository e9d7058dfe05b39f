//! The title of the page, and the texts beside its charts and tables.

use super::Scene;
use super::figures::{AFTER, BEFORE};
use super::over_time::NoiseFloor;
use crate::budget::removed_in_words;
use crate::page::words::{self as shared, counted, listed, quantity};
use crate::ranking::left_out_in_words;
use friction_diagnose::contest_calibration::ContestCalibration;
use friction_diagnose::{Diagnosis, Finding, LeftOut, NAMED, STRUCTURE};
use joint_log::number::significant;

/// Returns why no cause is named, as the first words of a sentence.
pub(super) fn none_named(found: &Diagnosis) -> &'static str {
    match found.candidates.is_empty() {
        true => "None: no column of the log explains a part of the error",
        false => "None: no candidate is likely enough to be real",
    }
}

/// Text of the evidence section if there is no finding.
pub(super) fn nothing_found(scene: &Scene) -> String {
    let found = scene.about.found;
    let times = found.after.metrics.rmse / found.noise_floor;
    let left = match times.is_finite() && times > STRUCTURE {
        true => format!("{} No candidate explains the rest.", removed_in_words(found)),
        false => "The residual of the base model does not differ significantly from noise.".into(),
    };
    format!(
        "{}. {left} The chart shows the autocorrelation of the residual; white noise has none.",
        none_named(found)
    )
}

/// Describes the error of the base model just after reversals, in one sentence.
pub(super) fn reversals(found: &Diagnosis, unit: &str) -> String {
    let regime =
        |name: &str| found.by_regime.iter().find(|share| share.name == name && share.of_rows > 0.0);
    let (reversal, sliding) = (regime("reversal"), regime("sliding"));
    let Some(reversal) = reversal else {
        let why = match found.baseline.spec.law.has_bristles() {
            true => "the joint does not reverse within a run",
            false => "the base law has no bristles, whose travel defines the window",
        };
        return format!("There are no reversal windows: {why}.");
    };
    let beside = sliding.map_or_else(String::new, |sliding| {
        format!(", compared with {} in sliding", quantity(sliding.rmse, unit))
    });
    format!(
        "Just after reversals ({} % of the rows), the RMSE of the base model is {}{beside}.",
        significant(100.0 * reversal.of_rows, 2),
        quantity(reversal.rmse, unit)
    )
}

/// Text above the charts of the residual with its own sign.
pub(super) const PLAIN: &str = "In these charts, the residual keeps its own sign. A torque that does not depend on the \
     direction of motion (an offset, a load, an imbalance) is visible here and averages out in the charts above. A wrong \
     friction level is visible above and averages out here.";

/// Caption of the shares by state of motion.
pub(super) const REGIMES: &str = "If the bar of the squared error is longer than that of the rows, the model is worse there \
     than elsewhere. Error bars are two standard errors over the runs.";

/// Caption of the shares by direction.
pub(super) const DIRECTIONS: &str =
    "If the model is wrong in one direction only, most of the squared error is in that direction.";

/// Text above the parameters.
pub(super) const PARAMETERS: &str = "Values are given with one standard error. Only a \"determined\" parameter describes the \
     machine. A parameter that changes from before to after compensated for the missing cause in the base model.";

/// Where the charts are that a short page leaves out.
pub(super) const SHORT: &str = if cfg!(feature = "stochastic") {
    "This is the short page of a fleet. The command diagnose on the same log draws the remaining residual over every \
     column, the error by state of motion and the stochastic extension too."
} else {
    "This is the short page of a fleet. The command diagnose on the same log draws the remaining residual over every \
     column and the error by state of motion too."
};

/// Returns the title of the page: the files and the causes.
pub(super) fn title(scene: &Scene) -> String {
    let on = shared::file_names(&scene.about.input.data);
    let of = if on.is_empty() { "Diagnosis".to_owned() } else { format!("Diagnosis of {on}") };
    let mut causes: Vec<&str> =
        scene.about.found.findings.iter().map(|finding| finding.cause.name()).collect();
    causes.dedup();
    match causes.as_slice() {
        [] => format!("{of}: no cause found"),
        causes => format!("{of}: {}", listed(causes, 3)),
    }
}

/// Returns the subtitle: the log and the held-out parts.
pub(super) fn subtitle(scene: &Scene) -> String {
    if !scene.about.found.log.leaves_each_out {
        return shared::subtitle(&scene.view);
    }
    let unit = match scene.about.found.left_out {
        Some(LeftOut::Stretches) => "segment of each run",
        _ => "run",
    };
    format!("{} Each {unit} was held out once.", shared::logged(&scene.view))
}

/// Returns what the values before and after are, for the legends.
pub(super) fn meanings(scene: &Scene) -> [(&'static str, String); 2] {
    let found = scene.about.found;
    let extension = found.extension().unwrap_or_default();
    [
        (BEFORE, format!("base model, {}", found.baseline.spec)),
        (AFTER, format!("with the extension, {extension}")),
    ]
}

/// Names the models before and after.
fn models(scene: &Scene) -> String {
    let found = scene.about.found;
    match found.extension() {
        Some(extension) => format!("Before: {}. After: {extension}.", found.baseline.spec),
        None => format!("The model is {}; no extension is proposed.", found.baseline.spec),
    }
}

/// Text above the predictions.
pub(super) fn predictions(scene: &Scene) -> String {
    let which = match scene.is_extended() {
        true => "The charts show the held-out segment with the largest gain of the extension.",
        false => "The charts show the held-out segment with the largest error.",
    };
    format!("{} {which}", models(scene))
}

/// Explains the charts of means.
pub(super) fn reading_means(scene: &Scene) -> Vec<String> {
    let mut texts = vec![
        format!(
            "The residual is the logged minus the simulated {}. \"Residual along the motion\" is positive where the joint \
             resists more than the model predicts, in either direction of motion; rows at rest are left out.",
            scene.torque()
        ),
        format!(
            "Points are means of rows{}; bars are two standard errors. Consecutive rows within the correlation length of the \
             residual (here {}) count as one observation. The axis fits the means, so single rows may lie outside it. Means \
             of a right model are flat at zero.",
            if scene.about.found.log.leaves_each_out {
                ", each predicted by a model that was fitted without it"
            } else {
                " of training and held-out runs"
            },
            counted((2.0 * scene.memory).ceil() as usize, "row")
        ),
    ];
    if scene.about.found.findings.len() > 1 {
        texts.push(
            "\"After, without this cause\" is the extended model without this cause and without a new fit. It shows what this \
             cause alone explains."
                .into(),
        );
    }
    texts
}

/// Text above the charts of the remaining residual.
pub(super) fn left_over(scene: &Scene) -> String {
    let grey = "The grey band contains the middle half of the rows before the extension. The chart over the campaign uses all runs.";
    match scene.is_extended() {
        true => format!(
            "Held-out rows. A pattern that remains after the extension is not explained by it. A column that is only correlated \
             with the cause has no pattern after the extension. {grey}"
        ),
        false => {
            format!(
                "Held-out rows. A visible pattern shows an effect that the model does not contain. {grey}"
            )
        }
    }
}

/// Describes each finding in a sentence, and explains the columns of the table.
pub(super) fn findings(found: &Diagnosis) -> Vec<String> {
    let sentence = |finding: &Finding| {
        format!("{}: {}.", finding.cause.name(), finding.in_words.trim_end_matches('.'))
    };
    let mut texts: Vec<String> = found.findings.iter().map(sentence).collect();
    texts.push(
        "Share: the reduction of the squared error of the base law when this cause is added last; for an \"unknown\" without \
         a column, what remains unexplained. Stability: the share of resampled logs whose best hypothesis holds this cause. \
         p: the share of those whose best hypothesis does not."
            .into(),
    );
    texts
}

/// Returns the verdicts of the fits about their parameters.
pub(super) fn verdicts(scene: &Scene) -> Vec<String> {
    let found = scene.about.found;
    let mut fits = vec![("before", &found.baseline)];
    if scene.is_extended() {
        fits.push(("after", &found.extended));
    }
    let texts = |(when, fit): (&'static str, &friction_fit::Outcome)| {
        let sentence =
            move |verdict: &String| format!("{when}: {}.", verdict.trim_end_matches('.'));
        fit.verdicts.iter().map(sentence).collect::<Vec<_>>()
    };
    fits.into_iter().flat_map(texts).collect()
}

/// Describes the method of the diagnosis.
pub(super) fn methods(scene: &Scene) -> Vec<String> {
    let found = scene.about.found;
    let log = &found.log;
    let floor = NoiseFloor::of(scene);
    vec![
        "Models are simulated with the integration step of the joint driver, here in double precision, along the logged \
         motion. The free parameters minimise the sum of squared residuals, or Huber's loss where the verdicts name it \
         (Levenberg-Marquardt with exact derivatives)."
            .into(),
        format!(
            "Hypotheses compete: a correction of the log, a base law and a set of causes, all linear in their columns, compared \
             by their error on rows that their fit has not seen. The causes are those of the catalogue whose column is in the \
             log and varies. Ripple orders come from the spectrum over the position. A curve over any column is tested as \
             \"unknown\". {} candidates were in the best hypothesis or won in a resampled log.",
            found.candidates.len()
        ),
        format!(
            "The best few hypotheses are fitted with the law of the driver, all parameters jointly. An extension without gain on \
             held-out rows is not offered. The probability of a cause comes from these figures: how often the best \
             hypothesis of a resampled log holds it, and what it takes of the error alone and last. The weights of the figures \
             come from {}; a cause below a probability of {} is not named. What is physically impossible is refused by rule. \
             \"Indistinguishable from\" lists causes that win in its place.",
            ContestCalibration::current().name,
            significant(NAMED, 2)
        ),
        format!(
            "The noise floor ({}) is the error of the best possible model. It has two parts: the noise of the logged {}, from \
             the median of its second differences ({}), and the effect of the uncertain motion on the base law ({}). Rows \
             with a large effect of the uncertain motion have less weight. The estimate assumes white noise: if the logger \
             filters the signal, the true floor is higher and no model can reach the estimate.",
            quantity(found.noise_floor, scene.unit()),
            scene.torque(),
            quantity(floor.noise, scene.unit()),
            quantity(floor.motion, scene.unit())
        ),
        "The intervals of sizes are 1.96 standard errors of the joint fit, corrected for the autocorrelation of the residual; \
         they do not include model errors. The interval of the gain is from resampled blocks of held-out rows. Neither \
         includes differences between campaigns."
            .into(),
        format!(
            "{} The same rows also select the findings, so the gain of a finding that barely passed is overestimated.{}",
            left_out_in_words(found),
            if log.decimate > 1 { format!(" The residual is evaluated at one row in {}.", log.decimate) } else { String::new() }
        ),
        format!(
            "Created by host-sim {} with seed {} in {} s.",
            env!("CARGO_PKG_VERSION"),
            scene.about.input.seed,
            significant(found.seconds, 2)
        ),
    ]
}

/// Returns notes about the data.
pub(super) fn sources(scene: &Scene) -> Vec<String> {
    let mut texts = shared::sources(&scene.view);
    let data = &scene.about.input.data;
    let extra_columns: Vec<&str> =
        scene.about.found.log.extras.iter().map(|index| data.covariates[*index].as_str()).collect();
    if !extra_columns.is_empty() {
        texts.push(format!(
            "Additional columns tested as possible causes: {}.",
            listed(&extra_columns, 12)
        ));
    }
    let notes = scene.about.found.log.notes.iter();
    texts.extend(notes.map(|note| format!("{}.", note.trim_end_matches('.'))));
    texts
}

//! The page's title and the texts beside its charts and tables.

use super::Scene;
use super::over_time::Floor;
use crate::results::page::words::{self as shared, counted, listed, quantity};
use crate::results::ranking::left_out_in_words;
use compensator_core::term::KNOTS;
use friction_identification::diagnose::gram_blocks::LeftOut;
use friction_identification::diagnose::thresholds::{CHANCE, EXTRAPOLATES, MATERIAL, STRUCTURE};
use friction_identification::diagnose::{Diagnosis, Finding};
use friction_identification::number::significant;

/// Where nothing was found.
pub(super) fn nothing_found(scene: &Scene) -> String {
    let found = scene.about.found;
    let times = found.after.metrics.rmse / found.noise_floor;
    let left = match times.is_finite() && times > STRUCTURE {
        true => format!(
            "What the base model leaves over is {} times the floor, and nothing that was tried explains it",
            significant(times, 3)
        ),
        false => {
            "What the base model leaves over is no more than noise as far as these rows can tell"
                .into()
        }
    };
    format!(
        "No cause passed. {left}. The chart shows how long the residual remembers; noise does not."
    )
}

/// How wrong the base model is just after it turned round, in a line.
pub(super) fn reversals(found: &Diagnosis, unit: &str) -> String {
    let regime =
        |name: &str| found.by_regime.iter().find(|share| share.name == name && share.of_rows > 0.0);
    let (reversal, sliding) = (regime("reversal"), regime("sliding"));
    let Some(reversal) = reversal else {
        let why = match found.baseline.spec.law.has_bristles() {
            true => "the joint never turns round within a run",
            false => "the base law has no bristles, whose travel would set one",
        };
        return format!("There are no reversal windows: {why}.");
    };
    let beside = sliding.map_or_else(String::new, |sliding| {
        format!(", against {} in plain sliding", quantity(sliding.rmse, unit))
    });
    format!(
        "Inside reversal windows ({} % of the rows) the base model is wrong by {} RMS{beside}.",
        significant(100.0 * reversal.of_rows, 2),
        quantity(reversal.rmse, unit)
    )
}

/// Above the charts that do not look along the motion.
pub(super) const PLAIN: &str = "Here the residual keeps its own sign. A torque that acts whichever way the joint moves (an \
     offset, a load, an imbalance) shows in these charts and averages out in those above; a level of friction that is off \
     shows above and averages out here.";

/// Under the shares by regime.
pub(super) const REGIMES: &str = "A bar of the error longer than that of the rows: the model is worse there than elsewhere. \
     Error bars are two standard errors over the runs.";

/// Under the shares by direction.
pub(super) const DIRECTIONS: &str =
    "A model that is wrong in one direction alone has its error there.";

/// Above the parameters.
pub(super) const PARAMETERS: &str = "A value is given with one standard error. Only a parameter that is \"determined\" says \
     something of the machine. What moves from before to after is what the base model had bent to make up for the cause.";

/// The page's title: the files, and what was found.
pub(super) fn title(scene: &Scene) -> String {
    let files = &scene.about.data.files;
    let name = |file: &std::path::PathBuf| {
        file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned()
    };
    let on = listed(&files.iter().map(name).collect::<Vec<_>>(), 3);
    let of = if on.is_empty() { "Diagnosis".to_owned() } else { format!("Diagnosis of {on}") };
    let mut causes: Vec<&str> =
        scene.about.found.findings.iter().map(|finding| finding.cause.name()).collect();
    causes.dedup();
    match causes.as_slice() {
        [] => format!("{of}: nothing systematic is left"),
        causes => format!("{of}: {}", listed(causes, 3)),
    }
}

/// What was logged and what was held out.
pub(super) fn subtitle(scene: &Scene) -> String {
    if !scene.about.found.log.leaves_each_out {
        return shared::subtitle(&scene.view);
    }
    let unit = match scene.about.found.left_out {
        Some(LeftOut::Stretches) => "stretch of each run",
        _ => "run",
    };
    format!("{} Every {unit} was left out of a fit once, to judge by.", shared::logged(&scene.view))
}

/// What before and after are.
fn models(scene: &Scene) -> String {
    let found = scene.about.found;
    match scene.is_extended() {
        true => format!("Before: {}. After: {}.", found.baseline.spec, found.extended.spec),
        false => format!("The model is {}; no extension is offered.", found.baseline.spec),
    }
}

/// Above the telling run.
pub(super) fn predictions(scene: &Scene) -> String {
    let which = match scene.is_extended() {
        true => "Of all that was left out of a fit, this is where the extension gains most.",
        false => "Of all that was left out of a fit, this is where the model is most wrong.",
    };
    format!("{} {which}", models(scene))
}

/// How the charts of means are to be read.
pub(super) fn reading_means(scene: &Scene) -> Vec<String> {
    let mut said = vec![
        format!(
            "The residual is the logged minus the simulated {}. \"Resists more than simulated\" is the residual along the \
             motion: positive where the joint resists more than the model says, whichever way it moves; rows at rest are \
             left out.",
            scene.torque()
        ),
        format!(
            "Points are means of rows{}; bars are two standard errors. Rows that follow each other count as one observation \
             as long as the residual remembers (here {}). Single rows may reach beyond the axis, which is that of the means. \
             Right is what lies flat at zero.",
            if scene.about.found.log.leaves_each_out {
                ", each predicted by a fit that has not seen it"
            } else {
                ", of fitted and set-apart runs together"
            },
            counted((2.0 * scene.memory).ceil() as usize, "row")
        ),
    ];
    if scene.about.found.findings.len() > 1 {
        said.push(
            "\"After, without it\" is the extended model with this one cause taken out and nothing fitted anew: what this \
             cause alone explains."
                .into(),
        );
    }
    said
}

/// Above the survey of the residual.
pub(super) fn left_over(scene: &Scene) -> String {
    let grey = "The grey band holds the middle half of the rows, before; the chart over the campaign has all runs in it.";
    match scene.is_extended() {
        true => format!(
            "Rows left out of the fit. What still has a shape after the extension is not explained by it; a column that only went \
             along with the cause falls flat without having been named. {grey}"
        ),
        false => {
            format!("Rows left out of the fit. What has a shape here is not explained. {grey}")
        }
    }
}

/// The findings, a sentence each.
pub(super) fn findings(found: &Diagnosis) -> Vec<String> {
    let sentence = |finding: &Finding| {
        format!("{}: {}.", finding.cause.name(), finding.in_words.trim_end_matches('.'))
    };
    let mut said: Vec<String> = found.findings.iter().map(sentence).collect();
    said.push(
        "Share: what goes off the squared residual of the base model when this cause comes in last. p: the probability that the best of all \
         candidates looks as good where nothing is hidden. Stability: the share of resampled logs in which this cause wins \
         against all others."
            .into(),
    );
    said
}

/// What the fits say of their parameters.
pub(super) fn verdicts(scene: &Scene) -> Vec<String> {
    let found = scene.about.found;
    let mut fits = vec![("before", &found.baseline)];
    if scene.is_extended() {
        fits.push(("after", &found.extended));
    }
    let said = |(when, fit): (&'static str, &friction_identification::fit::Outcome)| {
        let sentence =
            move |verdict: &String| format!("{when}: {}.", verdict.trim_end_matches('.'));
        fit.verdicts.iter().map(sentence).collect::<Vec<_>>()
    };
    fits.into_iter().flat_map(said).collect()
}

/// How the diagnosis was made.
pub(super) fn methods(scene: &Scene) -> Vec<String> {
    let found = scene.about.found;
    let log = &found.log;
    let floor = Floor::of(scene);
    vec![
        "A model is simulated by the step that runs on the joint driver, here in double precision, driven by the logged \
         motion; its free parameters are fitted to the sum of squared residuals by Levenberg-Marquardt with exact \
         derivatives. Unless a model was given, the base is the simplest of linear, stribeck and lugre that the log \
         supports, by a BIC that counts independent rows."
            .into(),
        format!(
            "Candidates: every cause of the catalogue whose column is in the log and varies, as what it would change in the \
             torque row by row; ripples by their order, found in the spectrum over the position; and, with a handicap and \
             after the named causes, a curve of {KNOTS} knots over any column (\"unknown\"). {} were heard.",
            found.scores.len()
        ),
        format!(
            "A candidate passes if the squared error on rows left out of the fit falls by more than chance gives the best of \
             all candidates (p below {}, blocks of rows as observations), by at least {} % of what is beyond the floor, and \
             on whole runs left out too (by {} standard error over five runs or more), where runs can show it. Those that pass are fitted together with \
             everything else; the one that explains most of rows it has not seen stays, and the next round looks at what is \
             left. Causes that bend the base model's own parameters get a fit even where this rates them low, if structure \
             is left.",
            significant(CHANCE, 1),
            significant(100.0 * MATERIAL, 1),
            significant(EXTRAPOLATES, 1)
        ),
        "At the end every finding is taken out once and has to win its place again, by the same rules; then base and \
         extension are fitted anew with every run left out once, and what does not gain is taken back. \"Not told apart \
         from\" names what would explain the same."
            .into(),
        format!(
            "Noise floor ({}), what the best possible model would leave: the noise of the logged {} from its second \
             differences, whose median keeps breakaways out ({}), and what draws of the motion as it may have been do to the \
             base law ({}). A row counts the less the more the uncertain motion does to it. It is a floor for white noise: a \
             logger that smooths shows less than its sensor makes, and then no model can reach it.",
            quantity(found.noise_floor, scene.unit()),
            scene.torque(),
            quantity(floor.noise, scene.unit()),
            quantity(floor.motion, scene.unit())
        ),
        "Intervals of sizes are 1.96 standard errors of the joint fit, with neighbouring rows counted as one observation as \
         far as the residual hangs together; they do not hold what the model gets wrong. The interval of the gain is that \
         of resampled blocks of unseen rows. Both speak of this campaign: what differs from one campaign to the next is \
         in neither."
            .into(),
        format!(
            "{} The same rows say which cause may stay, so they flatter a finding that only just stayed.{}",
            left_out_in_words(found),
            if log.decimate > 1 { format!(" Residuals are judged at one row in {}.", log.decimate) } else { String::new() }
        ),
        format!(
            "Made by host-sim {} with seed {} in {} s.",
            env!("CARGO_PKG_VERSION"),
            scene.about.seed,
            significant(found.seconds, 2)
        ),
    ]
}

/// What a reader should know of the data.
pub(super) fn sources(scene: &Scene) -> Vec<String> {
    let mut said = shared::sources(&scene.view);
    let data = scene.about.data;
    let heard: Vec<&str> =
        scene.about.found.log.extras.iter().map(|index| data.covariates[*index].as_str()).collect();
    if !heard.is_empty() {
        said.push(format!(
            "Heard as possible causes beside the columns of the contract: {}.",
            listed(&heard, 12)
        ));
    }
    let notes = scene.about.found.log.notes.iter();
    said.extend(notes.map(|note| format!("{}.", note.trim_end_matches('.'))));
    said
}

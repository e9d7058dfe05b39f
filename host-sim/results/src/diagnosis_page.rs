//! `report.html` of `diagnose`: what the model misses, why, and what the extension gains.
//!
//! The first screen shows the answers: cause, probability, gain and next step. Below them it shows further facts, the torque
//! over time where the effect is largest, and the error that a model could remove. Five summary sentences follow. The sections below give the evidence:
//! the log itself, the errors, all candidates with their rejection reasons, the predictions, the residual over the named
//! cause, the remaining residual, the parameters, the method, and the data.
//!
//! *Before* is the base model and *after* the extended model, in the same two colours on the whole page. A residual is
//! logged minus simulated.
//!
//! Structure: `rows` (held-out rows as columns, with both residuals) -> `bins` (means with standard errors) ->
//! `evidence`, `figures`, `tables`, `words`, `stochastic` (one block each) -> [`page`] (the order of the blocks). Parts
//! that the page of `compare` also has come from [`mod@crate::page`].

mod bins;
mod evidence;
mod figures;
mod largest_effect;
mod lead;
mod log;
mod over_time;
mod rows;
#[cfg(feature = "stochastic")]
mod stochastic;
mod tables;
mod words;

#[cfg(feature = "stochastic")]
pub use stochastic::stochastic_section;

use super::page::{self as shared, FitReport, View};
use super::ranking::{RankedCandidate, left_out_in_words, ranking};
use crate::diagnosed_log::DiagnosedLog;
use crate::report::{Block, Page, Section};
use friction_diagnose::summary;
use friction_fit::{Predicted, autocorrelation_time, predict};
use rows::Rows;
#[cfg(feature = "stochastic")]
use serde_json::Value;

/// Maximum number of candidates in the chart.
const MAX_CHART_CANDIDATES: usize = 20;
/// Maximum number of candidates in the visible table; the others are in a collapsed block.
const MAX_TABLE_CANDIDATES: usize = 12;

/// A diagnosis with the derived values that the page shows.
struct Scene<'a> {
    about: DiagnosedLog<'a>,
    /// Both models (before, after) as on the page of `compare`.
    view: View<'a>,
    /// Held-out rows.
    held: Rows<'a>,
    /// All rows.
    all: Rows<'a>,
    /// Autocorrelation time of the extended model's residual, in rows.
    memory: f64,
}

impl Scene<'_> {
    /// Returns true if the extended model differs from the base model.
    fn is_extended(&self) -> bool {
        self.about.found.extension().is_some()
    }

    /// Returns the name of the base model in legends: "before", or "base model" if there is no extended model.
    fn base(&self) -> &'static str {
        if self.is_extended() { figures::BEFORE } else { "base model" }
    }

    /// Returns "rad" or "m".
    fn position_unit(&self) -> &'static str {
        self.about.input.data.joint.position_unit()
    }

    /// Returns "rad/s" or "m/s".
    fn velocity_unit(&self) -> &'static str {
        self.about.input.data.joint.velocity_unit()
    }

    /// Returns "torque" or "force".
    fn torque(&self) -> &'static str {
        self.view.torque()
    }

    /// Returns "Nm" or "N".
    fn unit(&self) -> &'static str {
        self.view.unit()
    }
}

/// Returns the page of a diagnosis.
pub fn page(about: &DiagnosedLog) -> Page {
    in_scene(about, |scene| page_of(scene, false))
}

/// Largest number of points of a curve on a short page.
const SHORT_CURVE_POINTS: usize = 120;

/// Returns a page of less than 100 kB, for one of thousands of diagnoses: without the charts of the remaining residual, of the
/// state of motion and of the stochastic extension, and with fewer points in the others.
pub fn short_page(about: &DiagnosedLog) -> Page {
    let mut page = in_scene(about, |scene| page_of(scene, true));
    page.limit_points(SHORT_CURVE_POINTS);
    page
}

/// Returns the first screen as an HTML fragment without scripts, for a notebook: the answers, the facts, the error that a
/// model could remove as bars, and the summary.
pub fn first_screen(about: &DiagnosedLog) -> String {
    in_scene(about, |scene| {
        let mut page = opening(scene);
        page.push(Block::List(summary::summary(scene.about.found))).fragment()
    })
}

/// Derives the values that the page shows, and passes them on.
fn in_scene<R>(about: &DiagnosedLog, show: impl FnOnce(&Scene) -> R) -> R {
    let DiagnosedLog { found, input, .. } = *about;
    let (log, data, split) = (&found.log, &input.data, &input.split);
    let fits = [found.baseline.clone(), found.extended.clone()];
    let fits = if found.extended.spec == found.baseline.spec { &fits[..1] } else { &fits[..] };
    let study = FitReport { input, test: log.test_rows(), fits };
    // If every run is held out once, all rows are held-out rows.
    let on_train = (!log.leaves_each_out).then(|| {
        [&found.baseline, &found.extended]
            .map(|fit| predict(&fit.parameters, log.train_rows(), fit.resolution))
    });
    let held = || {
        let both = [&found.before, &found.after];
        Rows::new(data, &split.test, &log.test_tracks, both, log.decimate)
    };
    let trained = on_train.as_ref().map(|[before, after]| {
        Rows::new(data, &split.train, &log.train_tracks, [before, after], log.decimate)
    });
    let scene = Scene {
        about: *about,
        view: View::new(&study),
        held: held(),
        all: trained.map_or_else(held, |trained| trained.joined(held())),
        memory: memory(&found.after),
    };
    show(&scene)
}

fn opening(scene: &Scene) -> Page {
    let charts = largest_effect::chart(scene).into_iter().chain([lead::removable_error(scene)]);
    let lead = Block::Lead { facts: lead::facts(scene), charts: charts.collect() };
    let mut page = Page::new(words::title(scene), words::subtitle(scene));
    page.push(lead);
    page.answering(lead::answers(scene))
}

fn page_of(scene: &Scene, is_short: bool) -> Page {
    let mut page = opening(scene);
    page.push(Block::Contents);
    page.add(Section::new("Summary").list(summary::summary(scene.about.found)));
    page.add(log::log(scene)).add(gain(scene)).add(candidates(scene));
    page.add(predictions(scene)).add(evidence(scene));
    if is_short {
        page.push(Block::Paragraph(words::SHORT.into()));
    } else {
        page.add(left_over(scene)).add(where_in_motion(scene));
    }
    page.add(parameters(scene));
    if !is_short {
        page.add(stochastic(scene));
    }
    page.add(shared::methods(&scene.view, words::methods(scene)));
    page.add(shared::data(&scene.view, words::sources(scene)));
    for (name, meaning) in words::meanings(scene) {
        page.explain(name, &meaning);
    }
    page
}

/// Returns the autocorrelation time of the residuals, in rows.
fn memory(predicted: &Predicted) -> f64 {
    autocorrelation_time(predicted.residuals.iter().map(Vec::as_slice))
}

fn gain(scene: &Scene) -> Section {
    Section::new("Prediction error on held-out rows")
        .words(left_out_in_words(scene.about.found))
        .chart(figures::budget(scene))
        .chart(figures::errors(scene))
}

fn predictions(scene: &Scene) -> Vec<Block> {
    let Some([over_time, close_up @ ..]) = figures::predictions(scene) else { return Vec::new() };
    Section::new(format!("Logged and simulated {}", scene.torque()))
        .words(words::predictions(scene))
        .chart(over_time)
        .charts(close_up.into())
        .into_iter()
        .collect()
}

fn evidence(scene: &Scene) -> Section {
    let section = Section::new("Evidence");
    let findings = &scene.about.found.findings;
    let Some((first, others)) = findings.split_first() else {
        return section.words(words::nothing_found(scene)).chart(figures::autocorrelation(scene));
    };
    let section = section.list(words::reading_means(scene)).charts(evidence::of(scene, first));
    let section = section.chart(match scene.is_extended() {
        true => figures::added(scene),
        false => figures::autocorrelation(scene),
    });
    others.iter().fold(section, |section, other| {
        let summary = format!("Evidence for {}", other.cause.name());
        section.details(summary, Block::rows(evidence::of(scene, other)))
    })
}

fn left_over(scene: &Scene) -> Section {
    let (along, plain) = evidence::survey(scene);
    let plain = [vec![Block::Paragraph(words::PLAIN.into())], Block::rows(plain)].concat();
    let section = Section::new("Remaining residual")
        .words(words::left_over(scene))
        .chart(over_time::over_time(scene))
        .charts(along)
        .details("The same charts without the sign of the motion", plain);
    match !scene.about.found.findings.is_empty() && scene.is_extended() {
        true => section.chart(figures::autocorrelation(scene)),
        false => section,
    }
}

fn where_in_motion(scene: &Scene) -> Section {
    let found = scene.about.found;
    Section::new("Error of the base model by state of motion")
        .charts(vec![
            figures::shares(scene, "By state of motion", &found.by_regime, words::REGIMES),
            figures::shares(scene, "By direction", &found.by_direction, words::DIRECTIONS),
        ])
        .words(words::reversals(found, scene.unit()))
        .table(tables::shares(scene))
}

fn candidates(scene: &Scene) -> Section {
    let found = scene.about.found;
    let mut section = Section::new("Causes that were tested");
    if !found.findings.is_empty() {
        section = section.table(tables::findings(scene)).list(words::findings(found));
    }
    let ranking = ranking(found);
    // Findings are always drawn, whatever their rank.
    let is_drawn = |(place, ranked): &(usize, &RankedCandidate)| {
        *place < MAX_CHART_CANDIDATES || ranked.is_finding
    };
    let drawn = ranking.iter().enumerate().filter(is_drawn);
    let drawn: Vec<&RankedCandidate> = drawn.map(|(_, ranked)| ranked).collect();
    if drawn.is_empty() {
        return section
            .words("There are no candidates: no column of this log varies enough to be tested.");
    }
    let open = &ranking[..ranking.len().min(MAX_TABLE_CANDIDATES)];
    let caption = "Each candidate, those of the best hypothesis first";
    section = section.chart(figures::ranking(&drawn)).table(tables::ranking(caption, open));
    if ranking.len() > MAX_TABLE_CANDIDATES {
        let all = tables::ranking("All candidates", &ranking);
        section = section.details(format!("All {} candidates", ranking.len()), [all.into()]);
    }
    section
}

fn parameters(scene: &Scene) -> Section {
    Section::new("Parameters")
        .words(words::PARAMETERS)
        .table(tables::parameters(scene))
        .list(words::verdicts(scene))
        .with(shared::tables::correlation(&scene.about.found.extended))
}

#[cfg(feature = "stochastic")]
fn stochastic(scene: &Scene) -> Vec<Block> {
    let made = scene.about.stochastic;
    let after = if scene.is_extended() { made.after.json() } else { Value::Null };
    stochastic_section(&made.before.json(), &after, Some(&made.reading))
}

#[cfg(not(feature = "stochastic"))]
fn stochastic(_: &Scene) -> Vec<Block> {
    Vec::new()
}

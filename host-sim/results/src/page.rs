//! `compare.html` and `fit.html`: the results of fits.
//!
//! Both commands use the same page; `identify` passes a list of one fit. The order is: best model, its reliability, its
//! predictions, its residual, the parameters, the method, and the data. `summary` gives the result in five sentences,
//! from the same values as the tables.
//!
//! Structure: `held_out` (rows and simulations) -> `summary`, `figures`, `tables`, `words`, `glossary` (one block each)
//! -> [`compare_fits`] (the order of the blocks). The best three models and the simplest one are visible; the others are in
//! collapsed blocks.

mod figures;
mod glossary;
pub(super) mod held_out;
mod summary;
pub(super) mod tables;
pub(super) mod words;

use crate::report::{Answers, Benefit, Block, Chart, Page, Section};
use compensator_core::LawKind;
use friction_diagnose::prepare::Prepared;
use friction_fit::{Outcome, Rows};
use held_out::HeldOut;
use joint_log::JointKind;

/// Number of best models that are visible.
const VISIBLE_MODELS: usize = 3;

/// The input of the page.
#[derive(Clone, Copy)]
pub struct FitReport<'a> {
    /// The log.
    pub input: &'a Prepared,
    /// The held-out rows, as tracks of the test part of its split.
    pub test: Rows<'a>,
    /// The fits, at least one.
    pub fits: &'a [Outcome],
}

/// The input with derived values: the order of the models and their predictions.
pub(super) struct View<'a> {
    pub(super) study: FitReport<'a>,
    pub(super) held_out: HeldOut,
    /// Indices of the fits, smallest held-out error first.
    ranking: Vec<usize>,
    /// The simplest fit, the reference for the others.
    simplest: usize,
}

impl<'a> View<'a> {
    pub(super) fn new(study: &FitReport<'a>) -> Self {
        let fits = study.fits;
        let mut ranking: Vec<usize> = (0..fits.len()).collect();
        ranking.sort_by(|&a, &b| fits[a].test.rmse.total_cmp(&fits[b].test.rmse));
        let size = |fit: &Outcome| (fit.spec.law != LawKind::Linear, fitted(fit).count());
        let simplest = (0..fits.len()).min_by_key(|&fit| size(&fits[fit])).unwrap_or_default();
        Self { study: *study, held_out: HeldOut::new(study), ranking, simplest }
    }

    /// Returns the model with the smallest held-out error.
    fn best(&self) -> usize {
        self.ranking[0]
    }

    /// Returns the models whose error is not significantly larger than that of the best model.
    fn equals(&self) -> Vec<usize> {
        let best = self.best();
        let others = self.ranking[1..].iter().copied();
        others.filter(|&other| self.held_out.gain(best, other).ci95[0] <= 0.0).collect()
    }

    /// Returns the recommended model: the best one, or the smallest one that is not significantly worse.
    pub(super) fn chosen(&self) -> usize {
        let size = |fit: usize| fitted(self.fit(fit)).count();
        let smaller = self.equals().into_iter().filter(|&fit| size(fit) < size(self.best()));
        smaller.min_by_key(|&fit| size(fit)).unwrap_or(self.best())
    }

    fn fit(&self, index: usize) -> &'a Outcome {
        &self.study.fits[index]
    }

    fn name(&self, index: usize) -> String {
        self.fit(index).spec.to_string()
    }

    /// Returns the visible models, best first, and the others.
    fn shown_and_rest(&self) -> (Vec<usize>, Vec<usize>) {
        let is_shown =
            |(rank, fit): &(usize, usize)| *rank < VISIBLE_MODELS || *fit == self.simplest;
        let (shown, rest): (Vec<_>, Vec<_>) =
            self.ranking.iter().copied().enumerate().partition(is_shown);
        let fits = |ranked: Vec<(usize, usize)>| ranked.into_iter().map(|(_, fit)| fit).collect();
        (fits(shown), fits(rest))
    }

    /// Returns "torque" or "force".
    pub(super) fn torque(&self) -> &'static str {
        match self.study.input.data.joint {
            JointKind::Revolute => "torque",
            JointKind::Prismatic => "force",
        }
    }

    /// Returns "Nm" or "N".
    pub(super) fn unit(&self) -> &'static str {
        self.study.input.data.joint.torque_unit()
    }
}

/// Returns the fitted parameters, without those that were kept constant.
fn fitted(fit: &Outcome) -> impl Iterator<Item = &friction_fit::Estimate> {
    fit.estimates.iter().filter(|estimate| estimate.std_error.is_some())
}

/// The comparison of fits to the same data.
pub struct Comparison {
    /// The page.
    pub page: Page,
    /// Five sentences: best model, generalisation, parameters, residual, next steps.
    pub summary: [String; 5],
    /// Index of the recommended fit: the best on held-out rows, or the smallest one that is not significantly worse.
    pub chosen: usize,
}

/// Compares fits to the same data.
///
/// # Panics
/// If there is no fit.
pub fn compare_fits(study: &FitReport) -> Comparison {
    let view = View::new(study);
    let summary = summary::summary(&view);
    let [best, generalisation, parameter_states, residual, next] = summary.clone();
    let answers = Answers {
        what: words::what(&view),
        certainty: generalisation,
        benefit: Benefit::Gain(best),
        next,
    };
    let mut page = Page::new(words::title(&view), words::subtitle(&view)).answering(answers);
    page.push(Block::List(vec![parameter_states, residual]));
    page.add(predictions(&view)).add(over_velocity(&view)).add(left_over(&view));
    page.add(parameters(&view)).add(methods(&view, glossary::methods(&view)));
    page.add(data(&view, words::data(&view)));
    Comparison { page, summary, chosen: view.chosen() }
}

fn predictions(view: &View) -> Section {
    let metrics = [Block::List(glossary::metrics(view)), tables::train_metrics(view).into()];
    Section::new("Prediction error on held-out rows")
        .chart(figures::errors(view))
        .table(tables::held_out_metrics(view))
        .details("Definition of the metrics, and their values on the training rows", metrics)
}

fn over_velocity(view: &View) -> Section {
    let (shown, rest) = view.shown_and_rest();
    Section::new(format!("{} over velocity", words::capitalised(view.torque())))
        .words(words::over_velocity(view))
        .charts(figures::over_velocity(view, &shown))
        .charts(figures::cycle(view, &shown))
        .with(collapsed("Other models", figures::over_velocity(view, &rest)))
}

fn left_over(view: &View) -> Section {
    let (shown, rest) = view.shown_and_rest();
    Section::new("Residual of each model")
        .words(words::left_over(view))
        .charts(figures::residuals(view, &shown))
        .with(collapsed("Other models", figures::residuals(view, &rest)))
        .chart(figures::residual_over_velocity(view))
}

fn parameters(view: &View) -> Section {
    let section = Section::new("Parameters")
        .words(words::PARAMETERS)
        .with(tables::parameters(view, view.best()));
    view.ranking[1..].iter().fold(section, |section, &fit| {
        let verdicts = words::counted(view.fit(fit).verdicts.len(), "verdict");
        let summary = format!("{}: {verdicts}", view.name(fit));
        section.details(summary, tables::parameters(view, fit))
    })
}

/// Returns the section about the method, of which `steps` are the sentences.
pub(super) fn methods(view: &View, steps: Vec<String>) -> Section {
    Section::new("Method").list(steps).details("Models", [Block::List(glossary::models(view))])
}

/// Returns the section about the data with notes on them.
pub(super) fn data(view: &View, notes: Vec<String>) -> Section {
    Section::new("Data")
        .table(tables::files(view))
        .list(notes)
        .details("Runs", [tables::runs(view).into()])
}

/// Returns charts in a collapsed block; `None` if there are no charts.
fn collapsed(summary: &str, charts: Vec<Chart>) -> Option<Block> {
    (!charts.is_empty()).then(|| Block::details(summary, Block::rows(charts)))
}

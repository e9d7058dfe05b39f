//! `compare.html` and `fit.html`: what the fits say, for a person who was not there.
//!
//! One page for both commands; `identify` hands in a list of one. It answers in the order the
//! questions come: which model, how sure, what it looks like, what is left over, which numbers
//! can be used, how it was done, on what. `summary` is the answer in five sentences, made from
//! the same figures as the tables, so they cannot disagree with them.
//!
//! The way of a page: `held_out` (rows and simulations laid out) -> `summary`, `figures`,
//! `tables`, `words`, `glossary` (a block each) -> [`page`] (their order). A model drawn in the
//! open is one of the best three or the simplest; the others wait in closed blocks. What is
//! *measured* is whatever the file holds: the page says "as logged" and does not vouch for it.

mod figures;
pub(super) mod glossary;
pub(super) mod held_out;
mod summary;
pub(super) mod tables;
pub(super) mod words;

use crate::report::{Block, Page};
use compensator_core::LawKind;
use friction_identification::data::{Dataset, JointKind, Split};
use friction_identification::fit::{Outcome, Rows};
use held_out::HeldOut;

/// How many of the best models are drawn in the open.
const SHOWN: usize = 3;

/// All that a page is made from.
#[derive(Clone, Copy)]
pub struct Study<'a> {
    /// All runs.
    pub data: &'a Dataset,
    /// What was fitted on and judged by.
    pub split: &'a Split,
    /// SHA-256 of each file, in the order of [`Dataset::files`].
    pub hashes: &'a [String],
    /// The held-out rows, as tracks of [`Split::test`].
    pub test: Rows<'a>,
    /// Names given to foreign columns, `ours=theirs`.
    pub columns: &'a [String],
    /// Samples dropped at the start of each run.
    pub skip: usize,
    /// The fits, at least one.
    pub fits: &'a [Outcome],
}

/// A study with what follows from it: the order of the models, and all that is drawn.
pub(super) struct View<'a> {
    pub(super) study: Study<'a>,
    pub(super) held_out: HeldOut,
    /// Indices of the fits, smallest error on the held-out rows first.
    ranking: Vec<usize>,
    /// The fit the others are held against.
    simplest: usize,
}

impl<'a> View<'a> {
    pub(super) fn new(study: &Study<'a>) -> Self {
        let fits = study.fits;
        let mut ranking: Vec<usize> = (0..fits.len()).collect();
        ranking.sort_by(|&a, &b| fits[a].test.rmse.total_cmp(&fits[b].test.rmse));
        let size = |fit: &Outcome| (fit.spec.law != LawKind::Linear, fitted(fit).count());
        let simplest = (0..fits.len()).min_by_key(|&fit| size(&fits[fit])).unwrap_or_default();
        Self { study: *study, held_out: HeldOut::new(study), ranking, simplest }
    }

    /// The model with the smallest error on the held-out rows.
    fn best(&self) -> usize {
        self.ranking[0]
    }

    /// The models whose error the best one's may be below by chance.
    fn equals(&self) -> Vec<usize> {
        let best = self.best();
        let others = self.ranking[1..].iter().copied();
        others.filter(|&other| self.held_out.gain(best, other).ci95[0] <= 0.0).collect()
    }

    /// The model to take: the best, or one with fewer parameters that it is not clearly ahead of.
    fn chosen(&self) -> usize {
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

    /// The models drawn in the open, best first, and the rest.
    fn shown_and_rest(&self) -> (Vec<usize>, Vec<usize>) {
        let is_shown = |(rank, fit): &(usize, usize)| *rank < SHOWN || *fit == self.simplest;
        let (shown, rest): (Vec<_>, Vec<_>) =
            self.ranking.iter().copied().enumerate().partition(is_shown);
        let fits = |ranked: Vec<(usize, usize)>| ranked.into_iter().map(|(_, fit)| fit).collect();
        (fits(shown), fits(rest))
    }

    /// What the joint works against: "torque" or "force".
    pub(super) fn torque(&self) -> &'static str {
        match self.study.data.joint {
            JointKind::Revolute => "torque",
            JointKind::Prismatic => "force",
        }
    }

    /// Its unit.
    pub(super) fn unit(&self) -> &'static str {
        self.study.data.joint.torque_unit()
    }
}

/// The parameters that were fitted, not kept.
fn fitted(fit: &Outcome) -> impl Iterator<Item = &friction_identification::fit::Estimate> {
    fit.estimates.iter().filter(|estimate| estimate.std_error.is_some())
}

/// Some fits on the same data, judged.
pub struct Judged {
    /// The page.
    pub page: Page,
    /// Five sentences: which model, whether it carries over, its parameters, its residual, what next.
    pub summary: [String; 5],
    /// The fit to take: the best on held-out rows, or a smaller one it is not clearly ahead of.
    pub chosen: usize,
}

/// The page of some fits on the same data.
///
/// # Panics
/// If there is no fit.
pub fn page(study: &Study) -> Page {
    judged(study).page
}

/// Some fits on the same data, judged.
///
/// # Panics
/// If there is no fit.
pub fn judged(study: &Study) -> Judged {
    let view = View::new(study);
    let mut page = Page::new(words::title(&view), words::subtitle(&view));
    let summary = summary::summary(&view);
    let [answer, doubts @ ..] = summary.clone();
    page.push(Block::Paragraph(answer)).push(Block::List(doubts.to_vec()));
    let sections = [
        predictions(&view),
        over_velocity(&view),
        left_over(&view),
        parameters(&view),
        methods(&view),
        data(&view),
    ];
    page.blocks.extend(sections.into_iter().flatten());
    Judged { page, summary, chosen: view.chosen() }
}

fn predictions(view: &View) -> Vec<Block> {
    vec![
        Block::Heading("How well each model predicts rows it has not seen".into()),
        Block::Chart(figures::errors(view)),
        Block::Table(tables::held_out_metrics(view)),
        Block::Details {
            summary: "What the numbers mean, and the same on the rows fitted to".into(),
            blocks: vec![
                Block::List(glossary::metrics(view)),
                Block::Table(tables::train_metrics(view)),
            ],
        },
    ]
}

fn over_velocity(view: &View) -> Vec<Block> {
    let mut torque = view.torque().to_owned();
    torque[..1].make_ascii_uppercase();
    let mut blocks = vec![
        Block::Heading(format!("{torque} over velocity")),
        Block::Paragraph(words::over_velocity(view)),
    ];
    let (shown, rest) = view.shown_and_rest();
    blocks.extend(in_rows(figures::over_velocity(view, &shown)));
    blocks.extend(in_rows(figures::cycle(view, &shown)));
    blocks.extend(behind("The other models", figures::over_velocity(view, &rest)));
    blocks
}

fn left_over(view: &View) -> Vec<Block> {
    let (shown, rest) = view.shown_and_rest();
    let mut blocks = vec![
        Block::Heading("What each model leaves over".into()),
        Block::Paragraph(words::left_over(view)),
    ];
    blocks.extend(in_rows(figures::residuals(view, &shown)));
    blocks.extend(behind("The other models", figures::residuals(view, &rest)));
    blocks.push(Block::Chart(figures::residual_over_velocity(view)));
    blocks
}

fn parameters(view: &View) -> Vec<Block> {
    let best = view.best();
    let mut blocks = vec![Block::Heading("Parameters".into())];
    blocks.push(Block::Paragraph(words::PARAMETERS.into()));
    blocks.extend(tables::parameters(view, best));
    for &fit in &view.ranking[1..] {
        let count = view.fit(fit).verdicts.len();
        let plural = if count == 1 { "" } else { "s" };
        blocks.push(Block::Details {
            summary: format!("{}: {count} verdict{plural}", view.name(fit)),
            blocks: tables::parameters(view, fit),
        });
    }
    blocks
}

fn methods(view: &View) -> Vec<Block> {
    vec![
        Block::Heading("How it was done".into()),
        Block::List(glossary::methods(view)),
        Block::Details {
            summary: "The models".into(),
            blocks: vec![Block::List(glossary::models(view))],
        },
    ]
}

fn data(view: &View) -> Vec<Block> {
    let mut blocks = vec![Block::Heading("Data".into()), Block::Table(tables::files(view))];
    blocks.push(Block::List(words::data(view)));
    blocks.push(Block::Details {
        summary: "Runs".into(),
        blocks: vec![Block::Table(tables::runs(view))],
    });
    blocks
}

/// Charts two in a line; of an odd number the first three.
pub(super) fn in_rows(mut charts: Vec<crate::report::Chart>) -> Vec<Block> {
    if charts.len() == 1 {
        return charts.into_iter().map(Block::Chart).collect();
    }
    let mut rows = Vec::new();
    while !charts.is_empty() {
        let rest = charts.split_off(if charts.len() % 2 == 1 { 3 } else { 2 });
        rows.push(Block::Row(charts));
        charts = rest;
    }
    rows
}

/// Charts behind a line that opens them, if there are any.
fn behind(summary: &str, charts: Vec<crate::report::Chart>) -> Option<Block> {
    let blocks = in_rows(charts);
    (!blocks.is_empty()).then(|| Block::Details { summary: summary.into(), blocks })
}

//! The best hypothesis of the contest as a model for other logs.
//!
//! A hypothesis whose columns mean the same on another log, a law of stops with causes that are regressors, is a model as it is:
//! its coefficients are those of one least squares on all rows, in which friction levels, viscous friction and inertia are not
//! negative.

use super::bank::{Bank, Workspace};
use super::cause::channel::channel_gain;
use super::cause::{CHANNEL_GAIN, Variant};
use super::entry::{Entry, Origin};
use super::law::{COULOMB, LawPart, OFFSET, STRIBECK, Shapes, VISCOUS, law_columns, rigid_parts};
use super::ledger::{Hypothesis, Ledger};
use super::rows::{MAX_CONSTANT_SHARE, Rows, within_runs};
use crate::left_out::{LeftOut, MOST_FITS, STRETCHES, unit};
use friction_fit::Measurement;
use friction_fit::linear::{Factor, LinearModel, LinearTerm};
use std::borrow::Cow;

/// The best hypothesis that is a model for other logs.
#[derive(Clone, Debug, Default)]
pub struct LinearAnswer {
    /// The model of the torque at the shaft.
    pub model: LinearModel,
    /// What lies between the shaft and the log.
    pub measurement: Measurement,
    /// What a fit without a row's fold leaves of the row, for all rows.
    pub held_out: Vec<f64>,
    /// The law alone, and with each of its causes added in turn, the one that takes most first.
    pub steps: Vec<LinearStep>,
}

/// A law with some of the causes of a hypothesis.
#[derive(Clone, Debug)]
pub struct LinearStep {
    /// Name of the law, or of the cause that is added last.
    pub added: &'static str,
    /// The model with it.
    pub answer: LinearAnswer,
}

/// Returns the hypothesis of the least cost that is a model for other logs, with the law of its entry.
pub(crate) fn transferable<'l>(entries: &[Entry], ledger: &'l Ledger) -> Option<&'l Hypothesis> {
    ledger.hypotheses.iter().find(|hypothesis| {
        let entry = &entries[hypothesis.bank];
        let is_transferable = |variant: &Variant| {
            let mut factors = variant.regressors().iter().flat_map(|regressor| &regressor.factors);
            !variant.regressors().is_empty() && factors.all(Factor::is_transferable)
        };
        matches!(entry.base.origin, Origin::Shapes(_))
            && entry.chosen(&hypothesis.set).all(is_transferable)
    })
}

/// Returns a hypothesis as a model, with what it leaves; `None` if its law is no law of shapes.
pub(crate) fn answer(
    rows: &Rows,
    shapes: &Shapes,
    entry: &Entry,
    hypothesis: &Hypothesis,
) -> Option<LinearAnswer> {
    let Origin::Shapes(law) = &entry.base.origin else { return None };
    let mut parts = shapes.parts(rows, law);
    let law_columns = parts.len();
    for variant in entry.chosen(&hypothesis.set) {
        let regressors = variant.regressors().iter().cloned();
        parts.extend(regressors.map(|regressor| LawPart { name: variant.key.cause, regressor }));
    }
    let (falls, law): (Vec<usize>, Vec<usize>) =
        (0..law_columns).partition(|at| parts[*at].name == STRIBECK);
    let judged = JudgedByRun::new(rows, entry, hypothesis, law, falls);
    let kept = judged.best_columns();
    let steps = judged.steps(&kept);
    let level = parts[..law_columns].iter().zip(&entry.base.fit.sizes);
    let level = level.filter(|(part, _)| [COULOMB, STRIBECK].contains(&part.name));
    let level = level.map(|(part, size)| part.term(size * entry.base.level.scale));
    let level: Vec<LinearTerm> = level.collect();
    let (torque_delay_s, torque_low_pass) = entry.correction.of_torque(rows.step_s);
    let of_columns = |columns: &[usize]| {
        let signed = Measurement::of_sign(rows.is_reversed);
        let mut measurement = Measurement { torque_delay_s, torque_low_pass, ..signed };
        let mut terms = Vec::new();
        let chosen = columns.iter().map(|at| &parts[*at]);
        for (part, size) in chosen.zip(judged.bank.fit(columns)) {
            if part.name == CHANNEL_GAIN {
                let gain = channel_gain(&part.regressor, measurement.torque_sign * size);
                measurement.channel_gains.extend(gain);
            } else if size != 0.0 {
                terms.push(part.term(size));
            }
        }
        let model = LinearModel { level: level.clone(), terms };
        let held_out = judged.held_out(rows, columns);
        LinearAnswer { model, measurement, held_out, steps: Vec::new() }
    };
    let step = |step: Step| LinearStep { added: step.added, answer: of_columns(&step.columns) };
    Some(LinearAnswer { steps: steps.into_iter().map(step).collect(), ..of_columns(&kept) })
}

/// Share of the top speed up to which plain friction has no direction.
const NO_DIRECTION: f64 = 0.01;

/// Returns Coulomb and viscous friction and the rigid-body parts, or an offset where there are none, by least squares: what any
/// other model must beat.
pub(crate) fn plain(rows: &Rows) -> LinearAnswer {
    let direction = Factor::Direction { above: NO_DIRECTION * rows.top_speed };
    let mut parts =
        vec![LawPart::new(COULOMB, [direction]), LawPart::new(VISCOUS, [Factor::Velocity])];
    parts.extend(rigid_parts(rows));
    if parts.len() == 2 {
        parts.push(LawPart::new(OFFSET, [Factor::One]));
    }
    let judged = JudgedByRun::of_law(rows, law_columns(rows, &parts));
    let all: Vec<usize> = (0..parts.len()).collect();
    let terms = parts.iter().zip(judged.bank.fit(&all)).map(|(part, size)| part.term(size));
    LinearAnswer {
        model: LinearModel { level: Vec::new(), terms: terms.collect() },
        measurement: Measurement::of_sign(rows.is_reversed),
        held_out: judged.held_out(rows, &all),
        steps: Vec::new(),
    }
}

/// Prior cost of the parts of a law that fall with the speed.
const FALLS_PRICE: f64 = 0.02;

/// Columns that are chosen together.
struct Group {
    /// Name of the law, or of the cause.
    name: &'static str,
    columns: Vec<usize>,
    /// Prior cost.
    price: f64,
    /// True for a cause whose covariate is constant in each run.
    is_constant: bool,
}

/// The columns of a law with some causes, the last of which is `added`.
struct Step {
    added: &'static str,
    columns: Vec<usize>,
}

/// The columns of a hypothesis, judged on runs that a fit has not seen.
///
/// The contest leaves out parts of runs where a column is constant in each of a few runs. What varies within a run may then
/// follow what is peculiar to a run. So the causes that vary are chosen again with whole runs left out, beside those constant
/// ones at their fitted size.
struct JudgedByRun<'a> {
    columns: Vec<Cow<'a, [f64]>>,
    /// The law without its falls, these, and each cause.
    groups: Vec<Group>,
    non_negative: Vec<bool>,
    fold_of_block: Vec<usize>,
    bank: Bank,
    /// The same with the part of the constant columns taken from the torque, so that they are never refitted.
    beside_constants: Option<Bank>,
}

impl<'a> JudgedByRun<'a> {
    /// Judges the columns of a hypothesis. Those of its law come first: `law`, and `falls`, which fall with the speed.
    fn new(
        rows: &Rows,
        entry: &'a Entry,
        hypothesis: &Hypothesis,
        law: Vec<usize>,
        falls: Vec<usize>,
    ) -> Self {
        let columns = entry.columns(rows, &hypothesis.set);
        let of_law =
            |columns, price| Group { name: entry.base.name, columns, price, is_constant: false };
        let mut groups = vec![of_law(law, 0.0), of_law(falls, FALLS_PRICE)];
        for (variant, place) in entry.placed(&hypothesis.set) {
            let covariate =
                rows.covariates.iter().find(|c| variant.key.columns == [c.name.as_str()]);
            let is_constant = covariate.is_some_and(|covariate| {
                within_runs(&covariate.scaled, &rows.runs) < MAX_CONSTANT_SHARE
            });
            let (name, columns) = (variant.key.cause, place.collect());
            groups.push(Group { name, columns, price: variant.price, is_constant });
        }
        let fold_of_block = folds(rows);
        let non_negative = entry.base.non_negative.clone();
        let bank = Bank::of_target(rows, &columns, &rows.torque, &fold_of_block)
            .with_non_negative(non_negative.iter().copied());
        let beside_constants = None;
        let mut judged =
            Self { columns, groups, non_negative, fold_of_block, bank, beside_constants };
        if judged.groups.iter().any(|group| group.is_constant) {
            judged.beside_constants = Some(judged.without_constants(rows));
        }
        judged
    }

    /// Returns the columns of a law of any sign, without groups.
    fn of_law(rows: &Rows, columns: Vec<Vec<f64>>) -> Self {
        let fold_of_block = folds(rows);
        Self {
            bank: Bank::of_target(rows, &columns, &rows.torque, &fold_of_block),
            groups: Vec::new(),
            non_negative: vec![false; columns.len()],
            fold_of_block,
            columns: columns.into_iter().map(Cow::Owned).collect(),
            beside_constants: None,
        }
    }

    fn without_constants(&self, rows: &Rows) -> Bank {
        let all: Vec<usize> = (0..self.columns.len()).collect();
        let sizes = self.bank.fit(&all);
        let mut target = rows.torque.clone();
        for group in self.groups.iter().filter(|group| group.is_constant) {
            for at in &group.columns {
                for (target, value) in target.iter_mut().zip(&*self.columns[*at]) {
                    *target -= sizes[*at] * value;
                }
            }
        }
        Bank::of_target(rows, &self.columns, &target, &self.fold_of_block)
            .with_non_negative(self.non_negative.iter().copied())
    }

    /// Returns the columns of the set of groups with the least cost. The law and the constant groups stay.
    fn best_columns(&self) -> Vec<usize> {
        let optional: Vec<usize> =
            (1..self.groups.len()).filter(|at| !self.groups[*at].is_constant).collect();
        let mut work = Workspace::default();
        let bank = self.beside_constants.as_ref().unwrap_or(&self.bank);
        let mut cost = |set: usize| {
            let has = |at: &usize| set >> at & 1 == 1;
            let chosen = (0..optional.len()).filter(has).map(|at| &self.groups[optional[at]]);
            let price: f64 = chosen.clone().map(|group| group.price).sum();
            let law = self.groups[0].columns.iter();
            let columns: Vec<usize> =
                law.chain(chosen.flat_map(|group| &group.columns)).copied().collect();
            bank.error(&columns, &mut work) * price.exp()
        };
        let sets = (0..1usize << optional.len()).map(|set| (cost(set), set));
        let best = sets.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |(_, set)| set);
        let is_kept = |at: usize| match optional.iter().position(|index| *index == at) {
            Some(place) => best >> place & 1 == 1,
            None => true,
        };
        let kept = (0..self.groups.len()).filter(|at| is_kept(*at));
        let mut columns: Vec<usize> =
            kept.flat_map(|at| self.groups[at].columns.iter().copied()).collect();
        columns.sort_unstable();
        columns
    }

    /// Returns the steps from the law to some columns: causes are added in the order in which they take most.
    fn steps(&self, kept: &[usize]) -> Vec<Step> {
        let is_kept =
            |group: &usize| self.groups[*group].columns.iter().all(|at| kept.contains(at));
        let of_law = self.groups[..2].iter().flat_map(|group| &group.columns);
        let mut columns: Vec<usize> = of_law.filter(|at| kept.contains(at)).copied().collect();
        let mut open: Vec<usize> = (2..self.groups.len()).filter(is_kept).collect();
        let mut steps = vec![Step { added: self.groups[0].name, columns: columns.clone() }];
        let mut work = Workspace::default();
        while !open.is_empty() {
            let mut error = |place: &usize| {
                let next = [columns.as_slice(), &self.groups[open[*place]].columns].concat();
                self.bank.error(&next, &mut work)
            };
            let errors: Vec<f64> = (0..open.len()).map(|place| error(&place)).collect();
            let best = (0..open.len()).min_by(|a, b| errors[*a].total_cmp(&errors[*b]));
            let group = &self.groups[open.remove(best.unwrap_or_default())];
            columns.extend(&group.columns);
            steps.push(Step { added: group.name, columns: columns.clone() });
        }
        steps
    }

    /// Returns what fits without a row's fold leave of each row. The rows between two judged ones belong to the block of the
    /// first.
    fn held_out(&self, rows: &Rows, columns: &[usize]) -> Vec<f64> {
        let fits = self.bank.fits_without_fold(columns);
        let mut left = rows.torque.clone();
        for (block, judged) in rows.blocks.iter().enumerate() {
            let run = &rows.runs[rows.run_of_block[block]];
            let is_first = block == 0 || rows.run_of_block[block - 1] != rows.run_of_block[block];
            let is_last = rows.run_of_block.get(block + 1) != Some(&rows.run_of_block[block]);
            let from = if is_first { run.start } else { rows.judged[judged.start] };
            let to = if is_last { run.end } else { rows.judged[judged.end] };
            for (at, size) in columns.iter().zip(&fits[self.fold_of_block[block]]) {
                for (left, value) in left[from..to].iter_mut().zip(&self.columns[*at][from..to]) {
                    *left -= size * value;
                }
            }
        }
        left
    }
}

/// Returns the folds of the blocks: whole runs or stretches, as the driver's law is held out, so that both err on equal rows.
fn folds(rows: &Rows) -> Vec<usize> {
    if unit(&rows.tracks) == LeftOut::Runs {
        return rows.run_of_block.iter().map(|run| run % MOST_FITS).collect();
    }
    let stretch = |(block, run): (usize, &usize)| {
        let first = rows.run_of_block.partition_point(|other| other < run);
        let after = rows.run_of_block.partition_point(|other| other <= run);
        (block - first) * STRETCHES / (after - first)
    };
    rows.run_of_block.iter().enumerate().map(stretch).collect()
}

//! The contest itself: banks for each law and the corrections that help, one search in each, one ledger.
//!
//! The log as it is competes first, with every base law. The orders of waves are found in what the best model of that round
//! leaves. Corrections are then screened with the columns of the best hypothesis, because a delay shows only once the larger
//! causes are in the model, and those that help get banks of their own.

use super::bank::{Bank, Workspace};
use super::cause::backlash::GapGrid;
use super::correction::{Correction, tried};
use super::draws::Draws;
use super::entry::{Base, Entry, Origin, Waves};
use super::finalists::finalists;
use super::kernel::{KernelLaw, KernelStart};
use super::law::{Law, LawStart, Shapes};
use super::ledger::{Hypothesis, Ledger};
use super::linear::{self, transferable};
use super::orders::RippleOrders;
use super::outcome::Outcome;
use super::rows::Rows;
use super::table::Table;
use super::weights::weigh;
use joint_log::log_check::drives_both_ways;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Share of the error that a correction must take to get a bank.
const MIN_CORRECTION_GAIN: f64 = 0.02;

/// Most corrections beside the log as it is.
const MOST_CORRECTIONS: usize = 2;

/// Most hypotheses in the draws.
const MOST_DRAWN: usize = 400;

/// Ratio of the cost to the best cost above which a hypothesis is not drawn.
const MAX_COST_RATIO: f64 = 1.6;

/// Most rounds in which the driver's law is linearised.
const KERNEL_ROUNDS: usize = 4;

/// Share of the cost that a round must take for another one.
const MIN_ROUND_GAIN: f64 = 0.005;

/// Most laws of shapes from which the first fit of the driver's law begins.
const MOST_STARTS: usize = 4;

/// Most base laws of shapes that compete beside the driver's.
const MOST_SHAPED: usize = 3;

/// Runs the contest. It sets the weights of the rows first.
pub fn contest(rows: &mut Rows) -> Outcome {
    let shapes = Shapes::new(rows);
    reverse_driving_torque(rows, &shapes);
    let plain = linear::plain(rows);
    let Some(kernel) = prepare(rows, &shapes) else {
        return Outcome { plain, is_reversed: rows.is_reversed, ..Outcome::default() };
    };
    let rows = &*rows;
    let laws = shapes.laws(rows);
    let Some(first) = laws.first() else { return Outcome { plain, ..Outcome::default() } };
    let waves = Waves { orders: Vec::new(), gaps: GapGrid::new(rows, &shapes) };
    let mut contest =
        Contest { rows, shapes: &shapes, free: first, waves, found: Found::default() };
    let bases: Vec<Base> =
        laws.iter().take(MOST_SHAPED).map(|law| Base::of_shapes(rows, &shapes, law)).collect();
    let without_causes =
        kernel.as_ref().map(|kernel| Base::of_kernel(rows, &shapes, kernel, Some(first)));
    contest.find_first_orders(without_causes.as_ref().unwrap_or(&bases[0]));
    contest.add(bases.iter().cloned().map(|base| (base, Correction::None)).collect());
    let mut kernels: Vec<(Correction, KernelLaw)> = Vec::new();
    if let Some(kernel) = kernel {
        contest.add_kernel(&kernel, Correction::None);
        kernels.push((Correction::None, kernel));
    }
    for _ in 0..KERNEL_ROUNDS {
        let before = contest.found.best().map_or(f64::INFINITY, Hypothesis::cost);
        contest.round(&bases, &mut kernels);
        let after = contest.found.best().map_or(f64::INFINITY, Hypothesis::cost);
        if after > (1.0 - MIN_ROUND_GAIN) * before {
            break;
        }
    }
    let Contest { waves, found: Found { mut entries, hypotheses }, .. } = contest;
    let ledger = Ledger::new(hypotheses);
    let draws = draw(rows, &entries, &ledger);
    // A hypothesis without a cause may hold channels of which the torque has a share.
    for hypothesis in
        finalists(&ledger, &draws).into_iter().chain(ledger.with_causes(&BTreeSet::new()))
    {
        entries[hypothesis.bank].restore_columns(rows, &shapes, &waves, &hypothesis.set);
    }
    let linear = transferable(&entries, &ledger).and_then(|hypothesis| {
        let entry = &mut entries[hypothesis.bank];
        entry.restore_columns(rows, &shapes, &waves, &hypothesis.set);
        linear::answer(rows, &shapes, entry, hypothesis)
    });
    let table = Table { shapes: &shapes, entries: &entries, ledger: &ledger, draws: &draws };
    Outcome { plain, linear, ..Outcome::new(rows, table) }
}

/// A contest on the way.
struct Contest<'a> {
    rows: &'a Rows,
    shapes: &'a Shapes,
    /// The law of shapes that may take what the driver's law misses.
    free: &'a Law,
    waves: Waves,
    found: Found,
}

/// Entries with all hypotheses that were scored.
#[derive(Default)]
struct Found {
    entries: Vec<Entry>,
    hypotheses: Vec<Hypothesis>,
}

impl Found {
    fn best(&self) -> Option<&Hypothesis> {
        self.hypotheses.iter().min_by(|a, b| a.cost().total_cmp(&b.cost()))
    }
}

impl Contest<'_> {
    /// Builds entries and searches in them.
    fn add(&mut self, wanted: Vec<(Base, Correction)>) {
        let (rows, shapes, waves) = (self.rows, self.shapes, &self.waves);
        let build = |(base, correction)| {
            // One after the other, in parallel inside: the columns of an entry are the largest part of the memory.
            let mut entry = Entry::new(rows, shapes, base, correction, waves);
            entry.drop_columns();
            entry
        };
        let made: Vec<Entry> = wanted.into_iter().map(build).collect();
        self.found.hypotheses.extend(search_all(&made, self.found.entries.len()));
        self.found.entries.extend(made);
    }

    /// Returns the best hypothesis, whose columns are then in its entry.
    fn best(&mut self) -> Option<Hypothesis> {
        let best = self.found.best().cloned()?;
        let entry = &mut self.found.entries[best.bank];
        entry.restore_columns(self.rows, self.shapes, &self.waves, &best.set);
        Some(best)
    }

    /// Adds the driver's law, alone and beside a law of shapes.
    fn add_kernel(&mut self, kernel: &KernelLaw, correction: Correction) {
        let base = |free| (Base::of_kernel(self.rows, self.shapes, kernel, free), correction);
        let both = vec![base(None), base(Some(self.free))];
        self.add(both);
    }

    /// Tries corrections of the log beside the best hypothesis, and linearises the driver's law anew with its causes.
    fn round(&mut self, bases: &[Base], kernels: &mut Vec<(Correction, KernelLaw)>) {
        let Some(best) = self.best() else { return };
        let entry = &self.found.entries[best.bank];
        let mut wanted = screen(self.rows, entry, &best);
        wanted.retain(|correction| kernels.iter().all(|(tried, _)| !tried.is_near(*correction)));
        if matches!(entry.base.origin, Origin::Shapes(_)) {
            // A correction changes the columns of its entry, so each begins with the law's own.
            let is_of_entry =
                |base: &&Base| base.name == entry.base.name && base.travel == entry.base.travel;
            let base = bases.iter().find(is_of_entry);
            let shaped = wanted.iter().filter_map(|c| Some((base?.clone(), *c))).collect();
            self.add(shaped);
        }
        let best = self.best().unwrap_or(best);
        self.find_orders(&best);
        let entry = &self.found.entries[best.bank];
        let target = without_causes(self.rows, entry, &best.set);
        if !wanted.contains(&entry.correction) {
            wanted.push(entry.correction);
        }
        let fit = |correction: &Correction| {
            let same = kernels.iter().rev().find(|(tried, _)| tried == correction);
            let start = same.or(kernels.first()).map(|(_, law)| law.start())?;
            Some((*correction, KernelLaw::fit(self.rows, &target, *correction, &[start])?))
        };
        let fitted: Vec<(Correction, KernelLaw)> = wanted.par_iter().filter_map(fit).collect();
        for (correction, law) in &fitted {
            self.add_kernel(law, *correction);
        }
        kernels.extend(fitted);
    }

    /// Finds the orders of waves in what a law leaves.
    fn find_first_orders(&mut self, base: &Base) {
        let columns: Vec<&[f64]> = base.columns.iter().map(Vec::as_slice).collect();
        let found = RippleOrders::find(self.rows, &base.residual, &columns, &base.level);
        self.waves.orders.push(found);
    }

    /// Finds the orders of waves in what a hypothesis leaves without its own causes of the position.
    fn find_orders(&mut self, best: &Hypothesis) {
        let entry = &self.found.entries[best.bank];
        let mut set = best.set.clone();
        set.retain(|at| !entry.variants[*at as usize].is_of_position());
        let residual = residual(self.rows, entry, &set);
        let found =
            RippleOrders::find(self.rows, &residual, &entry.columns(&set), &entry.base.level);
        if self.waves.orders.iter().all(|known| !known.is_like(&found)) {
            self.waves.orders.push(found);
        }
    }
}

/// Reverses a torque with which friction drives the motion. A load that is lowered drives it as well, one way.
fn reverse_driving_torque(rows: &mut Rows, shapes: &Shapes) {
    let pairs =
        rows.torque.iter().zip(&rows.velocity).map(|(torque, velocity)| (*torque, *velocity));
    if drives_both_ways(pairs) && Base::of_shapes(rows, shapes, &Shapes::plain_law()).is_driving {
        rows.reverse_torque();
    }
}

/// Fits the driver's law without a cause and weighs the rows by what it leaves. Returns `None` if there is no law at all.
fn prepare(rows: &mut Rows, shapes: &Shapes) -> Option<Option<KernelLaw>> {
    let laws = shapes.laws(rows);
    let law = laws.first()?;
    let base = Base::of_shapes(rows, shapes, law);
    let start = |law: &Law| {
        let sizes = Base::of_shapes(rows, shapes, law).sizes;
        KernelStart::of_shapes(rows, &LawStart::of_shapes(rows, shapes, law, &sizes))
    };
    let starts: Vec<KernelStart> = laws.iter().take(MOST_STARTS).filter_map(start).collect();
    let kernel = KernelLaw::fit(rows, &rows.torque, Correction::None, &starts);
    let square =
        |residual: &[f64]| rows.judged.iter().map(|row| residual[*row].powi(2)).sum::<f64>();
    let stop = |travel: usize| &shapes.stops[travel];
    match &kernel {
        Some(kernel) if square(&kernel.residual) < square(&base.residual) => {
            let stop = stop(shapes.nearest_travel(kernel.travel));
            weigh(rows, &kernel.residual, stop, &kernel.motion_error, &kernel.memory);
        }
        Some(kernel) => {
            weigh(rows, &base.residual, stop(base.travel), &kernel.motion_error, &kernel.memory);
        }
        None => weigh(rows, &base.residual, stop(base.travel), &[], &[]),
    }
    Some(kernel)
}

/// Returns the torque less the causes of a set.
fn without_causes(rows: &Rows, entry: &Entry, set: &[u16]) -> Vec<f64> {
    let sizes = entry.bank.fit(&entry.indices(set), &mut Workspace::default());
    let columns = entry.columns(set);
    let causes = entry.base.columns.len()..columns.len();
    rows.map(|row| {
        rows.torque[row] - causes.clone().map(|at| columns[at][row] * sizes[at]).sum::<f64>()
    })
}

fn search_all(entries: &[Entry], first: usize) -> Vec<Hypothesis> {
    let search = |(at, entry): (usize, &Entry)| entry.search(first + at);
    entries.par_iter().enumerate().flat_map(search).collect()
}

/// Returns what a set of variants leaves, fitted to all rows.
fn residual(rows: &Rows, entry: &Entry, set: &[u16]) -> Vec<f64> {
    let sizes = entry.bank.fit(&entry.indices(set), &mut Workspace::default());
    let columns = entry.columns(set);
    rows.map(|row| {
        rows.torque[row] - columns.iter().zip(&sizes).map(|(c, size)| c[row] * size).sum::<f64>()
    })
}

/// Returns the corrections with which the columns of a hypothesis leave less.
fn screen(rows: &Rows, entry: &Entry, best: &Hypothesis) -> Vec<Correction> {
    let columns = entry.columns(&best.set);
    let error = |correction: &Correction| {
        let corrected: Vec<Vec<f64>> =
            columns.iter().map(|column| correction.apply(rows, column)).collect();
        let corrected: Vec<&[f64]> = corrected.iter().map(Vec::as_slice).collect();
        let bank = Bank::new(rows, &corrected);
        let all: Vec<usize> = (0..corrected.len()).collect();
        (bank.error(&all, &mut Workspace::default()), *correction)
    };
    let mut errors: Vec<(f64, Correction)> = tried().par_iter().map(error).collect();
    errors.retain(|(error, _)| *error < (1.0 - MIN_CORRECTION_GAIN) * best.error);
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    // The best of each kind, and that of the best at its best size.
    let mut kept: Vec<Correction> = Vec::new();
    for (error_of_kind, correction) in errors {
        let kind = std::mem::discriminant(&correction);
        if kept.iter().any(|other| std::mem::discriminant(other) == kind) {
            continue;
        }
        let better_of = |best: (f64, Correction), near: Vec<Correction>| {
            let found = near.par_iter().map(error).min_by(|a, b| a.0.total_cmp(&b.0));
            found.filter(|found| found.0 < best.0).unwrap_or(best)
        };
        let best = better_of((error_of_kind, correction), correction.nearer());
        kept.push(better_of(best, best.1.finer()).1);
    }
    kept.truncate(MOST_CORRECTIONS);
    kept
}

fn draw(rows: &Rows, entries: &[Entry], ledger: &Ledger) -> Draws {
    let most = MAX_COST_RATIO * ledger.best().map_or(0.0, Hypothesis::cost);
    let drawn: Vec<&Hypothesis> =
        ledger.hypotheses.iter().take_while(|h| h.cost() <= most).take(MOST_DRAWN).collect();
    let errors = |hypothesis: &&Hypothesis| {
        let entry = &entries[hypothesis.bank];
        entry.bank.block_errors(&entry.indices(&hypothesis.set), &mut Workspace::default())
    };
    let errors: Vec<Vec<f64>> = drawn.par_iter().map(errors).collect();
    Draws::new(rows, &drawn, &errors)
}

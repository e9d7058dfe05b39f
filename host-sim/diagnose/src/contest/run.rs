//! The contest itself: banks for each law and the corrections that help, one search in each, one ledger.
//!
//! The log as it is competes first, with every base law. The orders of waves are found in what the best model of that round
//! leaves. Corrections are then screened with the columns of the best hypothesis, because a delay shows only once the larger
//! causes are in the model, and those that help get banks of their own.

use super::bank::{Bank, Workspace};
use super::cause::Waves;
use super::cause::backlash::GapGrid;
use super::correction::{Correction, tried};
use super::draws::Draws;
use super::entry::{Base, Entry, Origin};
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
    let is_reversed = rows.is_reversed;
    let without_law = |plain| Outcome { plain, is_reversed, ..Outcome::default() };
    let laws = shapes.laws(rows);
    let Some(best) = laws.first() else { return without_law(plain) };
    let kernel = fit_kernel(rows, &shapes, &laws);
    weigh_rows(rows, &shapes, best, kernel.as_ref());
    let rows = &*rows;
    // The weights may change which law is the best.
    let laws = shapes.laws(rows);
    let Some(first) = laws.first() else { return without_law(plain) };
    let mut contest = Contest {
        rows,
        shapes: &shapes,
        free: first,
        waves: Waves { orders: Vec::new(), gaps: GapGrid::new(rows, &shapes) },
        entries: Vec::new(),
        hypotheses: Vec::new(),
    };
    let bases: Vec<Base> =
        laws.iter().take(MOST_SHAPED).map(|law| Base::of_shapes(rows, &shapes, law)).collect();
    let without_causes =
        kernel.as_ref().map(|kernel| Base::of_kernel(rows, &shapes, kernel, Some(first)));
    contest.find_first_orders(without_causes.as_ref().unwrap_or(&bases[0]));
    contest.add(bases.clone(), Correction::None);
    let mut kernels: Vec<KernelLaw> = Vec::new();
    if let Some(kernel) = kernel {
        contest.add_kernel(&kernel);
        kernels.push(kernel);
    }
    for _ in 0..KERNEL_ROUNDS {
        let before = contest.least_cost();
        contest.round(&bases, &mut kernels);
        if contest.least_cost() > (1.0 - MIN_ROUND_GAIN) * before {
            break;
        }
    }
    let Contest { entries, hypotheses, .. } = contest;
    let ledger = Ledger::new(hypotheses);
    let linear = transferable(&entries, &ledger).and_then(|hypothesis| {
        linear::answer(rows, &shapes, &entries[hypothesis.bank], hypothesis)
    });
    let draws = draw(rows, &entries, &ledger);
    let (entries, ledger, draws) = (entries.as_slice(), &ledger, &draws);
    let table = Table { rows, shapes: &shapes, entries, ledger, draws };
    Outcome { plain, linear, ..Outcome::new(&table) }
}

/// A contest on the way.
struct Contest<'a> {
    rows: &'a Rows,
    shapes: &'a Shapes,
    /// The law of shapes that may take what the driver's law misses.
    free: &'a Law,
    waves: Waves,
    entries: Vec<Entry>,
    /// All hypotheses of the entries that were scored.
    hypotheses: Vec<Hypothesis>,
}

impl Contest<'_> {
    /// Returns the hypothesis of the least cost.
    fn best(&self) -> Option<&Hypothesis> {
        self.hypotheses.iter().min_by(|a, b| a.cost().total_cmp(&b.cost()))
    }

    /// Returns the least cost; infinite before the first search.
    fn least_cost(&self) -> f64 {
        self.best().map_or(f64::INFINITY, Hypothesis::cost)
    }

    /// Builds the entries of laws with a correction and searches in them.
    fn add(&mut self, bases: Vec<Base>, correction: Correction) {
        // One after the other, in parallel inside: the columns of an entry are the largest part of the memory.
        let build = |base| Entry::new(self.rows, self.shapes, base, correction, &self.waves);
        let made: Vec<Entry> = bases.into_iter().map(build).collect();
        self.hypotheses.extend(search_all(&made, self.entries.len()));
        self.entries.extend(made);
    }

    /// Adds the driver's law, alone and beside a law of shapes.
    fn add_kernel(&mut self, kernel: &KernelLaw) {
        let base = |free| Base::of_kernel(self.rows, self.shapes, kernel, free);
        self.add(vec![base(None), base(Some(self.free))], kernel.correction);
    }

    /// Tries corrections of the log beside the best hypothesis, and linearises the driver's law anew with its causes.
    fn round(&mut self, bases: &[Base], kernels: &mut Vec<KernelLaw>) {
        let Some(best) = self.best().cloned() else { return };
        let entry = &self.entries[best.bank];
        let mut wanted = screen(self.rows, entry, &best);
        wanted.retain(|wanted| kernels.iter().all(|law| !law.correction.is_near(*wanted)));
        if matches!(entry.base.origin, Origin::Shapes(_)) {
            // A correction changes the columns of its entry, so each begins with the law's own.
            let is_of_entry =
                |base: &&Base| base.name == entry.base.name && base.travel == entry.base.travel;
            let base: Vec<Base> = bases.iter().find(is_of_entry).cloned().into_iter().collect();
            wanted.iter().for_each(|correction| self.add(base.clone(), *correction));
        }
        let best = self.best().cloned().unwrap_or(best);
        self.find_orders(&best);
        let entry = &self.entries[best.bank];
        let target = without_causes(self.rows, entry, &best.set);
        if !wanted.contains(&entry.correction) {
            wanted.push(entry.correction);
        }
        let fit = |correction: &Correction| {
            let same = kernels.iter().rev().find(|law| law.correction == *correction);
            let start = same.or(kernels.first()).map(KernelLaw::start)?;
            KernelLaw::fit(self.rows, &target, *correction, &[start])
        };
        let fitted: Vec<KernelLaw> = wanted.par_iter().filter_map(fit).collect();
        fitted.iter().for_each(|law| self.add_kernel(law));
        kernels.extend(fitted);
    }

    /// Finds the orders of waves in what a law leaves.
    fn find_first_orders(&mut self, base: &Base) {
        let (residual, level) = (&base.fit.residual, &base.level.torque);
        self.waves.orders.push(RippleOrders::find(self.rows, residual, &base.columns, level));
    }

    /// Finds the orders of waves in what a hypothesis leaves without its own causes of the position.
    fn find_orders(&mut self, best: &Hypothesis) {
        let entry = &self.entries[best.bank];
        let mut set = best.set.clone();
        set.retain(|at| !entry.variants[*at as usize].is_of_position());
        let columns = entry.columns(self.rows, &set);
        let residual = self.rows.residual(&columns, &entry.fit(&set));
        let level = &entry.base.level.torque;
        let found = RippleOrders::find(self.rows, &residual, &columns, level);
        if self.waves.orders.iter().all(|known| !known.is_like(&found)) {
            self.waves.orders.push(found);
        }
    }
}

/// Reverses a torque with which friction drives the motion. A load that is lowered drives it as well, one way.
fn reverse_driving_torque(rows: &mut Rows, shapes: &Shapes) {
    let pairs =
        rows.torque.iter().zip(&rows.velocity).map(|(torque, velocity)| (*torque, *velocity));
    if drives_both_ways(pairs)
        && Base::of_shapes(rows, shapes, &Shapes::plain_law()).level.scale < 0.0
    {
        rows.reverse_torque();
    }
}

/// Fits the driver's law without a cause, from the best laws of shapes; `None` if it has no finite fit.
fn fit_kernel(rows: &Rows, shapes: &Shapes, laws: &[Law]) -> Option<KernelLaw> {
    let start = |law: &Law| {
        let sizes = Base::of_shapes(rows, shapes, law).fit.sizes;
        KernelStart::of_shapes(rows, &LawStart::of_shapes(rows, shapes, law, &sizes))
    };
    let starts: Vec<KernelStart> = laws.iter().take(MOST_STARTS).filter_map(start).collect();
    KernelLaw::fit(rows, &rows.torque, Correction::None, &starts)
}

/// Weighs the rows by what the better of two laws leaves: the best law of shapes, and the driver's.
fn weigh_rows(rows: &mut Rows, shapes: &Shapes, law: &Law, kernel: Option<&KernelLaw>) {
    let base = Base::of_shapes(rows, shapes, law);
    let square =
        |residual: &[f64]| rows.judged.iter().map(|row| residual[*row].powi(2)).sum::<f64>();
    let better = kernel.filter(|kernel| square(&kernel.residual) < square(&base.fit.residual));
    let (residual, travel) = match better {
        Some(kernel) => (&kernel.residual, shapes.nearest_travel(kernel.travel)),
        None => (&base.fit.residual, base.travel),
    };
    let motion_error = kernel.map_or(&[][..], |kernel| kernel.motion_error.as_slice());
    let memory = kernel.map_or(&[][..], |kernel| kernel.memory.as_slice());
    weigh(rows, residual, &shapes.stops[travel], motion_error, memory);
}

/// Returns the torque less the causes of a set.
fn without_causes(rows: &Rows, entry: &Entry, set: &[u16]) -> Vec<f64> {
    let (columns, sizes) = (entry.columns(rows, set), entry.fit(set));
    let law = entry.base.columns.len();
    rows.residual(&columns[law..], &sizes[law..])
}

fn search_all(entries: &[Entry], first: usize) -> Vec<Hypothesis> {
    let search = |(at, entry): (usize, &Entry)| entry.search(first + at);
    entries.par_iter().enumerate().flat_map(search).collect()
}

/// A correction with the squared error that it leaves.
#[derive(Clone, Copy)]
struct Screened {
    correction: Correction,
    error: f64,
}

/// Returns the corrections with which the columns of a hypothesis leave less.
fn screen(rows: &Rows, entry: &Entry, best: &Hypothesis) -> Vec<Correction> {
    let columns = entry.columns(rows, &best.set);
    let screened = |correction: &Correction| {
        let corrected: Vec<Vec<f64>> =
            columns.iter().map(|column| correction.apply(rows, column)).collect();
        let bank = Bank::new(rows, &corrected);
        let all: Vec<usize> = (0..corrected.len()).collect();
        let error = bank.error(&all, &mut Workspace::default());
        Screened { correction: *correction, error }
    };
    let mut found: Vec<Screened> = tried().par_iter().map(screened).collect();
    found.retain(|screened| screened.error < (1.0 - MIN_CORRECTION_GAIN) * best.error);
    found.sort_by(|a, b| a.error.total_cmp(&b.error));
    // The best of each kind, and that of the best at its best size.
    let mut kept: Vec<Correction> = Vec::new();
    for best_of_kind in found {
        let kind = std::mem::discriminant(&best_of_kind.correction);
        if kept.iter().any(|other| std::mem::discriminant(other) == kind) {
            continue;
        }
        let better_of = |best: Screened, near: Vec<Correction>| {
            let found = near.par_iter().map(screened).min_by(|a, b| a.error.total_cmp(&b.error));
            found.filter(|found| found.error < best.error).unwrap_or(best)
        };
        let best = better_of(best_of_kind, best_of_kind.correction.nearer());
        kept.push(better_of(best, best.correction.finer()).correction);
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
        entry.bank.block_errors(&entry.indices(&hypothesis.set))
    };
    let errors: Vec<Vec<f64>> = drawn.par_iter().map(errors).collect();
    Draws::new(rows, &drawn, &errors)
}

//! One entry of the contest: the columns of a correction and a law, their products, and the search among them.

use super::bank::{Bank, Workspace};
use super::cause::backlash::GapGrid;
use super::cause::{Context, Variant, acts_through_bristles, variants};
use super::cause_key::CauseKey;
use super::correction::Correction;
use super::kernel::KernelLaw;
use super::law::{Law, Shapes, WIDTHS, product};
use super::ledger::Hypothesis;
use super::orders::RippleOrders;
use super::rows::Rows;
use super::search::Search;
use compensator_core::Parameters;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Prior cost of a correction.
const CORRECTION_PRICE: f64 = 0.04;

/// What the nonlinear causes are chosen from.
pub(crate) struct Waves {
    pub(crate) orders: Vec<RippleOrders>,
    pub(crate) gaps: GapGrid,
}

/// What a base law was made from.
#[derive(Clone)]
pub(crate) enum Origin {
    /// Stops and falling functions.
    Shapes(Law),
    /// The driver's law at these parameters.
    Kernel(Box<Parameters<f64>>),
}

/// A base law as columns.
#[derive(Clone)]
pub(crate) struct Base {
    /// Its name in reports.
    pub(crate) name: &'static str,
    /// Its columns, before a correction.
    pub(crate) columns: Vec<Vec<f64>>,
    /// Friction torque over its RMS, positive in forward sliding.
    pub(crate) level: Vec<f64>,
    /// Factor from the friction torque to the level; negative if the friction drives the motion: the torque has the wrong sign.
    pub(crate) level_scale: f64,
    /// True for a column whose coefficient cannot be negative.
    pub(crate) non_negative: Vec<bool>,
    /// What the law leaves, fitted to all rows.
    pub(crate) residual: Vec<f64>,
    /// True if it has slip of a free shape: several stops, or falling functions beside the driver's law.
    pub(crate) has_slip: bool,
    /// What it was made from.
    pub(crate) origin: Origin,
    /// Simulated causes, which take the place of those of shape.
    simulated: Arc<[Variant]>,
    /// Coefficients of its columns, fitted to all rows.
    pub(crate) sizes: Vec<f64>,
    /// Index of its main travel.
    pub(crate) travel: usize,
    /// Prior cost.
    price: f64,
}

impl Base {
    /// Returns a law of stops and falling functions.
    pub(crate) fn of_shapes(rows: &Rows, shapes: &Shapes, law: &Law) -> Self {
        let columns = shapes.columns(rows, law);
        let non_negative = shapes.non_negative(rows, law);
        // With any sign: a level that rises with the speed and a torque of the wrong sign are to be seen.
        let Fitted { sizes, residual } = Fitted::new(rows, &columns);
        let stops = law.stops.len();
        let falls = stops + 1..stops + 1 + if law.has_falls { WIDTHS.len() } else { 0 };
        let of_friction = (0..columns.len()).filter(|at| *at < stops || falls.contains(at));
        let of_friction: Vec<usize> = of_friction.collect();
        let level =
            rows.map(|row| of_friction.iter().map(|at| columns[*at][row] * sizes[*at]).sum());
        let (level, level_scale) = scaled_level(rows, level);
        Self {
            name: law.name,
            columns,
            level,
            level_scale,
            non_negative,
            residual,
            sizes,
            has_slip: law.stops.len() > 1,
            origin: Origin::Shapes(law.clone()),
            simulated: Arc::from([]),
            travel: law.stops[0],
            price: law.price(),
        }
    }

    /// Returns the driver's law, beside stops and falling functions of `free` that may take what it misses.
    pub(crate) fn of_kernel(
        rows: &Rows,
        shapes: &Shapes,
        kernel: &KernelLaw,
        free: Option<&Law>,
    ) -> Self {
        let mut columns = kernel.columns.clone();
        let travel = shapes.nearest_travel(kernel.travel);
        let mut price = 0.0;
        if let Some(law) = free {
            let stops = law.stops.iter().copied();
            columns.extend(stops.map(|at| shapes.stops[at].clone()));
            columns.extend(shapes.falls.iter().map(|fall| product(&shapes.stops[travel], fall)));
            price = law.price();
        }
        let non_negative = vec![false; columns.len()];
        let Fitted { sizes, residual } = Fitted::new(rows, &columns);
        let (level, level_scale) = scaled_level(rows, kernel.level.clone());
        let name = if free.is_some() { "lugre with slip" } else { "lugre" };
        let simulated = kernel.simulated.clone();
        Self {
            name,
            columns,
            level,
            level_scale,
            non_negative,
            residual,
            sizes,
            has_slip: free.is_some(),
            origin: Origin::Kernel(Box::new(kernel.parameters.clone())),
            simulated,
            travel,
            price,
        }
    }
}

/// A fit of columns to all rows.
struct Fitted {
    sizes: Vec<f64>,
    residual: Vec<f64>,
}

impl Fitted {
    fn new(rows: &Rows, columns: &[Vec<f64>]) -> Self {
        let all: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let indices: Vec<usize> = (0..all.len()).collect();
        let sizes = Bank::new(rows, &all).fit(&indices, &mut Workspace::default());
        let model = |row: usize| all.iter().zip(&sizes).map(|(c, size)| c[row] * size).sum::<f64>();
        let residual = rows.map(|row| rows.torque[row] - model(row));
        Self { sizes, residual }
    }
}

/// Returns a friction torque over its RMS, positive in forward sliding, and the factor to it: negative if the torque drives
/// the motion.
fn scaled_level(rows: &Rows, mut level: Vec<f64>) -> (Vec<f64>, f64) {
    let squares: f64 = level.iter().map(|v| v * v).sum();
    let along: f64 = level.iter().zip(&rows.velocity).map(|(a, b)| a * b).sum();
    let scale = along.signum() / ((squares / level.len().max(1) as f64).sqrt() + 1e-300);
    level.iter_mut().for_each(|v| *v *= scale);
    (level, scale)
}

/// Columns and products of one correction and law.
pub(crate) struct Entry {
    pub(crate) base: Base,
    pub(crate) correction: Correction,
    pub(crate) variants: Vec<Variant>,
    pub(crate) bank: Bank,
    /// Number of found sets of orders that the variants were made from.
    orders: usize,
}

impl Entry {
    pub(crate) fn new(
        rows: &Rows,
        shapes: &Shapes,
        mut base: Base,
        correction: Correction,
        waves: &Waves,
    ) -> Self {
        let orders = waves.orders.len();
        let variants = corrected_variants(rows, shapes, &base, correction, waves, orders);
        if correction != Correction::None {
            base.columns.iter_mut().for_each(|column| *column = correction.apply(rows, column));
        }
        let columns =
            base.columns.iter().chain(variants.iter().flat_map(|variant| &variant.columns));
        let columns: Vec<&[f64]> = columns.map(Vec::as_slice).collect();
        let signs = base.non_negative.iter().copied();
        let bank = Bank::new(rows, &columns).with_non_negative(signs);
        Self { base, correction, variants, bank, orders }
    }

    /// Drops the columns of all variants. Their products in the bank stay.
    pub(crate) fn drop_columns(&mut self) {
        let columns = self.variants.iter_mut().flat_map(|variant| &mut variant.columns);
        columns.for_each(|column| *column = Vec::new());
    }

    /// Computes the columns of a set again if they were dropped.
    pub(crate) fn restore_columns(
        &mut self,
        rows: &Rows,
        shapes: &Shapes,
        waves: &Waves,
        set: &[u16],
    ) {
        let is_dropped = |at: &&u16| self.variants[**at as usize].columns.iter().any(Vec::is_empty);
        if !set.iter().any(|at| is_dropped(&at)) {
            return;
        }
        let (base, correction) = (&self.base, self.correction);
        let mut made = corrected_variants(rows, shapes, base, correction, waves, self.orders);
        for at in set {
            let at = *at as usize;
            self.variants[at].columns = std::mem::take(&mut made[at].columns);
        }
    }

    /// Returns the columns of a set of variants, those of the law first. None of them may be dropped.
    pub(crate) fn columns(&self, set: &[u16]) -> Vec<&[f64]> {
        let of_variants = set.iter().flat_map(|variant| &self.variants[*variant as usize].columns);
        self.base.columns.iter().chain(of_variants).map(Vec::as_slice).collect()
    }

    /// Returns the indices of a set's columns in the bank.
    pub(crate) fn indices(&self, set: &[u16]) -> Vec<usize> {
        Search::new(&self.bank, self.base.columns.len(), &self.variants).columns(set)
    }

    pub(crate) fn search(&self, bank: usize) -> Vec<Hypothesis> {
        let mut search = Search::new(&self.bank, self.base.columns.len(), &self.variants);
        search.run();
        let scores = std::mem::take(&mut search.scores);
        let hypothesis = |(set, error): (Vec<u16>, f64)| {
            let mut causes: BTreeSet<CauseKey> = set
                .iter()
                .map(|at| &self.variants[*at as usize])
                .filter(|v| v.is_cause())
                .map(|v| v.key.clone())
                .collect();
            let mut price = search.price(&set) + self.base.price;
            if self.correction.is_cause() {
                causes.insert(CauseKey { cause: "channel-delay", columns: Vec::new() });
            }
            if self.correction != Correction::None {
                price += CORRECTION_PRICE;
            }
            Hypothesis { bank, set, causes, error, price }
        };
        scores.into_iter().filter(|(_, error)| error.is_finite()).map(hypothesis).collect()
    }
}

/// Returns the variants of all causes for a base law, with a correction of the log. They are made from the first `known` sets
/// of orders, so that an older entry gets the same variants again.
fn corrected_variants(
    rows: &Rows,
    shapes: &Shapes,
    base: &Base,
    correction: Correction,
    waves: &Waves,
    known: usize,
) -> Vec<Variant> {
    let (orders, gaps) = (&waves.orders[..known], &waves.gaps);
    let (travel, level, residual) = (base.travel, &base.level, &base.residual);
    let context = Context { rows, shapes, travel, level, orders, gaps, residual };
    let mut made = variants(&context);
    if !base.simulated.is_empty() {
        made.retain(|variant| !acts_through_bristles(variant.key.cause));
        made.extend(base.simulated.iter().cloned());
    }
    if correction != Correction::None {
        let columns = made.iter_mut().flat_map(|variant| &mut variant.columns);
        columns.for_each(|column| *column = correction.apply(rows, column));
    }
    made
}

//! One entry of the contest: the columns of a correction and a law, their products, and the search among them.

use super::bank::Bank;
use super::cause::{Built, Context, Variant, Waves, variants};
use super::cause_key::CauseKey;
use super::correction::Correction;
use super::kernel::KernelLaw;
use super::law::{Law, LawPart, Shapes, WIDTHS, law_columns, product};
use super::ledger::Hypothesis;
use super::rows::Rows;
use super::search::Search;
use compensator_core::Parameters;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::ops::Range;

/// Prior cost of a correction.
const CORRECTION_PRICE: f64 = 0.04;

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
    /// Its columns; in an entry, as the torque channel logs them.
    pub(crate) columns: Vec<Vec<f64>>,
    /// True for a column whose coefficient cannot be negative.
    pub(crate) non_negative: Vec<bool>,
    /// Its fit to the log as it is.
    pub(crate) fit: Fitted,
    /// Its friction level.
    pub(crate) level: FrictionLevel,
    /// True if it has slip of a free shape: several stops, or falling functions beside the driver's law.
    pub(crate) has_slip: bool,
    /// What it was made from.
    pub(crate) origin: Origin,
    /// Simulated causes, which take the place of those of shape.
    pub(crate) simulated: Vec<Variant>,
    /// Index of its main travel.
    pub(crate) travel: usize,
    /// Prior cost.
    price: f64,
}

impl Base {
    /// Returns a law of stops and falling functions.
    pub(crate) fn of_shapes(rows: &Rows, shapes: &Shapes, law: &Law) -> Self {
        let parts = shapes.parts(rows, law);
        let columns = law_columns(rows, &parts);
        // With any sign: a level that rises with the speed and a torque of the wrong sign are to be seen.
        let fit = Fitted::new(rows, &columns);
        let stops = law.stops.len();
        let falls = stops + 1..stops + 1 + if law.has_falls { WIDTHS.len() } else { 0 };
        let of_friction = (0..columns.len()).filter(|at| *at < stops || falls.contains(at));
        let of_friction: Vec<usize> = of_friction.collect();
        let friction =
            rows.map(|row| of_friction.iter().map(|at| columns[*at][row] * fit.sizes[*at]).sum());
        Self {
            name: law.name,
            columns,
            non_negative: parts.iter().map(LawPart::is_non_negative).collect(),
            fit,
            level: FrictionLevel::new(rows, friction),
            has_slip: law.stops.len() > 1,
            origin: Origin::Shapes(law.clone()),
            simulated: Vec::new(),
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
        Self {
            name: if free.is_some() { "lugre with slip" } else { "lugre" },
            non_negative: vec![false; columns.len()],
            fit: Fitted::new(rows, &columns),
            columns,
            level: FrictionLevel::new(rows, kernel.level.clone()),
            has_slip: free.is_some(),
            origin: Origin::Kernel(Box::new(kernel.parameters.clone())),
            simulated: kernel.simulated.clone(),
            travel,
            price,
        }
    }
}

/// A fit of columns to all rows.
#[derive(Clone)]
pub(crate) struct Fitted {
    /// Coefficients of the columns.
    pub(crate) sizes: Vec<f64>,
    /// What they leave of the torque.
    pub(crate) residual: Vec<f64>,
}

impl Fitted {
    fn new(rows: &Rows, columns: &[Vec<f64>]) -> Self {
        let all: Vec<usize> = (0..columns.len()).collect();
        let sizes = Bank::new(rows, columns).fit(&all);
        Self { residual: rows.residual(columns, &sizes), sizes }
    }
}

/// A friction torque over its RMS, positive in forward sliding.
#[derive(Clone)]
pub(crate) struct FrictionLevel {
    /// Its value in all rows, without a unit.
    pub(crate) torque: Vec<f64>,
    /// Factor from the friction torque to it; negative if the friction drives the motion: the torque has the wrong sign.
    pub(crate) scale: f64,
}

impl FrictionLevel {
    fn new(rows: &Rows, mut torque: Vec<f64>) -> Self {
        let squares: f64 = torque.iter().map(|v| v * v).sum();
        let along: f64 = torque.iter().zip(&rows.velocity).map(|(a, b)| a * b).sum();
        let scale = along.signum() / ((squares / torque.len().max(1) as f64).sqrt() + 1e-300);
        torque.iter_mut().for_each(|v| *v *= scale);
        Self { torque, scale }
    }
}

/// A base law with a correction, the variants of all causes beside it, and the products of all their columns.
pub(crate) struct Entry {
    pub(crate) base: Base,
    pub(crate) correction: Correction,
    pub(crate) variants: Vec<Variant>,
    pub(crate) bank: Bank,
}

impl Entry {
    /// Computes the products. The columns of the variants, the largest part of the memory, are not kept.
    pub(crate) fn new(
        rows: &Rows,
        shapes: &Shapes,
        mut base: Base,
        correction: Correction,
        waves: &Waves,
    ) -> Self {
        let (travel, level, residual) = (base.travel, &base.level.torque, &base.fit.residual);
        let context = Context { rows, shapes, travel, level, residual, waves };
        let built = variants(&context, &base.simulated);
        let (mut variants, mut columns) = (Vec::new(), Vec::new());
        for Built { variant, columns: of_variant } in built {
            variants.push(variant);
            columns.extend(of_variant);
        }
        if correction != Correction::None {
            let corrected = base.columns.iter_mut().chain(&mut columns);
            corrected.for_each(|column| *column = correction.apply(rows, column));
        }
        let all: Vec<&Vec<f64>> = base.columns.iter().chain(&columns).collect();
        let signs = base.non_negative.iter().copied();
        let bank = Bank::new(rows, &all).with_non_negative(signs);
        Self { base, correction, variants, bank }
    }

    /// Returns the variants of a set.
    pub(crate) fn chosen(&self, set: &[u16]) -> impl Iterator<Item = &Variant> + Clone {
        set.iter().map(|at| &self.variants[*at as usize])
    }

    /// Returns the variants of a set, each with the places of its columns among those of [`Self::columns`].
    pub(crate) fn placed(&self, set: &[u16]) -> impl Iterator<Item = (&Variant, Range<usize>)> {
        let mut next = self.base.columns.len();
        self.chosen(set).map(move |variant| {
            next += variant.width();
            (variant, next - variant.width()..next)
        })
    }

    /// Returns the columns of a set of variants, those of the law first, as the torque channel logs them.
    pub(crate) fn columns(&self, rows: &Rows, set: &[u16]) -> Vec<Cow<'_, [f64]>> {
        let of_law = self.base.columns.iter().map(|column| Cow::Borrowed(column.as_slice()));
        let mut columns: Vec<Cow<'_, [f64]>> = of_law.collect();
        for variant in self.chosen(set) {
            let of_variant = variant.columns(rows, &self.base.level.torque);
            let of_variant = of_variant.expect("the log has the columns of a variant");
            let corrected = of_variant.iter().map(|column| self.correction.apply(rows, column));
            columns.extend(corrected.map(Cow::Owned));
        }
        columns
    }

    /// Returns the indices of a set's columns in the bank.
    pub(crate) fn indices(&self, set: &[u16]) -> Vec<usize> {
        Search::new(&self.bank, self.base.columns.len(), &self.variants).columns(set)
    }

    /// Returns the coefficients of [`Self::columns`], fitted to all rows.
    pub(crate) fn fit(&self, set: &[u16]) -> Vec<f64> {
        self.bank.fit(&self.indices(set))
    }

    /// Returns the coefficients of [`Self::columns`], fitted without each fold.
    pub(crate) fn fits_without_fold(&self, set: &[u16]) -> Vec<Vec<f64>> {
        self.bank.fits_without_fold(&self.indices(set))
    }

    /// Returns the hypotheses of a search. `bank` is the index of the entry.
    pub(crate) fn search(&self, bank: usize) -> Vec<Hypothesis> {
        let mut search = Search::new(&self.bank, self.base.columns.len(), &self.variants);
        search.run();
        let scores = std::mem::take(&mut search.scores);
        let hypothesis = |(set, error): (Vec<u16>, f64)| {
            let found = self.chosen(&set).filter(|variant| variant.is_cause());
            let mut causes: BTreeSet<CauseKey> = found.map(|variant| variant.key.clone()).collect();
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

//! Base laws as columns: what friction is without a cause.
//!
//! A law is a sum of stops of some travels, a viscous column, and the stop times a falling function of speed (the Stribeck
//! effect, whose shape is free within three widths). One stiff stop is Coulomb friction; one soft stop the Dahl law; with the
//! Stribeck columns they are the static Stribeck law and a law like LuGre; several stops are Maxwell slip. The rigid-body parts
//! of the torque column belong to every law.
//!
//! A stop with a negative size would return energy, so such a law is refused: otherwise the difference of two stops would stand
//! in for a backlash.

use super::bank::{Bank, Workspace};
use super::rows::Rows;
use friction_fit::linear::{Factor, LinearTerm, Regressor, stop};
use joint_log::Quantity;
use std::ops::Range;

/// Number of travels that are tried.
const TRAVELS: usize = 10;

/// Largest travel as a share of the swing of a run.
const LARGEST_TRAVEL: f64 = 0.3;

/// Widths of the falling functions, as shares of the top speed.
pub(crate) const WIDTHS: [f64; 3] = [0.02, 0.07, 0.25];

/// Share of the error that another stop must take.
const MIN_STOP_GAIN: f64 = 0.015;

/// Prior cost of each stop after the first, as a share of the error.
const STOP_PRICE: f64 = 0.02;

/// Most stops of a law.
const MOST_STOPS: usize = 3;

/// Ratio of a law's error to the best law's above which it does not compete.
const MAX_ERROR_RATIO: f64 = 1.5;

/// Most laws that compete.
const MOST_LAWS: usize = 5;

/// The columns of which laws are made, in all rows.
#[derive(Clone, Debug)]
pub struct Shapes {
    /// Travels of the stops, in ascending order.
    pub travels: Vec<f64>,
    /// The stop of each travel.
    pub stops: Vec<Vec<f64>>,
    /// Speeds over which the falling functions fall.
    pub widths: [f64; 3],
    /// Falling functions of speed, one for each width.
    pub falls: Vec<Vec<f64>>,
    /// Rigid-body columns.
    pub rigid: Vec<Vec<f64>>,
}

/// A base law: which columns it has.
#[derive(Clone, Debug, PartialEq)]
pub struct Law {
    /// Its name in reports.
    pub name: &'static str,
    /// Indices of its travels, the main one first.
    pub stops: Vec<usize>,
    /// True with the Stribeck columns.
    pub has_falls: bool,
    /// Held-out error without a cause.
    pub error: f64,
}

impl Law {
    /// Returns the prior cost of the law: that of each stop after the first.
    pub fn price(&self) -> f64 {
        STOP_PRICE * (self.stops.len() - 1) as f64
    }
}

impl Shapes {
    /// Computes the columns of all laws.
    pub fn new(rows: &Rows) -> Self {
        let least = rows.least_step;
        let most = (LARGEST_TRAVEL * rows.swing).max(4.0 * least);
        let ratio = (most / least).powf(1.0 / (TRAVELS - 1) as f64);
        // Without a reversal no travel shows: a long one would only follow how each run begins.
        let count = if reverses(rows) { TRAVELS } else { 1 };
        let travels: Vec<f64> = (0..count).map(|at| least * ratio.powi(at as i32)).collect();
        let stops =
            travels.iter().map(|travel| stop(&rows.position, &rows.runs, *travel)).collect();
        let widths = WIDTHS.map(|width| width * rows.top_speed);
        let fall = |width: &f64| rows.map(|row| (-rows.smooth_velocity[row].abs() / width).exp());
        let falls = widths.iter().map(fall).collect();
        Self { travels, stops, widths, falls, rigid: law_columns(rows, &rigid_parts(rows)) }
    }

    /// Returns the parts of a law: its stops, viscous friction, what falls with the speed, and the rigid body.
    pub(crate) fn parts(&self, rows: &Rows, law: &Law) -> Vec<LawPart> {
        let stop = |at: &usize| Factor::Stop { travel: self.travels[*at] };
        let mut found: Vec<LawPart> =
            law.stops.iter().map(|at| LawPart::new(COULOMB, [stop(at)])).collect();
        found.push(LawPart::new(VISCOUS, [Factor::Velocity]));
        if law.has_falls {
            let fall = |width: &f64| [stop(&law.stops[0]), Factor::Falling { velocity: *width }];
            found.extend(self.widths.iter().map(|width| LawPart::new(STRIBECK, fall(width))));
        }
        found.extend(rigid_parts(rows));
        found
    }

    /// Returns the index of the travel that is nearest to a displacement, as a ratio.
    pub fn nearest_travel(&self, displacement: f64) -> usize {
        let distance = |at: &usize| (self.travels[*at] / displacement).ln().abs();
        let all = 0..self.travels.len();
        all.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or_default()
    }

    /// Returns Coulomb and viscous friction.
    pub fn plain_law() -> Law {
        Law { name: "linear", stops: vec![0], has_falls: false, error: f64::INFINITY }
    }

    /// Returns the competing laws, the best first: the static ones, those with one stop, and Maxwell slip.
    pub fn laws(&self, rows: &Rows) -> Vec<Law> {
        let table = LawTable::new(self, rows);
        let mut laws: Vec<Law> = Vec::new();
        for has_falls in [false, true] {
            for at in 0..self.travels.len() {
                laws.extend(table.law(&[at], has_falls));
            }
        }
        laws.sort_by(|a, b| a.error.total_cmp(&b.error));
        let mut best = Vec::new();
        for law in laws.iter().take(2) {
            best.extend(table.with_more_stops(law));
        }
        best.extend(laws);
        best.sort_by(|a, b| a.error.total_cmp(&b.error));
        let most = MAX_ERROR_RATIO * best.first().map_or(0.0, |law| law.error);
        let mut kept: Vec<Law> = Vec::new();
        for law in best {
            let is_new = kept.iter().all(|other| other.stops != law.stops);
            if is_new && law.error <= most && kept.len() < MOST_LAWS {
                kept.push(law);
            }
        }
        kept
    }
}

/// Share of the top speed that a run must reach both ways to have a reversal.
const BOTH_WAYS: f64 = 0.1;

/// Returns true if a run moves both ways.
fn reverses(rows: &Rows) -> bool {
    let fastest = |run: &Range<usize>, sign: f64| {
        rows.smooth_velocity[run.clone()].iter().fold(0.0f64, |most, v| most.max(sign * v))
    };
    let least = BOTH_WAYS * rows.top_speed;
    rows.runs.iter().any(|run| fastest(run, 1.0) > least && fastest(run, -1.0) > least)
}

/// A part of a law: a column.
#[derive(Clone, Debug)]
pub(crate) struct LawPart {
    /// Its name in a model.
    pub(crate) name: &'static str,
    /// What the column is.
    pub(crate) regressor: Regressor,
}

impl LawPart {
    pub(crate) fn new<const N: usize>(name: &'static str, factors: [Factor; N]) -> Self {
        Self { name, regressor: factors.into() }
    }

    /// Returns true if the coefficient cannot be negative: of friction levels, viscous friction and inertia.
    pub(crate) fn is_non_negative(&self) -> bool {
        [COULOMB, VISCOUS, INERTIA].contains(&self.name)
    }

    /// Returns the part with its coefficient.
    pub(crate) fn term(&self, size: f64) -> LinearTerm {
        LinearTerm { part: self.name.into(), size, factors: self.regressor.clone() }
    }
}

/// Name of a stop in a law.
pub const COULOMB: &str = "coulomb";

/// Name of the viscous part of a law.
pub const VISCOUS: &str = "viscous";

/// Name of a part that falls with the speed.
pub const STRIBECK: &str = "stribeck";

/// Name of the inertia among the rigid-body parts.
pub const INERTIA: &str = "inertia";

/// Name of a constant among them.
pub const OFFSET: &str = "offset";

/// Returns the rigid-body parts of the torque column.
pub(crate) fn rigid_parts(rows: &Rows) -> Vec<LawPart> {
    let parts = rows.rigid_body;
    let mut found = Vec::new();
    if parts.offset {
        found.push(LawPart::new(OFFSET, [Factor::One]));
    }
    if parts.inertia {
        found.push(LawPart::new(INERTIA, [Factor::Acceleration]));
    }
    if parts.gravity {
        let order = 1.0;
        let waves = [Factor::Sine { order }, Factor::Cosine { order }];
        found.extend(waves.map(|wave| LawPart::new("gravity", [wave])));
    }
    if let Some(load) = rows.quantity(Quantity::LoadTorque).filter(|_| parts.load) {
        found.push(LawPart::new("load", [Factor::of_column(&load.name)]));
    }
    found
}

/// Returns the columns of the parts of a law.
pub(crate) fn law_columns(rows: &Rows, parts: &[LawPart]) -> Vec<Vec<f64>> {
    parts.iter().filter_map(|part| rows.values(&part.regressor, &[])).collect()
}

/// Returns the product of two columns.
pub fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

/// Products of the columns of all laws.
struct LawTable {
    bank: Bank,
    travels: usize,
    rigid: usize,
}

impl LawTable {
    fn new(shapes: &Shapes, rows: &Rows) -> Self {
        let falling = shapes
            .stops
            .iter()
            .flat_map(|stop| shapes.falls.iter().map(move |fall| product(stop, fall)));
        let falling: Vec<Vec<f64>> = falling.collect();
        let mut all: Vec<&[f64]> = shapes.stops.iter().map(Vec::as_slice).collect();
        all.push(&rows.smooth_velocity);
        all.extend(shapes.rigid.iter().map(Vec::as_slice));
        all.extend(falling.iter().map(Vec::as_slice));
        // Stops and viscous friction, then the rigid body.
        let signs = shapes.stops.iter().map(|_| true).chain([true]);
        let rigid = rigid_parts(rows);
        let signs = signs.chain(rigid.iter().map(LawPart::is_non_negative));
        Self {
            bank: Bank::new(rows, &all).with_non_negative(signs),
            travels: shapes.travels.len(),
            rigid: shapes.rigid.len(),
        }
    }

    /// Returns a law with its held-out error; `None` if one of several stops has no size.
    fn law(&self, stops: &[usize], has_falls: bool) -> Option<Law> {
        let mut columns = stops.to_vec();
        columns.extend(self.travels..=self.travels + self.rigid);
        if has_falls {
            let first = self.travels + 1 + self.rigid + WIDTHS.len() * stops[0];
            columns.extend(first..first + WIDTHS.len());
        }
        let mut work = Workspace::default();
        let error = self.bank.error(&columns, &mut work);
        let sizes = self.bank.sizes(&columns, &work);
        if stops.len() > 1 && sizes[..stops.len()].iter().any(|size| *size <= 0.0) {
            return None;
        }
        let name = match (stops.len(), stops[0] == 0, has_falls) {
            (1, true, false) => "linear",
            (1, true, true) => "stribeck",
            (1, false, false) => "dahl",
            (1, false, true) => "lugre",
            _ => "maxwell-slip",
        };
        Some(Law { name, stops: stops.to_vec(), has_falls, error })
    }

    fn with_more_stops(&self, law: &Law) -> Option<Law> {
        let mut now = law.clone();
        while now.stops.len() < MOST_STOPS {
            let others = (0..self.travels).filter(|at| !now.stops.contains(at));
            let longer = others.filter_map(|at| {
                let stops: Vec<usize> = now.stops.iter().copied().chain([at]).collect();
                self.law(&stops, true)
            });
            let best = longer.min_by(|a, b| a.error.total_cmp(&b.error));
            match best.filter(|best| best.error < (1.0 - MIN_STOP_GAIN) * now.error) {
                Some(best) => now = best,
                None => break,
            }
        }
        (now.stops.len() > 1).then_some(now)
    }
}

/// Smallest friction level with which a fit begins, as a share of the RMS torque.
pub(crate) const SMALLEST_LEVEL: f64 = 0.02;

/// Parameters of a law as its columns have them, in the units of the log.
#[derive(Clone, Copy, Debug, Default)]
pub struct LawStart {
    /// Its name.
    pub name: &'static str,
    /// Friction level in sliding.
    pub coulomb: f64,
    /// What the level at rest exceeds it by.
    pub static_excess: f64,
    /// Speed at which most of the excess is gone.
    pub stribeck_velocity: f64,
    /// Travel over which friction builds up.
    pub travel: f64,
    /// Viscous coefficient.
    pub viscous: f64,
}

impl LawStart {
    /// Returns the parameters of a law of shapes from the coefficients of its columns.
    pub(crate) fn of_shapes(rows: &Rows, shapes: &Shapes, law: &Law, sizes: &[f64]) -> Self {
        let stops = &sizes[..law.stops.len()];
        let falls =
            sizes[law.stops.len() + 1..].iter().take(if law.has_falls { WIDTHS.len() } else { 0 });
        let falls: Vec<f64> = falls.map(|size| size.max(0.0)).collect();
        let excess: f64 = falls.iter().sum();
        let width: f64 = falls.iter().zip(WIDTHS).map(|(fall, width)| fall * width).sum();
        let level: f64 = stops.iter().map(|size| size.abs()).sum::<f64>().max(f64::MIN_POSITIVE);
        let travel: f64 =
            law.stops.iter().zip(stops).map(|(at, s)| shapes.travels[*at] * s.abs()).sum();
        Self {
            name: law.name,
            coulomb: stops.iter().sum(),
            static_excess: excess,
            stribeck_velocity: rows.top_speed
                * if excess > 0.0 { width / excess } else { WIDTHS[1] },
            travel: travel / level,
            viscous: sizes[law.stops.len()],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contest::rows::tests::example;

    #[test]
    fn laws_of_coulomb_friction_are_no_worse_than_the_linear_law() {
        let rows = example();
        let shapes = Shapes::new(&rows);
        let table = LawTable::new(&shapes, &rows);
        let linear = table.law(&[0], false).unwrap();
        let laws = shapes.laws(&rows);
        assert!(laws[0].error <= linear.error, "{} {}", laws[0].error, linear.error);
        assert!(laws.len() > 1);
    }
}

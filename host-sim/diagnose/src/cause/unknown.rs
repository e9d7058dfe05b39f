//! Unknown causes: a curve of any shape over any column, or structure without a column.
//!
//! The curve is piecewise linear. It is fitted as a separate torque (a sensor's error, a load) and
//! as a share of the friction level. A straight line over a covariate, as for a sensor's gain
//! error, is a candidate of its own. Curves of any shape are considered after the named causes and
//! with a lower weight, because six knots can approximate many shapes. Structure that follows no
//! column is reported without a term.

use super::followed::Followed;
use super::{Cause, Remedy, formula};
use crate::candidate::{Candidate, FitContext, InitialGuess, Row, row};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView, Spacing};
use crate::extended::{Extended, Size};
use crate::train_test::FollowedColumn;
use crate::train_test::TrainTest;
use compensator_core::term::{LOOKUP_KNOTS, LOOKUP_LEVELS, LOOKUP_TORQUES, LookupFormula};
use compensator_core::{ParameterId as Id, Quantity, TermKind};
use friction_fit::State;

/// Unknown cause; see the module documentation.
pub(super) const UNKNOWN: Cause = Cause {
    meaning: "no named cause explains the remaining error",
    effect: "a torque and a change of the levels drawn over one column.",
    is_named: false,
    candidates,
    size: Some(knot_range),
    words: in_words,
    evidence,
    next_experiment: |columns| {
        Some(if columns.is_empty() {
            "Repeat the worst run and log every quantity that this joint measures.".into()
        } else {
            format!("Vary {} in steps with everything else held constant.", columns.join(" and "))
        })
    },
    ..Cause::new("unknown", Remedy::Term(TermKind::LookupTable))
};

/// Returns a curve over every column, as a torque and as a share of the level, and a line over every covariate.
fn candidates(context: &FitContext) -> Vec<Candidate> {
    // With an offset in the model, the constant of the curve is redundant.
    let offset = context.has(TermKind::TorqueOffset);
    let mut all = Vec::new();
    for followed in columns(context.log) {
        let values = values(context.log, &followed);
        all.extend(formula::candidates(&followed, &values));
        // A sensor's gain error is a straight line over a covariate, and simple enough for a
        // candidate of its own. A line over velocity is viscous friction. A line over angle or
        // time has no meaning.
        let is_covariate = followed.is_covariate();
        let ways = [(false, false), (true, false), (false, true)];
        for (level, proportional) in ways.into_iter().filter(|(_, line)| !line || is_covariate) {
            let way = Way { level, proportional, pins: level || offset };
            all.extend(curve(&followed, &values, way));
        }
    }
    all
}

/// Returns the difference between the highest and the lowest knot.
fn knot_range(extended: &Extended) -> Size {
    if extended.formula() != LookupFormula::None {
        return extended.size(Id::LookupRise);
    }
    let knots = knots(extended.follows_level());
    let value = |id: &Id| extended.value(*id);
    let error = |id: &Id| extended.error(*id);
    // A knot with few rows is not determined and does not count. A knot that was pinned at 0
    // counts.
    let sure = |id: &&Id| {
        extended.estimate(**id).is_some_and(|e| match e.std_error {
            Some(_) => {
                e.state == State::Determined
                    || e.value.abs() > 3.0 * error(id) && e.state != State::AtBound
            }
            None => e.value == 0.0,
        })
    };
    let by = |a: &&Id, b: &&Id| value(a).total_cmp(&value(b));
    let low = knots.iter().filter(sure).min_by(by).unwrap_or(&knots[0]);
    let high = knots.iter().filter(sure).max_by(by).unwrap_or(&knots[0]);
    let spread = error(low).hypot(error(high));
    Size::new(value(high) - value(low), spread, extended.unit(knots[0]))
}

fn in_words(meaning: &str, size: &Size, extended: &Extended) -> String {
    let Some(follows) = extended.follows else {
        return format!("{meaning}: {}", size.in_words());
    };
    if follows.formula != LookupFormula::None {
        return formula::in_words(follows.formula, size, extended, &follows.column);
    }
    let (column, shape) = (&follows.column, shape(extended, follows.level));
    let size = size.in_words();
    if follows.level {
        format!(
            "friction follows {column}, {shape}, in a way that no named cause describes: its level varies by {size}"
        )
    } else {
        format!(
            "a torque follows {column}, {shape}, in both directions of motion alike: calibration or load, not friction; it varies by {size}"
        )
    }
}

fn evidence(columns: &[String], extended: &Extended) -> Option<Evidence> {
    let name = columns.first()?;
    // The view depends on the curve in the model, which may be a torque or a level.
    let mut levels = LOOKUP_LEVELS.iter().chain([&Id::LookupRise]);
    let level = levels.any(|id| extended.value(*id) != 0.0);
    let is_velocity = name == extended.log.velocity_name();
    Plane::new(
        format!("What follows {name}"),
        PlaneAxis::Column(name.clone()),
        if level { ResidualView::Along } else { ResidualView::Plain },
        "No named cause has this shape; the extension is a curve drawn through it.",
    )
    .spaced(if is_velocity { Spacing::NarrowAtZero } else { Spacing::Even })
    .into()
}

fn knots(level: bool) -> [Id; LOOKUP_KNOTS] {
    if level { LOOKUP_LEVELS } else { LOOKUP_TORQUES }
}

fn columns(log: &TrainTest) -> Vec<Followed> {
    let followable = |of: &&Quantity| of.info().column.is_some() && **of != Quantity::Auxiliary;
    let measured = Quantity::ALL.iter().filter(followable).map(|quantity| Followed {
        name: quantity.name(log.train.joint).to_owned(),
        quantity: *quantity,
        covariate: None,
    });
    let extras = log.extras.iter().map(|index| Followed {
        name: log.train.covariates[*index].clone(),
        quantity: Quantity::Auxiliary,
        covariate: Some(*index),
    });
    let tells = |followed: &Followed| {
        let is_time = followed.quantity == Quantity::CampaignTime;
        log.varies(&followed.name) && (!is_time || log.has_campaign_clock())
    };
    measured.filter(tells).chain(extras).collect()
}

/// How the curve follows a column.
#[derive(Clone, Copy)]
struct Way {
    /// True for a share of the friction level; false for a separate torque.
    level: bool,
    /// True for a straight line.
    proportional: bool,
    /// True if the knot nearest the median stays at 0, because the base model contains the
    /// constant.
    pins: bool,
}

/// Returns some of a column's values, in the core's unit, sorted.
fn values(log: &TrainTest, followed: &Followed) -> Vec<f64> {
    let mut values: Vec<f64> = log
        .train_tracks
        .iter()
        .flat_map(|track| {
            track.samples.iter().enumerate().step_by(7).map(|(row, sample)| {
                let extra = followed.covariate.map_or(0.0, |index| track.covariates[index][row]);
                let row = Row { sample, added: 0.0, level: 0.0, viscous: 0.0, extra };
                Followed::read(followed.quantity, &row)
            })
        })
        .collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Where the knots of a curve are, in the unit of its column.
struct KnotPlaces {
    least: f64,
    most: f64,
    /// Distance between two knots.
    width: f64,
    /// The knot nearest the median.
    median: usize,
}

impl KnotPlaces {
    /// Spreads the knots over sorted values; `None` if they are all equal.
    fn over(values: &[f64]) -> Option<Self> {
        let (least, most) = (*values.first()?, *values.last()?);
        if most <= least {
            return None;
        }
        let width = (most - least) / (LOOKUP_KNOTS - 1) as f64;
        let middle = values[((values.len() - 1) as f64 * 0.5) as usize];
        let median = (((middle - least) / width).round() as usize).min(LOOKUP_KNOTS - 1);
        Some(Self { least, most, width, median })
    }

    fn at(&self, knot: usize) -> f64 {
        self.least + knot as f64 * self.width
    }
}

/// Returns a curve over one column, of which some sorted values are given; `None` if they are all
/// equal.
fn curve(followed: &Followed, values: &[f64], way: Way) -> Option<Candidate> {
    let Way { level, proportional, pins } = way;
    let places = KnotPlaces::over(values)?;
    let (width, pinned) = (places.width, places.median);
    let (free_knots, others) = (knots(level), knots(!level));
    let quantity = followed.quantity;
    let read = move |row: &Row| Followed::read(quantity, row);
    let factor = quantity.info().outside_scale;
    let mut guesses = vec![
        (Id::LookupColumn, InitialGuess::At(followed.number())),
        (Id::LookupLower, InitialGuess::At(places.least * factor)),
        (Id::LookupUpper, InitialGuess::At(places.most * factor)),
    ];
    if pins {
        guesses.push((free_knots[pinned], InitialGuess::At(0.0)));
    }
    let mut regressors = Vec::new();
    for (knot, id) in free_knots.iter().enumerate().filter(|(knot, _)| !pins || *knot != pinned) {
        let centre = places.at(knot);
        if proportional {
            let from = if pins { places.at(pinned) } else { 0.0 };
            guesses.push((*id, InitialGuess::first_times(centre - from)));
            continue;
        }
        guesses.push((*id, InitialGuess::Times { regressor: regressors.len(), factor: 1.0 }));
        regressors.push(row(move |r| {
            let hat = (1.0 - ((read(r) - centre) / width).abs()).max(0.0);
            if level { hat * r.level } else { hat }
        }));
    }
    if proportional {
        regressors.push(row(read));
    }
    let mut fixed = vec![Id::LookupColumn, Id::LookupLower, Id::LookupUpper];
    fixed.extend(pins.then_some(free_knots[pinned]));
    fixed.extend(others);
    guesses.extend(others.map(|id| (id, InitialGuess::At(0.0))));
    let by_knots = formula::number(LookupFormula::None);
    guesses.extend([
        (Id::LookupFormula, InitialGuess::At(by_knots)),
        (Id::LookupRise, InitialGuess::At(0.0)),
    ]);
    fixed.extend([Id::LookupRise, Id::LookupScale]);
    let follows = FollowedColumn {
        column: followed.name.clone(),
        covariate: followed.covariate,
        level,
        proportional,
        formula: LookupFormula::None,
    };
    let name = followed.name.as_str();
    Some(
        Candidate::new(TermKind::LookupTable, &[name], regressors)
            .starting_at(&guesses)
            .keeping(&fixed)
            .following(follows),
    )
}

/// Returns the shape of the curve in words.
fn shape(extended: &Extended, level: bool) -> &'static str {
    let values = knots(level).map(|id| extended.value(id));
    let steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let span = values.iter().fold(f64::MIN, |a, b| a.max(*b))
        - values.iter().fold(f64::MAX, |a, b| a.min(*b));
    let small = 0.05 * span;
    if steps.iter().all(|step| *step > -small) {
        "rising"
    } else if steps.iter().all(|step| *step < small) {
        "falling"
    } else {
        let peak = values.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |p| p.0);
        let dip = values.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |p| p.0);
        match (peak, dip) {
            (1..=4, 0 | 5) => "with a hump",
            (0 | 5, 1..=4) => "with a dip",
            _ => "up and down",
        }
    }
}

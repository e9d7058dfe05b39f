//! Backlash: after a reversal the joint travels a gap before friction builds up.
//!
//! The friction of a joint with a gap is a stop operator of the play operator of its position. Gap and travel enter
//! nonlinearly, so a grid of both is computed once, and the pairs that explain most become variants: beside the law's own stop,
//! beside it and an asymmetry, and in place of it.

use super::{Columns, Context, plain};
use crate::contest::bank::{Bank, Workspace};
use crate::contest::detail::Detail;
use crate::contest::law::Shapes;
use crate::contest::rows::Rows;
use friction_fit::linear::{Factor, Regressor, play, stop};
use joint_log::work::checkpoint;
use rayon::prelude::*;

/// Number of gaps in the grid.
const GAPS: usize = 9;

/// Largest gap as a share of the swing of a run.
const LARGEST_GAP: f64 = 0.25;

/// Smallest gap as a share of the largest.
const SMALLEST_GAP: f64 = 0.01;

/// Gaps and travels with their columns, and the products of these with all that a law has.
pub struct GapGrid {
    /// Gap and travel of each pair.
    pairs: Vec<(f64, f64)>,
    bank: Option<Bank>,
    stops: usize,
    shared: usize,
}

impl GapGrid {
    /// Computes the grid; an empty one without a position.
    pub fn new(rows: &Rows, shapes: &Shapes) -> Self {
        let stops = shapes.stops.len();
        if !rows.has_position {
            return Self { pairs: Vec::new(), bank: None, stops, shared: 0 };
        }
        let largest = LARGEST_GAP * rows.swing;
        let ratio = SMALLEST_GAP.powf(1.0 / (GAPS - 1) as f64);
        let gaps: Vec<f64> = (0..GAPS).map(|at| largest * ratio.powi(at as i32)).collect();
        let pairs: Vec<(f64, f64)> = gaps
            .iter()
            .flat_map(|gap| shapes.travels.iter().map(move |travel| (*gap, *travel)))
            .collect();
        let stops_of = |gap: &f64| {
            checkpoint();
            let moved = play(&rows.position, &rows.runs, 0.5 * gap);
            let stop = |travel: &f64| stop(&moved, &rows.runs, *travel);
            shapes.travels.iter().map(stop).collect::<Vec<_>>()
        };
        let behind: Vec<Vec<f64>> = gaps.par_iter().flat_map_iter(stops_of).collect();
        let speed: Vec<f64> = rows.smooth_velocity.iter().map(|v| v.abs()).collect();
        let one = vec![1.0; rows.len()];
        let mut columns: Vec<&[f64]> = shapes.stops.iter().map(Vec::as_slice).collect();
        columns.push(&rows.smooth_velocity);
        columns.extend(shapes.rigid.iter().map(Vec::as_slice));
        let shared = columns.len() - stops;
        columns.extend([one.as_slice(), speed.as_slice()]);
        columns.extend(behind.iter().map(Vec::as_slice));
        let bank = Some(Bank::new(rows, &columns));
        Self { pairs, bank, stops, shared }
    }

    /// Returns the best pairs for a law's main travel.
    fn best(&self, travel: usize) -> Vec<usize> {
        let Some(bank) = &self.bank else { return Vec::new() };
        let mut work = Workspace::default();
        let shared = self.stops..self.stops + self.shared;
        let asymmetry = shared.end..shared.end + 2;
        let beside: Vec<usize> = [travel].into_iter().chain(shared.clone()).collect();
        let with_asymmetry: Vec<usize> = beside.iter().copied().chain(asymmetry.clone()).collect();
        let in_place: Vec<usize> = shared.chain(asymmetry.clone()).collect();
        let mut found: Vec<usize> = Vec::new();
        for law in [beside, with_asymmetry, in_place] {
            let mut error = |pair: &usize| {
                let set: Vec<usize> = law.iter().copied().chain([asymmetry.end + pair]).collect();
                bank.error(&set, &mut work)
            };
            let scored = (0..self.pairs.len()).map(|pair| (error(&pair), pair));
            if let Some((_, pair)) = scored.min_by(|a, b| a.0.total_cmp(&b.0)) {
                found.push(pair);
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }
}

pub(super) fn backlash(context: &Context) -> Vec<Columns> {
    let width = context.shapes.widths[1];
    let variant = |pair: usize| {
        let (gap, travel) = context.gaps.pairs[pair];
        let behind = Regressor::from([Factor::StopBehindGap { gap, travel }]);
        let falling = behind.clone().times(Factor::Falling { velocity: width });
        plain(Detail::gap(gap, travel), vec![behind, falling])
    };
    context.gaps.best(context.travel).into_iter().map(variant).collect()
}

//! Backlash: after a reversal the joint travels a gap before friction builds up.
//!
//! The friction of a joint with a gap is a stop operator of the play operator of its position. Gap and travel enter
//! nonlinearly, so a grid of both is computed once, and the pairs that explain most become variants: beside the law's own stop,
//! beside it and an asymmetry, and in place of it.

use super::{Columns, Context, plain};
use crate::contest::bank::{Bank, Workspace};
use crate::contest::detail::{Detail, Gap};
use crate::contest::law::Shapes;
use crate::contest::rows::Rows;
use friction_fit::linear::{Factor, Regressor, play, stop};
use joint_log::work::checkpoint;
use rayon::prelude::*;
use std::ops::Range;

/// Number of gaps in the grid.
const GAPS: usize = 9;

/// Largest gap as a share of the swing of a run.
const LARGEST_GAP: f64 = 0.25;

/// Smallest gap as a share of the largest.
const SMALLEST_GAP: f64 = 0.01;

/// Gaps, and the products of the torques behind them with all that a law has.
pub struct GapGrid {
    gaps: Vec<Gap>,
    /// Products of the stops, of what all laws share, of an asymmetry, and of the stops behind the gaps.
    bank: Bank,
    /// Columns of what all laws share: viscous friction and the rigid body.
    shared: Range<usize>,
}

impl GapGrid {
    /// Computes the grid; `None` without a position.
    pub fn new(rows: &Rows, shapes: &Shapes) -> Option<Self> {
        if !rows.has_position {
            return None;
        }
        let largest = LARGEST_GAP * rows.swing;
        let ratio = SMALLEST_GAP.powf(1.0 / (GAPS - 1) as f64);
        let sizes: Vec<f64> = (0..GAPS).map(|at| largest * ratio.powi(at as i32)).collect();
        let of_size =
            |gap: f64| shapes.travels.iter().map(move |travel| Gap { gap, travel: *travel });
        let gaps = sizes.iter().copied().flat_map(of_size).collect();
        let stops_of = |gap: &f64| {
            checkpoint();
            let moved = play(&rows.position, &rows.runs, 0.5 * gap);
            let stop = |travel: &f64| stop(&moved, &rows.runs, *travel);
            shapes.travels.iter().map(stop).collect::<Vec<_>>()
        };
        let behind: Vec<Vec<f64>> = sizes.par_iter().flat_map_iter(stops_of).collect();
        let speed: Vec<f64> = rows.smooth_velocity.iter().map(|v| v.abs()).collect();
        let one = vec![1.0; rows.len()];
        let mut columns: Vec<&[f64]> = shapes.stops.iter().map(Vec::as_slice).collect();
        columns.push(&rows.smooth_velocity);
        columns.extend(shapes.rigid.iter().map(Vec::as_slice));
        let shared = shapes.stops.len()..columns.len();
        columns.extend([one.as_slice(), speed.as_slice()]);
        columns.extend(behind.iter().map(Vec::as_slice));
        Some(Self { gaps, bank: Bank::new(rows, &columns), shared })
    }

    /// Returns the best gaps for the index of a law's main travel.
    fn best(&self, travel: usize) -> impl Iterator<Item = Gap> {
        let mut work = Workspace::default();
        let shared = self.shared.clone();
        let asymmetry = shared.end..shared.end + 2;
        let beside: Vec<usize> = [travel].into_iter().chain(shared.clone()).collect();
        let with_asymmetry: Vec<usize> = beside.iter().copied().chain(asymmetry.clone()).collect();
        let in_place: Vec<usize> = shared.chain(asymmetry.clone()).collect();
        let mut found: Vec<usize> = Vec::new();
        for law in [beside, with_asymmetry, in_place] {
            let mut error = |gap: usize| {
                let set: Vec<usize> = law.iter().copied().chain([asymmetry.end + gap]).collect();
                self.bank.error(&set, &mut work)
            };
            let errors: Vec<f64> = (0..self.gaps.len()).map(&mut error).collect();
            found.extend((0..errors.len()).min_by(|a, b| errors[*a].total_cmp(&errors[*b])));
        }
        found.sort_unstable();
        found.dedup();
        found.into_iter().map(|gap| self.gaps[gap])
    }
}

pub(super) fn backlash(context: &Context) -> Vec<Columns> {
    let width = context.shapes.widths[1];
    let variant = |found: Gap| {
        let Gap { gap, travel } = found;
        let behind = Regressor::from([Factor::StopBehindGap { gap, travel }]);
        let falling = behind.clone().times(Factor::Falling { velocity: width });
        plain(Detail::gap(found), vec![behind, falling])
    };
    let gaps = context.waves.gaps.iter().flat_map(|gaps| gaps.best(context.travel));
    gaps.map(variant).collect()
}

//! Backlash: after a reversal the joint travels a gap before friction builds up.
//!
//! The friction of a joint with a gap is a stop operator of the play operator of its position. Gap and travel enter
//! nonlinearly, so a grid of both is computed, and the pairs that explain most beside the law become variants.

use super::{Columns, Context};
use crate::bank::{Bank, Workspace};
use crate::law::product;
use crate::operator::{play, stop};
use rayon::prelude::*;

/// Number of gaps in the grid.
const GAPS: usize = 6;

/// Largest gap as a share of the swing of a run.
const LARGEST_GAP: f64 = 0.1;

/// Every how many travels of the laws one is in the grid.
const TRAVEL_STRIDE: usize = 3;

/// Number of variants.
const VARIANTS: usize = 2;

pub(super) fn backlash(context: &Context) -> Vec<Columns> {
    let rows = context.rows;
    if !rows.has_position {
        return Vec::new();
    }
    let (low, high) = (0.3 * context.shapes.travels[0], LARGEST_GAP * rows.swing);
    let ratio = (high / low).max(1.0).powf(1.0 / (GAPS - 1) as f64);
    let gaps: Vec<f64> = (0..GAPS).map(|at| low * ratio.powi(at as i32)).collect();
    let pairs: Vec<(f64, f64, Vec<f64>)> = gaps
        .par_iter()
        .flat_map_iter(|gap| {
            let moved = play(&rows.position, &rows.runs, 0.5 * gap);
            let travels = context.shapes.travels.iter().step_by(TRAVEL_STRIDE).copied();
            travels.map(|travel| (*gap, travel, stop(&moved, &rows.runs, travel))).collect::<Vec<_>>()
        })
        .collect();
    let law = [context.stop(), rows.smooth_velocity.as_slice()];
    let rigid = context.shapes.rigid.iter().map(Vec::as_slice);
    let columns: Vec<&[f64]> =
        law.into_iter().chain(rigid).chain(pairs.iter().map(|(_, _, column)| column.as_slice())).collect();
    let first = columns.len() - pairs.len();
    let bank = Bank::new(rows, &columns);
    let mut work = Workspace::default();
    let mut scored: Vec<(f64, usize)> = (0..pairs.len())
        .map(|pair| {
            let set: Vec<usize> = (0..first).chain([first + pair]).collect();
            (bank.error(&set, &mut work), pair)
        })
        .collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    let variant = |(_, pair): &(f64, usize)| {
        let (gap, travel, column) = &pairs[*pair];
        let falling = product(column, &context.shapes.falls[1]);
        Columns {
            detail: format!("gap {gap:.3e}, travel {travel:.3e}"),
            columns: vec![column.clone(), falling],
            ..Columns::default()
        }
    };
    scored.iter().take(VARIANTS).map(variant).collect()
}

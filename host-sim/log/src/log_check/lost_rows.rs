//! Single rows that are lost although the clock runs on: a log without a clock, or a clock that counts the rows that were kept.
//!
//! Where a row is lost, the position travels twice as far as in the rows beside it, where two are lost three times. The travels
//! are then whole multiples of one another. The clock is set forward by the rows that are missing. At low speeds lost rows do
//! not show, and do little harm.

use super::LogFindingKind;
use super::finding::LogFinding;
use super::position_jump::{speed_beside, steps};
use super::wrap::is_velocity_derived;
use crate::motion::quantum;
use crate::statistics::median_step;
use crate::{Dataset, Run, segments};
use compensator_core::quantity::Quantity;

/// Minimum travel of a row that shows whether rows are lost, in steps of the position; and of a row whose ratio must be whole.
const MIN_TRAVEL_STEPS: f64 = 3.0;
const MIN_WHOLE_STEPS: f64 = 6.0;

/// Maximum distance of a ratio of travels from a whole number, and largest number.
const MAX_FRACTION: f64 = 0.25;
const MAX_RATIO: f64 = 4.0;

/// Minimum ratio of a slow row, whose travel is rounded to a step.
const MIN_SLOW_RATIO: f64 = 1.6;

/// Minimum share of whole ratios, and of those above 1; and minimum number of the latter.
const MIN_WHOLE_SHARE: f64 = 0.93;
const MIN_LOST_SHARE: f64 = 0.01;
const MIN_LOST: usize = 20;

/// Maximum difference of two steps of a clock that counts rows, relative to the step.
const MAX_UNEVEN: f64 = 0.01;

/// Finds rows that are lost, and sets the clock forward there if `correct` is true.
pub fn lost_rows(mut data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let Some(lost) = lost(&data) else { return (data, Vec::new()) };
    let count: usize = lost.iter().flatten().map(|(_, rows)| rows).sum();
    let (name, places) = (Quantity::Position.name(data.joint), lost.iter().flatten().count());
    let done = if correct { "The clock is set forward there." } else { "Nothing is changed." };
    let words = format!(
        "At {places} rows {name} travels two or more times as far as in the rows beside them: {count} rows are lost, and the \
             clock does not show it. {done}"
    );
    let finding = LogFindingKind::TimeJump
        .finding(&["time_s", name], count as f64, "rows", words)
        .corrected(correct);
    if correct {
        let is_derived = is_velocity_derived(&data);
        for (run, lost) in data.runs.iter_mut().zip(&lost) {
            set_forward(run, lost);
            if is_derived {
                run.derive_velocity();
            }
        }
    }
    (data, vec![finding])
}

fn set_forward(run: &mut Run, lost: &[(usize, usize)]) {
    let step = median_step(&run.time_s).unwrap_or_default();
    let mut lost = lost.iter().peekable();
    let mut missing = 0;
    for (row, time_s) in run.time_s.iter_mut().enumerate() {
        if let Some((_, rows)) = lost.next_if(|(at, _)| *at == row) {
            missing += rows;
        }
        *time_s += missing as f64 * step;
    }
}

/// Returns the rows of each run before which rows are lost, with their number.
fn lost(data: &Dataset) -> Option<Vec<Vec<(usize, usize)>>> {
    let positions = data.columns_of(Quantity::Position)?;
    let may_be_lost =
        positions.iter().map(|position| long_steps(position)).sum::<usize>() >= MIN_LOST;
    if !may_be_lost || !data.runs.iter().all(counts_rows) {
        return None;
    }
    let quantum = quantum(positions.iter().copied());
    let least = MIN_TRAVEL_STEPS * quantum;
    let (mut all, mut whole, mut clear, mut found) = (0usize, 0usize, 0usize, Vec::new());
    for (run, position) in data.runs.iter().zip(&positions) {
        let mut lost = Vec::new();
        for rows in segments(run) {
            let steps = steps(run, position, rows);
            for (at, step) in steps.iter().enumerate().filter(|(_, step)| step.count() == 1) {
                let beside = speed_beside(&steps, at) * step.time_s;
                let ratio = step.travel / beside;
                if beside.abs() <= least
                    || beside == 0.0
                    || !(0.0..=MAX_RATIO + 0.5).contains(&ratio)
                {
                    continue;
                }
                let is_whole = (ratio - ratio.round()).abs() < MAX_FRACTION && ratio > 0.5;
                if beside.abs() > MIN_WHOLE_STEPS * quantum {
                    all += 1;
                    whole += usize::from(is_whole);
                    clear += usize::from(is_whole && ratio > 1.5);
                } else if ratio < MIN_SLOW_RATIO {
                    continue;
                }
                if ratio > 1.5 {
                    lost.push((step.row, ratio.round() as usize - 1));
                }
            }
        }
        found.push(lost);
    }
    let is_lost = clear >= MIN_LOST
        && clear as f64 >= MIN_LOST_SHARE * all as f64
        && whole as f64 >= MIN_WHOLE_SHARE * all as f64;
    is_lost.then_some(found)
}

/// Returns the number of rows that travel clearly farther than both rows beside them.
fn long_steps(position: &[f64]) -> usize {
    let travel = |pair: &[f64]| (pair[1] - pair[0]).abs();
    let is_long = |rows: &&[f64]| {
        let [before, here, after] = [&rows[..2], &rows[1..3], &rows[2..]].map(travel);
        before.min(after) > 0.0 && here > 1.5 * before.max(after)
    };
    position.windows(4).filter(is_long).count()
}

/// Returns true if the clock of a run has even steps, as that of counted rows.
fn counts_rows(run: &Run) -> bool {
    let Some(step) = median_step(&run.time_s) else { return false };
    let uneven = |pair: &[f64]| ((pair[1] - pair[0]) / step - 1.0).abs() > MAX_UNEVEN;
    run.time_s.windows(2).filter(|pair| uneven(pair)).count() * 100 < run.len()
}

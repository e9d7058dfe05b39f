//! Rows of two sources in one log: two drives or two publishers that wrote to one file, in turn.
//!
//! The position then changes between two courses, each of which is smooth. Each row is given to the course whose last value is
//! nearer. Both together travel much less than the column, and rows of both are mixed.

use super::column::telling_column;
use super::log::Log;
use super::suspicion::Suspicion;
use super::{LogFindingKind, header};
use crate::setting::Setting;
use compensator_core::quantity::Quantity;

/// Maximum travel of both courses, as a share of the travel of the column.
const MAX_TRAVEL_SHARE: f64 = 0.2;

/// Minimum share of the rows of the rarer course, and of the rows that change the course.
const MIN_ROWS_SHARE: f64 = 0.1;

/// Rows at the start of a run in which both courses occur.
const BEGIN_ROWS: usize = 8;

/// Returns the reason to refuse a log whose rows are of two sources.
pub fn suspicion(log: &Log) -> Option<Suspicion> {
    let data = log.data;
    let has_position = data.runs.iter().all(|run| run.get(Quantity::Position).is_some());
    let of = if has_position { Quantity::Position } else { Quantity::Velocity };
    let (mut courses, mut travel, mut both) = (Vec::new(), 0.0, 0.0);
    for run in &data.runs {
        let values = run.get(of)?;
        let begin = &values[..values.len().min(BEGIN_ROWS)];
        let far = |value: &&f64| (*value - values[0]).abs();
        let farthest = begin.iter().max_by(|one, other| far(one).total_cmp(&far(other)))?;
        let (mut last, mut before) = ([values[0], *farthest], values[0]);
        let mut course = Vec::new();
        for value in values {
            let distances = last.map(|last| (value - last).abs());
            let nearer = usize::from(distances[1] < distances[0]);
            both += distances[nearer];
            travel += (value - before).abs();
            (last[nearer], before) = (*value, *value);
            course.push(nearer == 1);
        }
        courses.push(course);
    }
    let count = |of: &dyn Fn(&Vec<bool>) -> usize| courses.iter().map(of).sum::<usize>() as f64;
    let rows = count(&|course| course.len());
    let second = count(&|course| course.iter().filter(|second| **second).count());
    let changes = count(&|course| course.windows(2).filter(|pair| pair[0] != pair[1]).count());
    let are_mixed = changes.min(second).min(rows - second) > MIN_ROWS_SHARE * rows;
    if !are_mixed || both > MAX_TRAVEL_SHARE * travel {
        return None;
    }
    let name = of.name(data.joint);
    let found = format!(
        "rows of two sources: {name} changes {changes} times between two courses (column {})",
        header(data, name)
    );
    let expected = match telling_column(data, |place| courses[place.run][place.row]) {
        Some(pairs) => pairs.map(|pair| Setting::Where.suggested(pair)).join(" or "),
        None => "a file for each source".into(),
    };
    Some(Suspicion::new(LogFindingKind::TwoSources, &[name], found, expected))
}

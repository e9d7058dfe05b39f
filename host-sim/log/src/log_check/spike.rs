//! Spikes of the torque or the velocity: many single rows far outside the range of the others, as from a disturbed sensor line.
//!
//! A squared error weighs a spike of ten times the torque as a hundred rows, so a few percent of spikes decide a fit.
//! Unlike a failed reading ([`super::outlier`]) a spike may be in every fifth row, so that the range of the column is the
//! range of the spikes. Each value is therefore compared with the median of its neighbours, which is a torque as long as
//! fewer than half of them are spikes. A step of the torque is not a spike, because the median steps with it.
//!
//! A row with a spike keeps its motion and gets weight 0 ([`crate::Run::torque_spikes`]). Its torque becomes the
//! median of its neighbours with the noise of a row nearby, because estimates such as that of the noise use every torque.
//! A spike of the velocity has no motion to keep, and its row is left out.

use super::finding::{LogFinding, LogFindingKind};
use super::rows::leave_out;
use crate::dataset::Place;
use crate::number::figure;
use crate::statistics::{median, quantile};
use crate::{Dataset, Run, segments};
use compensator_core::quantity::Quantity;
use std::ops::{Range, RangeInclusive};

/// Rows on either side of a row whose median is compared with it. Of nine rows with 20 % of spikes, five are spikes of
/// one sign in one row of 500.
const NEIGHBOURS: usize = 4;

/// Minimum distance of a spike from the median of its neighbours, in ranges of these medians. No torque crosses its own
/// range for a single row, except in a shock.
const MIN_RANGES: f64 = 1.0;

/// The same in standard deviations of the noise, for a torque that is constant but for noise.
const MIN_DEVIATIONS: f64 = 10.0;

/// Minimum share of the rows. Fewer spikes of this size hardly change a fit, and shocks are as rare.
pub const MIN_SHARE: f64 = 5e-3;

/// Maximum share of the rows. With more, the median of the neighbours is unreliable.
const MAX_SHARE: f64 = 0.3;

/// Minimum number of spikes.
const MIN_SPIKES: usize = 10;

/// Maximum share of the spikes that are followed by another, beyond the share of spikes in all rows. Shocks last several
/// rows.
const MAX_FOLLOWED_SHARE: f64 = 0.2;

/// Maximum number of rows, beyond the neighbours, among which a replaced torque gets its noise.
const FAR_ROWS: usize = 50;

/// Median of the magnitude of a standard normal variable.
const NORMAL_MEDIAN: f64 = 0.6745;

/// Finds the spikes of torque and velocity. If `correct` is true, sets the weights of the former to 0 and leaves out the
/// rows of the latter.
pub fn spikes(mut data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let mut findings = Vec::new();
    // No joint crosses its range of speeds for a single row, so a few spikes of the velocity suffice.
    if let Some(found) = Spikes::find(&data, |run| &run.velocity, 0.0) {
        findings.push(found.finding(&data, Quantity::Velocity, correct, "their rows are left out"));
        let rows = found.runs.iter().enumerate().flat_map(|(run, of)| {
            let rows = (0..of.is_spike.len()).filter(|row| of.is_spike[*row]);
            rows.map(move |row| Place { run, row })
        });
        if correct {
            leave_out(&mut data, &rows.collect());
        }
    }
    if let Some(found) = Spikes::find(&data, |run| &run.torque, MIN_SHARE) {
        let done = "their rows have weight 0 in every fit and error; their motion is used";
        findings.push(found.finding(&data, Quantity::Torque, correct, done));
        for (run, spikes) in data.runs.iter_mut().zip(&found.runs).filter(|_| correct) {
            if spikes.is_spike.contains(&true) {
                replace(run, spikes);
            }
        }
    }
    (data, findings)
}

/// Replaces the torque of the rows with a spike.
fn replace(run: &mut Run, spikes: &RunSpikes) {
    let RunSpikes { is_spike, medians } = spikes;
    run.torque_spikes = is_spike.iter().map(|spike| f64::from(u8::from(*spike))).collect();
    let measured = run.torque.clone();
    let noise = |row: usize| {
        // The noise of a row whose own noise the medians of this row do not contain.
        let after = (row + NEIGHBOURS + 1..measured.len()).take(FAR_ROWS);
        let before = (0..row.saturating_sub(NEIGHBOURS)).rev().take(FAR_ROWS);
        let donor = after.chain(before).find(|at| !is_spike[*at]);
        donor.map_or(0.0, |at| measured[at] - medians[at])
    };
    for row in (0..measured.len()).filter(|row| is_spike[*row]) {
        run.torque[row] = medians[row] + noise(row);
    }
}

/// The spikes of a run, row by row.
struct RunSpikes {
    is_spike: Vec<bool>,
    /// The medians of the neighbours.
    medians: Vec<f64>,
}

impl RunSpikes {
    fn new(column: &[f64], medians: Vec<f64>, limits: &Limits) -> Self {
        let is_spike = column.iter().zip(&medians).map(|(value, median)| {
            (value - median).abs() > limits.least || !limits.usual.contains(value)
        });
        Self { is_spike: is_spike.collect(), medians }
    }
}

/// What makes a value a spike, in the unit of the column.
struct Limits {
    /// Minimum distance from the median of the neighbours.
    least: f64,
    /// Values beyond are spikes whatever their neighbours are: where most of these are spikes, their median is one.
    usual: RangeInclusive<f64>,
}

impl Limits {
    /// Returns the limits of columns by the medians of the neighbours; `None` for constant columns.
    fn new(columns: &[&Vec<f64>], medians: &[Vec<f64>]) -> Option<Self> {
        let pairs = columns.iter().copied().flatten().zip(medians.iter().flatten());
        let mut sizes: Vec<f64> = pairs.map(|(value, median)| (value - median).abs()).collect();
        let noise = median(&mut sizes)? / NORMAL_MEDIAN;
        let mut levels: Vec<f64> = medians.iter().flatten().copied().collect();
        let (low, high) = (quantile(&mut levels, 0.01)?, quantile(&mut levels, 0.99)?);
        let least = (MIN_RANGES * (high - low)).max(MIN_DEVIATIONS * noise);
        (least > 0.0).then_some(Self { least, usual: low - least..=high + least })
    }
}

/// The spikes of a log.
struct Spikes {
    runs: Vec<RunSpikes>,
    count: usize,
    /// Minimum distance of a spike, in the unit of the column.
    least: f64,
}

impl Spikes {
    fn finding(&self, data: &Dataset, of: Quantity, correct: bool, done: &str) -> LogFinding {
        let name = of.name(data.joint);
        let share = self.count as f64 / data.rows as f64;
        let unit = match of {
            Quantity::Velocity => data.joint.velocity_unit(),
            _ => data.joint.torque_unit(),
        };
        let words = format!(
            "{} values of {name} ({} % of the rows) are spikes, at least {} {unit} from the median of the rows beside \
                 them: {}.",
            self.count,
            figure(100.0 * share),
            figure(self.least),
            if correct { done } else { "left in, as asked" }
        );
        LogFindingKind::Outlier.finding(&[name], share, "of the rows", words).corrected(correct)
    }

    /// Returns the spikes of a column, if they are at least `least_share` of the rows.
    fn find(data: &Dataset, of: fn(&Run) -> &Vec<f64>, least_share: f64) -> Option<Self> {
        let parts: Vec<Vec<Range<usize>>> = data.runs.iter().map(segments).collect();
        let columns: Vec<&Vec<f64>> = data.runs.iter().map(of).collect();
        let each = || columns.iter().zip(&parts);
        let first: Vec<Vec<f64>> = each().map(|(of, parts)| medians(of, parts, None)).collect();
        let limits = Limits::new(&columns, &first)?;
        let by_first =
            columns.iter().zip(first).map(|(of, first)| RunSpikes::new(of, first, &limits));
        let by_first: Vec<RunSpikes> = by_first.collect();
        // Without a spike the second medians would be the first ones.
        if !by_first.iter().any(|run| run.is_spike.contains(&true)) {
            return None;
        }
        let runs = each().zip(&by_first).map(|((of, parts), first)| {
            RunSpikes::new(of, medians(of, parts, Some(&first.is_spike)), &limits)
        });
        let runs: Vec<RunSpikes> = runs.collect();
        let count = runs.iter().flat_map(|run| &run.is_spike).filter(|spike| **spike).count();
        let share = count as f64 / data.rows.max(1) as f64;
        let pairs = runs.iter().flat_map(|run| run.is_spike.windows(2));
        let followed = pairs.filter(|pair| pair[0] && pair[1]).count() as f64 / count.max(1) as f64;
        let is_many = count >= MIN_SPIKES && (least_share..MAX_SHARE).contains(&share);
        let is_found = is_many && followed < share + MAX_FOLLOWED_SHARE;
        is_found.then_some(Self { runs, count, least: limits.least })
    }
}

/// Returns for each row of a run the median of the rows around it in its segment that are not spikes.
fn medians(column: &[f64], parts: &[Range<usize>], is_spike: Option<&[bool]>) -> Vec<f64> {
    parts.iter().flat_map(|rows| medians_of_segment(column, rows, is_spike)).collect()
}

/// Returns these medians of a segment. If all rows around one are spikes, more are taken; if the whole segment is, the torque
/// itself is the median.
fn medians_of_segment(torque: &[f64], rows: &Range<usize>, is_spike: Option<&[bool]>) -> Vec<f64> {
    let mut near = Vec::new();
    let median = |row: usize| {
        let mut reach = NEIGHBOURS;
        loop {
            let around = row.saturating_sub(reach).max(rows.start)..(row + reach + 1).min(rows.end);
            let is_whole = around == *rows;
            near.clear();
            match is_spike {
                None => near.extend_from_slice(&torque[around]),
                Some(spikes) => near.extend(around.filter(|at| !spikes[*at]).map(|at| torque[at])),
            }
            if let Some(all) = near.as_chunks_mut::<9>().0.first_mut() {
                break median_of_nine(all);
            }
            match near.is_empty() {
                false => break median(&mut near).unwrap_or_default(),
                true if is_whole => break torque[row],
                true => reach *= 2,
            }
        }
    };
    rows.clone().map(median).collect()
}

/// Returns the median of nine values by a fixed network of comparisons (Devillard 1998), which is several times as fast as a
/// selection.
fn median_of_nine(values: &mut [f64; 9]) -> f64 {
    const COMPARISONS: [(usize, usize); 19] = [
        (1, 2),
        (4, 5),
        (7, 8),
        (0, 1),
        (3, 4),
        (6, 7),
        (1, 2),
        (4, 5),
        (7, 8),
        (0, 3),
        (5, 8),
        (4, 7),
        (3, 6),
        (1, 4),
        (2, 5),
        (4, 7),
        (4, 2),
        (6, 4),
        (4, 2),
    ];
    for (low, high) in COMPARISONS {
        let (a, b) = (values[low], values[high]);
        (values[low], values[high]) = (a.min(b), a.max(b));
    }
    values[4]
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: usize = 4000;

    /// Returns a whole number below `end`.
    fn random(row: usize, end: u64) -> u64 {
        let mut state =
            (row as u64).wrapping_add(0x9e37_79b9_7f4a_7c15).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        state ^= state >> 27;
        state = state.wrapping_mul(0x94d0_49bb_1331_11eb);
        (state ^ (state >> 31)) % end
    }

    /// Coulomb friction of 0.5 Nm with viscous friction and noise, to which `spike` adds.
    fn log(spike: impl Fn(usize) -> f64) -> Dataset {
        let names = ["time_s", "velocity_rad_s", "torque_nm"].map(str::to_owned);
        let time: Vec<f64> = (0..ROWS).map(|row| 0.01 * row as f64).collect();
        let velocity: Vec<f64> = time.iter().map(|t| (3.0 * t + 0.1).sin()).collect();
        let torque = |row: usize| {
            let noise = 1e-3 * random(row + ROWS, 13) as f64;
            0.5 * velocity[row].signum() + 0.1 * velocity[row] + noise + spike(row)
        };
        let torque: Vec<f64> = (0..ROWS).map(torque).collect();
        Dataset::from_columns(&names, [("a".to_owned(), vec![time, velocity.clone(), torque])])
            .expect("columns")
    }

    /// Spikes of `size` Nm of random sign in `percent` of the rows.
    fn white(percent: u64, size: f64) -> impl Fn(usize) -> f64 {
        move |row| {
            let sign = if random(row, 2) == 0 { 1.0 } else { -1.0 };
            if random(row + 7 * ROWS, 100) < percent { sign * size } else { 0.0 }
        }
    }

    #[test]
    fn spikes_of_any_share_and_size_have_no_weight() {
        for (percent, size) in [(1, 3.0), (5, 3.0), (5, 12.0), (20, 3.0), (20, 12.0)] {
            let spike = white(percent, size);
            let planted = (0..ROWS).filter(|row| spike(*row) != 0.0).count();
            let (data, findings) = spikes(log(&spike), true);
            assert_eq!(findings.len(), 1, "{percent} % of {size} Nm");
            let run = &data.runs[0];
            let is_masked = |row: usize| run.torque_spikes[row] > 0.0;
            let missed = (0..ROWS).filter(|row| spike(*row) != 0.0 && !is_masked(*row)).count();
            let wrong = (0..ROWS).filter(|row| spike(*row) == 0.0 && is_masked(*row)).count();
            assert!(missed * 100 <= planted, "{missed} of {planted} are missed");
            assert!(wrong * 100 <= planted, "{wrong} beside {planted}");
            let clean = log(|_| 0.0);
            let pairs = run.torque.iter().zip(&clean.runs[0].torque).zip(&run.torque_spikes);
            assert!(
                pairs
                    .filter(|(_, spike)| **spike == 0.0)
                    .all(|((torque, clean), _)| torque == clean)
            );
        }
    }

    #[test]
    fn spikes_with_clean_log_shocks_or_blocks_returns_log_unchanged() {
        let shock = |row: usize| if row % 200 < 3 { 4.0 } else { 0.0 };
        let block = |row: usize| if row % 100 < 20 { 4.0 } else { 0.0 };
        for spike in [&(|_| 0.0) as &dyn Fn(usize) -> f64, &shock, &block] {
            let (data, findings) = spikes(log(spike), true);
            assert_eq!(findings, []);
            assert_eq!(data.runs, log(spike).runs);
        }
    }

    #[test]
    fn median_of_nine_of_any_order_is_the_fifth() {
        for round in 0..500 {
            let mut values = [0.0; 9];
            for (at, value) in values.iter_mut().enumerate() {
                *value = random(9 * round + at, 12) as f64;
            }
            let mut sorted = values;
            sorted.sort_by(f64::total_cmp);
            assert_eq!(median_of_nine(&mut values), sorted[4], "{sorted:?}");
        }
    }

    #[test]
    fn spikes_left_in_are_reported_only() {
        let (data, findings) = spikes(log(white(20, 12.0)), false);
        assert!(!findings[0].corrected && spikes(log(white(20, 12.0)), true).1[0].corrected);
        crate::message::check("checks", "spikes left in", &findings[0].in_words, &[]);
        assert_eq!(data.runs, log(white(20, 12.0)).runs);
    }

    #[test]
    fn spikes_of_velocity_are_left_out() {
        let spoiled = || {
            let mut data = log(|_| 0.0);
            (0..ROWS)
                .filter(|row| row % 250 == 7)
                .for_each(|row| data.runs[0].velocity[row] += 4.0);
            data
        };
        let (data, findings) = spikes(spoiled(), true);
        assert_eq!(findings.len(), 1);
        assert_eq!(findings[0].columns, ["velocity_rad_s"]);
        assert!((findings[0].value - 16.0 / ROWS as f64).abs() < 1e-12, "{findings:?}");
        assert_eq!((data.rows, data.runs[0].len()), (ROWS - 16, ROWS - 16));
        assert!(data.runs[0].velocity.iter().all(|velocity| velocity.abs() < 1.1));
        assert_eq!(spikes(spoiled(), false).0.runs, spoiled().runs);
    }
}

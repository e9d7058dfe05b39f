//! Cells without a value, filled.
//!
//! A slow channel says something in every hundredth row, and a tool that merges channels by their stamps writes a row for
//! each of them. What was measured in between nobody knows; what is likely depends on what it is. A quantity of a machine
//! (a temperature, a pressure, a position) goes from one value to the next and is interpolated in time; a
//! setting (a gain, a code, anything with a handful of values) jumps, and is held. Before its first and behind its last value
//! either is held. The torque is never filled: it is what a model is judged by.

/// More values than this are no settings.
const FEW: usize = 10;

/// How a column is filled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fill {
    Interpolate,
    Hold,
}

impl Fill {
    /// As the end of a sentence.
    pub fn words(self) -> &'static str {
        match self {
            Self::Interpolate => "interpolated in time between its values",
            Self::Hold => "held from each of its values to the next",
        }
    }

    /// What suits a column that is no known quantity, by its values; NaN are none.
    pub fn suiting<'a>(values: impl Iterator<Item = &'a f64>) -> Self {
        let mut distinct: Vec<f64> = Vec::new();
        for value in values.filter(|value| !value.is_nan()) {
            if !distinct.contains(value) {
                if distinct.len() == FEW {
                    return Self::Interpolate;
                }
                distinct.push(*value);
            }
        }
        Self::Hold
    }
}

/// Fills the NaN of a column, given the rows' times, and says how many there were; where nothing else is there, none is
/// filled. Holes between values further apart than `reach` (s) stay.
pub(super) fn fill(time: &[f64], values: &mut [f64], how: Fill, reach: f64) -> usize {
    let Some(first) = values.iter().position(|value| !value.is_nan()) else { return 0 };
    let mut filled = 0;
    let mut last = first;
    if reach.is_infinite() {
        let value = values[first];
        values[..first].fill(value);
        filled += first;
    }
    for row in first + 1..values.len() {
        if values[row].is_nan() {
            continue;
        }
        let (before, now) = (values[last], values[row]);
        let span = time[row] - time[last];
        if row > last + 1 && span <= reach {
            for at in last + 1..row {
                let share = if span > 0.0 { (time[at] - time[last]) / span } else { 1.0 };
                values[at] = match how {
                    Fill::Hold => before,
                    Fill::Interpolate => before + share * (now - before),
                };
            }
            filled += row - last - 1;
        }
        last = row;
    }
    if reach.is_infinite() {
        let value = values[last];
        filled += values.len() - last - 1;
        values[last + 1..].fill(value);
    }
    filled
}

#[cfg(test)]
mod tests {
    use super::*;

    const NO: f64 = f64::NAN;

    #[test]
    fn quantities_are_interpolated_and_settings_held() {
        let time = [0.0, 1.0, 2.0, 4.0, 5.0, 6.0];
        let column = [NO, 10.0, NO, NO, 40.0, NO];
        let mut values = column;
        assert_eq!(fill(&time, &mut values, Fill::Interpolate, f64::INFINITY), 4);
        assert_eq!(values, [10.0, 10.0, 17.5, 32.5, 40.0, 40.0]);
        let mut values = column;
        fill(&time, &mut values, Fill::Hold, f64::INFINITY);
        assert_eq!(values, [10.0, 10.0, 10.0, 10.0, 40.0, 40.0]);
        assert_eq!(fill(&time, &mut [NO; 6], Fill::Hold, f64::INFINITY), 0);
    }

    #[test]
    fn what_is_out_of_reach_stays_empty() {
        let time = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        let mut values = [NO, 1.0, NO, 3.0, NO, NO];
        assert_eq!(fill(&time, &mut values, Fill::Interpolate, 2.0), 1);
        assert_eq!(values[2], 2.0);
        assert!(values[0].is_nan() && values[5].is_nan());
    }

    #[test]
    fn a_handful_of_values_are_settings() {
        assert_eq!(Fill::suiting([1.0, NO, 2.0, 1.0].iter()), Fill::Hold);
        let many: Vec<f64> = (0..20).map(f64::from).collect();
        assert_eq!(Fill::suiting(many.iter()), Fill::Interpolate);
    }
}

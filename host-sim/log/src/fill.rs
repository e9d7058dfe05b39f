//! Filling of missing values.
//!
//! A slow channel has a value in every hundredth row, and a tool that merges channels by their stamps writes a row for
//! each stamp. The values between are unknown; the likely ones depend on the column. A physical quantity (temperature,
//! pressure, position) changes continuously and is interpolated in time. A setting (a gain, a code, anything with a few
//! distinct values) changes in steps, so its last value is held. Before the first and after the last value, both are
//! held. The torque is never filled: models are evaluated on it.

/// Maximum number of distinct values of a setting.
const MAX_SETTING_VALUES: usize = 10;

/// How a column is filled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fill {
    Interpolate,
    Hold,
}

impl Fill {
    /// Describes the method, as the end of a sentence.
    pub fn description(self) -> &'static str {
        match self {
            Self::Interpolate => "interpolated in time between its values",
            Self::Hold => "held from each of its values to the next",
        }
    }

    /// Returns the method for a column of no known quantity, by its values. NaN values are ignored.
    pub fn for_values<'a>(values: impl Iterator<Item = &'a f64>) -> Self {
        let mut distinct: Vec<f64> = Vec::new();
        for value in values.filter(|value| !value.is_nan()) {
            if !distinct.contains(value) {
                if distinct.len() == MAX_SETTING_VALUES {
                    return Self::Interpolate;
                }
                distinct.push(*value);
            }
        }
        Self::Hold
    }
}

/// Fills the NaN values of a column and returns their number. A column of only NaN is left unchanged. `max_span_s` is
/// the maximum distance of two values between which rows are filled.
pub(super) fn fill(time: &[f64], values: &mut [f64], method: Fill, max_span_s: f64) -> usize {
    let Some(first) = values.iter().position(|value| !value.is_nan()) else { return 0 };
    let mut filled = 0;
    let mut last = first;
    if max_span_s.is_infinite() {
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
        if row > last + 1 && span <= max_span_s {
            for at in last + 1..row {
                let share = if span > 0.0 { (time[at] - time[last]) / span } else { 1.0 };
                values[at] = match method {
                    Fill::Hold => before,
                    Fill::Interpolate => before + share * (now - before),
                };
            }
            filled += row - last - 1;
        }
        last = row;
    }
    if max_span_s.is_infinite() {
        let value = values[last];
        filled += values.len() - last - 1;
        values[last + 1..].fill(value);
    }
    filled
}

#[cfg(test)]
mod tests {
    use super::*;

    const MISSING: f64 = f64::NAN;

    #[test]
    fn fill_interpolates_quantities_and_holds_settings() {
        let time = [0.0, 1.0, 2.0, 4.0, 5.0, 6.0];
        let column = [MISSING, 10.0, MISSING, MISSING, 40.0, MISSING];
        let mut values = column;
        assert_eq!(fill(&time, &mut values, Fill::Interpolate, f64::INFINITY), 4);
        assert_eq!(values, [10.0, 10.0, 17.5, 32.5, 40.0, 40.0]);
        let mut values = column;
        fill(&time, &mut values, Fill::Hold, f64::INFINITY);
        assert_eq!(values, [10.0, 10.0, 10.0, 10.0, 40.0, 40.0]);
        assert_eq!(fill(&time, &mut [MISSING; 6], Fill::Hold, f64::INFINITY), 0);
    }

    #[test]
    fn fill_with_distant_values_leaves_rows_missing() {
        let time = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        let mut values = [MISSING, 1.0, MISSING, 3.0, MISSING, MISSING];
        assert_eq!(fill(&time, &mut values, Fill::Interpolate, 2.0), 1);
        assert_eq!(values[2], 2.0);
        assert!(values[0].is_nan() && values[5].is_nan());
    }

    #[test]
    fn for_values_with_few_distinct_values_returns_hold() {
        assert_eq!(Fill::for_values([1.0, MISSING, 2.0, 1.0].iter()), Fill::Hold);
        let many: Vec<f64> = (0..20).map(f64::from).collect();
        assert_eq!(Fill::for_values(many.iter()), Fill::Interpolate);
    }
}

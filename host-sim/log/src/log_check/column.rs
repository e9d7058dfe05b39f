//! A column of a log, run by run, with its name and unit; and the robust statistics the checks share.

use crate::dataset::Place;
use crate::setting::shell_word;
use crate::statistics::quantile_range;
use crate::{Dataset, contract};
use compensator_core::quantity::Quantity;

/// A numeric column of a log.
pub struct Column<'a> {
    pub name: String,
    pub unit: String,
    pub quantity: Option<Quantity>,
    /// The values of each run.
    pub runs: Vec<&'a [f64]>,
}

impl Column<'_> {
    /// Returns all values.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        self.runs.iter().flat_map(|run| run.iter().copied())
    }

    /// Returns all pairs of neighbouring values within runs.
    pub fn pairs(&self) -> impl Iterator<Item = (f64, f64)> {
        self.runs.iter().flat_map(|run| run.windows(2).map(|w| (w[0], w[1])))
    }

    /// Returns true if the column is position, velocity or acceleration of the joint, or the position beyond its gear.
    pub fn is_motion(&self) -> bool {
        use Quantity::{Acceleration, Position, Velocity};
        matches!(self.quantity, Some(Position | Velocity | Acceleration))
            || contract::is_joint_position(&self.name)
    }

    /// Returns the distance between the quantiles `share` and `1 - share`.
    pub fn range(&self, share: f64) -> f64 {
        let mut all: Vec<f64> = self.values().collect();
        quantile_range(&mut all, share)
    }
}

/// Returns every numeric column except time.
pub fn all(data: &Dataset) -> Vec<Column<'_>> {
    let known = [Quantity::Velocity, Quantity::Torque].into_iter().chain(contract::optional());
    let mut columns: Vec<Column> = Vec::new();
    for quantity in known {
        let Some(runs) = data.columns_of(quantity) else { continue };
        let name = quantity.name(data.joint);
        columns.push(Column {
            name: name.into(),
            unit: unit(name),
            quantity: Some(quantity),
            runs,
        });
    }
    for (index, name) in data.covariates.iter().enumerate() {
        let runs = data.runs.iter().map(|run| run.extra[index].as_slice()).collect();
        columns.push(Column { name: name.clone(), unit: unit(name), quantity: None, runs });
    }
    columns
}

/// Returns the unit at the end of a column's name, or "as logged" if there is none.
fn unit(name: &str) -> String {
    const LETTERS: [(&str, &str); 8] = [
        ("_c", "°C"),
        ("_n", "N"),
        ("_m", "m"),
        ("_v", "V"),
        ("_a", "A"),
        ("_w", "W"),
        ("_hz", "Hz"),
        ("_s", "s"),
    ];
    let letter = LETTERS.iter().find(|(end, _)| name.ends_with(end)).map(|(_, unit)| *unit);
    // `bucket_deg_s` is in deg/s, not in seconds.
    let longer = crate::unit_of_name(name).filter(|unit| unit.len() > 1);
    longer.or(letter).unwrap_or("as logged").into()
}

/// Returns `COLUMN=VALUES` for each of two groups of rows, by the first covariate with few values and none in both groups: it
/// tells the groups apart.
pub fn telling_column(data: &Dataset, is_second: impl Fn(Place) -> bool) -> Option<[String; 2]> {
    const MAX_VALUES: usize = 4;
    (0..data.covariates.len()).find_map(|column| {
        let mut values = [Vec::new(), Vec::new()];
        for (index, run) in data.runs.iter().enumerate() {
            for (row, value) in run.extra[column].iter().enumerate() {
                let group = &mut values[usize::from(is_second(Place { run: index, row }))];
                if !group.contains(value) && group.len() <= MAX_VALUES {
                    group.push(*value);
                }
            }
        }
        let is_in_both = values[0].iter().any(|value| values[1].contains(value));
        let name = super::header(data, &data.covariates[column]);
        let pair = |values: &Vec<f64>| {
            let values: Vec<String> = values.iter().map(f64::to_string).collect();
            shell_word(&format!("{name}={}", values.join(",")))
        };
        let are_few = values.iter().all(|group| (1..=MAX_VALUES).contains(&group.len()));
        (are_few && !is_in_both).then(|| [pair(&values[0]), pair(&values[1])])
    })
}

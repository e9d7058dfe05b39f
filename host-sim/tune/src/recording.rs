//! What a master records while a joint moves, and the table that a fit reads.

use compensator_core::quantity::Quantity;
use joint_log::{Cells, JointKind, Table};
use sha2::{Digest, Sha256};

/// Rows that are averaged to one of the table: 1 kHz becomes 200 Hz. Presliding after a reversal takes 20 ms or more, and
/// the noise of the current falls by the root of this number.
pub const ROWS_AVERAGED: usize = 5;

/// What the joint reported at one SYNC. NaN stands for a value that it does not measure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Bus time, s.
    pub time_s: f64,
    /// Position error as the drive computes it: demand less position, rad.
    pub error_rad: f64,
    /// Position, rad.
    pub position_rad: f64,
    /// Velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Torque of the motor at the joint, Nm.
    pub torque_nm: f64,
    /// Side load, N.
    pub radial_force_n: f64,
    /// Pressure difference, Pa.
    pub pressure_diff_pa: f64,
    /// Temperature, deg C.
    pub temperature_c: f64,
    /// Statusword (6041h).
    pub status: u16,
}

impl Row {
    /// Returns the demanded position, rad.
    pub fn demand_rad(&self) -> f64 {
        self.position_rad + self.error_rad
    }
}

/// Rows of one performance of a motion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Name of the motion.
    pub name: String,
    /// The rows in order of time.
    pub rows: Vec<Row>,
}

/// A column of a recording: its quantity, and how it is read.
type Covariate = (Quantity, fn(&Row) -> f64);

const COVARIATES: [Covariate; 3] = [
    (Quantity::RadialForce, |row| row.radial_force_n),
    (Quantity::Pressure, |row| row.pressure_diff_pa),
    (Quantity::Temperature, |row| row.temperature_c),
];

impl Recording {
    /// Returns the duration, s.
    pub fn seconds(&self) -> f64 {
        match (self.rows.first(), self.rows.last()) {
            (Some(first), Some(last)) => last.time_s - first.time_s,
            _ => 0.0,
        }
    }

    /// Returns the mean of a value over each group of rows.
    fn averaged(&self, value: impl Fn(&Row) -> f64) -> Vec<f64> {
        let mean = |rows: &[Row]| rows.iter().map(&value).sum::<f64>() / rows.len() as f64;
        self.rows.chunks_exact(ROWS_AVERAGED).map(mean).collect()
    }
}

/// Returns the recordings as a table, a run each, at a fifth of the rate. A covariate that any row lacks is left out.
pub fn table(recordings: &[Recording]) -> Table {
    let measured = COVARIATES.iter().filter(|(_, value)| {
        recordings.iter().all(|recording| recording.rows.iter().all(|row| value(row).is_finite()))
    });
    let numbers = |value: &dyn Fn(&Row) -> f64| {
        Cells::Numbers(recordings.iter().flat_map(|recording| recording.averaged(value)).collect())
    };
    let names = recordings.iter().enumerate().flat_map(|(at, recording)| {
        let name = format!("{} {}", at + 1, recording.name);
        std::iter::repeat_n(name, recording.rows.len() / ROWS_AVERAGED)
    });
    let mut columns = vec![("run".to_owned(), Cells::Texts(names.collect()))];
    let name = |quantity: Quantity| quantity.name(JointKind::Revolute).to_owned();
    columns.push((name(Quantity::CampaignTime), numbers(&|row| row.time_s)));
    columns.push((name(Quantity::Velocity), numbers(&|row| row.velocity_rad_s)));
    columns.push((name(Quantity::Torque), numbers(&|row| row.torque_nm)));
    columns.push((name(Quantity::Position), numbers(&|row| row.position_rad)));
    columns.extend(measured.map(|(quantity, value)| (name(*quantity), numbers(value))));
    Table { name: "session".into(), columns }
}

/// Returns a recording as a log: CSV with the columns that were measured.
pub fn emit_csv(recording: &Recording) -> String {
    /// A column of the log, and how it is read.
    type Column = (&'static str, fn(&Row) -> f64);
    let columns: [Column; 8] = [
        ("time_s", |row| row.time_s),
        ("velocity_rad_s", |row| row.velocity_rad_s),
        ("torque_nm", |row| row.torque_nm),
        ("position_rad", |row| row.position_rad),
        ("demand_rad", Row::demand_rad),
        ("radial_force_n", |row| row.radial_force_n),
        ("pressure_diff_pa", |row| row.pressure_diff_pa),
        ("temperature_c", |row| row.temperature_c),
    ];
    let rows = &recording.rows;
    let measured: Vec<_> =
        columns.iter().filter(|(_, value)| rows.iter().all(|row| value(row).is_finite())).collect();
    let names: Vec<&str> = measured.iter().map(|(name, _)| *name).collect();
    let mut text = names.join(",") + "\n";
    for row in rows {
        let cells: Vec<String> =
            measured.iter().map(|(_, value)| format!("{:.7}", value(row))).collect();
        text += &(cells.join(",") + "\n");
    }
    text
}

/// Returns the first four bytes of the SHA-256 of all rows: the identity of a session's runs.
pub fn identity(recordings: &[(Recording, String)]) -> u32 {
    let mut digest = Sha256::new();
    for row in recordings.iter().flat_map(|(recording, _)| &recording.rows) {
        for number in [row.time_s, row.position_rad, row.velocity_rad_s, row.torque_nm] {
            digest.update(number.to_le_bytes());
        }
    }
    digest.finalize().first_chunk().map_or(0, |bytes| u32::from_be_bytes(*bytes))
}

/// Returns a sentence for each covariate that was not recorded, or that did not vary: its effect stays unknown.
pub fn constant_covariates(recordings: &[Recording]) -> Vec<String> {
    /// Share of a covariate's own size below which its variation counts as none.
    const VARIATION: f64 = 0.02;
    let names = ["side load", "pressure", "temperature"];
    let said = COVARIATES.iter().zip(names).filter_map(|((_, value), name)| {
        let values = || recordings.iter().flat_map(|recording| &recording.rows).map(value);
        if values().any(|value| !value.is_finite()) {
            return Some(format!("{name} is not measured: its effect is unknown"));
        }
        let (least, most) = values()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(value), b.max(value)));
        let size = least.abs().max(most.abs());
        // A temperature in deg C has no natural zero: a kelvin is visible.
        let enough = if name == "temperature" { 1.0 } else { VARIATION * size };
        (most - least <= enough).then(|| format!("{name} did not vary: its effect is unknown"))
    });
    said.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recording(pressure: impl Fn(usize) -> f64) -> Recording {
        let row = |at: usize| Row {
            time_s: 1e-3 * at as f64,
            torque_nm: at as f64,
            radial_force_n: f64::NAN,
            pressure_diff_pa: pressure(at),
            temperature_c: 20.0,
            ..Row::default()
        };
        Recording { name: "test".into(), rows: (0..103).map(row).collect() }
    }

    #[test]
    fn table_averages_rows_and_leaves_out_what_is_not_measured() {
        let table = table(&[recording(|_| 1e5), recording(|_| 2e5)]);
        let column = |name: &str| {
            let found = table.columns.iter().find(|(known, _)| known == name);
            found.map(|(_, cells)| cells.clone())
        };
        assert!(table.columns.iter().all(|(_, cells)| cells.len() == 40));
        match column("torque_nm") {
            Some(Cells::Numbers(torques)) => assert_eq!(torques[..2], [2.0, 7.0]),
            other => panic!("{other:?}"),
        }
        assert!(column("pressure_diff_pa").is_some() && column("radial_force_n").is_none());
    }

    #[test]
    fn constant_covariates_lists_what_is_missing_or_constant() {
        let said = constant_covariates(&[recording(|at| 1e5 + 1e3 * at as f64)]);
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(
            said[0].starts_with("side load ") && said[1].starts_with("temperature "),
            "{said:?}"
        );
        crate::snapshot::check("session", "columns without a change", &said.join("\n"));
        assert_eq!(constant_covariates(&[recording(|_| 1e5)]).len(), 3);
    }
}

//! Small hand-made logs for the tests of the stages of a diagnosis.
//!
//! Motion and torque are closed formulas. The laws of the core do not simulate them, so that a test
//! compares a stage with a truth that does not depend on the fitted model. All values are
//! deterministic, including the noise.

use super::finalist::fitted;
use super::model::FittedModel;
use super::train_test::TrainTest;
use compensator_core::LawKind;
use friction_fit::spec::Spec;
use joint_log::{Dataset, SplitRule, split};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Time between two rows, s.
pub const PERIOD_S: f64 = 0.005;

/// Number of runs.
const RUNS: usize = 6;

/// Rows of a run.
const ROWS: usize = 240;

/// Rows before the start of a run, which are not logged. A filter, a delay and the bristles of the
/// first logged row depend on them.
const EARLIER_ROWS: usize = 40;

/// Steps between two rows for the bristles. The velocity is not constant between two rows.
const STEPS: usize = 20;

/// Noise of the torque, Nm RMS.
const NOISE_NM: f64 = 0.02;

/// Travel within which the bristles reach 63 % of the friction level, rad.
const TRAVEL_RAD: f64 = 0.03;

/// The same for soft bristles, rad.
const SOFT_TRAVEL_RAD: f64 = 0.2;

/// Columns of a log.
const COLUMNS: [&str; 5] =
    ["time_s", "velocity_rad_s", "torque_nm", "pressure_diff_pa", "temperature_c"];

/// One row before its torque is measured.
#[derive(Clone, Copy)]
pub struct LogRow {
    /// Number of the run, from 0.
    pub run: usize,
    /// Time since the start of the run, s.
    pub time_s: f64,
    /// Velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Pressure difference, MPa. It changes within each run.
    pub pressure_mpa: f64,
    /// Temperature, deg C. Three quarters of its variance follow the pressure.
    pub temperature_c: f64,
    /// Torque of bristles, as a share of the Coulomb torque.
    pub bristle_share: f64,
    /// The same of soft bristles.
    pub soft_bristle_share: f64,
    /// The same of bristles whose level falls with the speed.
    pub stribeck_bristle_share: f64,
}

impl LogRow {
    /// Returns the sign of the velocity, -1 or 1.
    pub fn direction(&self) -> f64 {
        self.velocity_rad_s.signum()
    }
}

/// Runs with a torque formula.
#[derive(Clone)]
pub struct HandMadeLog {
    rows: Vec<Vec<LogRow>>,
    torque_nm: Vec<Vec<f64>>,
}

impl HandMadeLog {
    /// Creates a log with this torque, Nm, and noise.
    pub fn new(torque_nm: impl Fn(&LogRow) -> f64) -> Self {
        let rows: Vec<Vec<LogRow>> = (0..RUNS).map(run_rows).collect();
        let torque = |run: &Vec<LogRow>| run.iter().map(&torque_nm).collect();
        let torque_nm = rows.iter().map(torque).collect();
        Self { rows, torque_nm }
    }

    /// Returns the log with the torque of this number of rows earlier.
    #[must_use]
    pub fn with_delayed_torque(mut self, rows: usize) -> Self {
        self.torque_nm.iter_mut().for_each(|run| run.rotate_right(rows));
        self
    }

    /// Returns the log with the torque behind a first-order low-pass of this time constant, s.
    #[must_use]
    pub fn with_filtered_torque(mut self, time_s: f64) -> Self {
        let share = 1.0 - (-PERIOD_S / time_s).exp();
        for run in &mut self.torque_nm {
            let mut held = run[0];
            for torque in run {
                held += share * (*torque - held);
                *torque = held;
            }
        }
        self
    }

    /// Returns the log with the velocity of this number of rows earlier.
    #[must_use]
    pub fn with_delayed_velocity(mut self, rows: usize) -> Self {
        for run in &mut self.rows {
            let velocities: Vec<f64> = run.iter().map(|row| row.velocity_rad_s).collect();
            for (at, row) in run.iter_mut().enumerate() {
                row.velocity_rad_s = velocities[at.saturating_sub(rows)];
            }
        }
        self
    }

    /// Returns the log with each run at rest for its last rows. The torque at rest differs from run
    /// to run and is below the friction level.
    #[must_use]
    pub fn with_rest(mut self, rows: usize) -> Self {
        for (run, (motion, torque_nm)) in self.rows.iter_mut().zip(&mut self.torque_nm).enumerate()
        {
            let begin = motion.len() - rows;
            motion[begin..].iter_mut().for_each(|row| row.velocity_rad_s = 0.0);
            torque_nm[begin..].fill(0.8 * (2.0 * run as f64).sin());
        }
        self
    }

    /// Returns the log of a diagnosis that evaluates each run with a fit to the others.
    pub fn train_test(&self) -> TrainTest {
        self.split_by(&SplitRule::LeaveOneRunOut)
    }

    /// Returns the log of a diagnosis with these runs set apart.
    pub fn train_test_without(&self, held_out: &[usize]) -> TrainTest {
        let values = held_out.iter().map(ToString::to_string).collect();
        self.split_by(&SplitRule::HoldOut { column: "run".into(), values })
    }

    fn split_by(&self, rule: &SplitRule) -> TrainTest {
        let mut noise = Noise(Pcg64::seed_from_u64(1));
        let runs = self.rows.iter().zip(&self.torque_nm).enumerate();
        let runs = runs.map(|(run, (rows, torque_nm))| {
            let column = |of: fn(&LogRow) -> f64| rows[EARLIER_ROWS..].iter().map(of).collect();
            let mut measured = |torque: &f64| torque + NOISE_NM * noise.draw();
            let columns = vec![
                column(|row| row.time_s),
                column(|row| row.velocity_rad_s),
                torque_nm[EARLIER_ROWS..].iter().map(&mut measured).collect(),
                column(|row| 1e6 * row.pressure_mpa),
                column(|row| row.temperature_c),
            ];
            (run.to_string(), columns)
        });
        let data = Dataset::from_columns(&COLUMNS.map(str::to_owned), runs).expect("columns");
        TrainTest::new(&data, &split(&data, rule, 0).expect("both sides"), 1, &[])
    }
}

/// Approximately normal noise of unit variance.
struct Noise(Pcg64);

impl Noise {
    fn draw(&mut self) -> f64 {
        (0..12).map(|_| self.0.random_range(-0.5..0.5)).sum()
    }
}

/// Returns the rows of a run, with the earlier ones.
fn run_rows(run: usize) -> Vec<LogRow> {
    let phase = 0.4 + 1.3 * run as f64;
    let speed_rad_s = 0.7 + 0.1 * (run % 4) as f64;
    let velocity = |time_s: f64| {
        let angle = (8.0 + 1.1 * run as f64) * time_s + phase;
        speed_rad_s * (angle.sin() + 0.4 * (2.3 * angle).sin())
    };
    let (mut bristle_share, mut soft_bristle_share, mut stribeck_bristle_share) = (0.0, 0.0, 0.0);
    let step_s = PERIOD_S / STEPS as f64;
    let row = |at: usize| {
        let time_s = PERIOD_S * (at as f64 - EARLIER_ROWS as f64);
        for step in (0..STEPS).rev() {
            let velocity = velocity(time_s - step_s * step as f64);
            let travel = step_s * velocity;
            advance_bristles(&mut bristle_share, travel, TRAVEL_RAD, 1.0);
            advance_bristles(&mut soft_bristle_share, travel, SOFT_TRAVEL_RAD, 1.0);
            let level = stribeck_level(velocity);
            advance_bristles(&mut stribeck_bristle_share, travel, TRAVEL_RAD, level);
        }
        let pressure_wave = (6.1 * time_s + 2.0 * phase).sin();
        let free_wave = (10.3 * time_s + 0.7 * phase).sin();
        LogRow {
            run,
            time_s,
            velocity_rad_s: velocity(time_s),
            pressure_mpa: 0.5 + 0.4 * pressure_wave,
            temperature_c: 30.0 + 5.0 * (pressure_wave + 0.6 * free_wave),
            bristle_share,
            soft_bristle_share,
            stribeck_bristle_share,
        }
    };
    (0..EARLIER_ROWS + ROWS).map(row).collect()
}

/// Advances the torque of bristles by a travel. It approaches the level in the direction of motion
/// exponentially. `yield_rad` is the travel to 63 % of the level 1.
fn advance_bristles(share: &mut f64, travel_rad: f64, yield_rad: f64, level: f64) {
    let kept = (-(travel_rad / (yield_rad * level)).abs()).exp();
    *share = travel_rad.signum() * level * (1.0 - kept) + kept * *share;
}

/// Returns a friction level that falls with the speed, as a share of the Coulomb torque.
fn stribeck_level(velocity_rad_s: f64) -> f64 {
    1.0 + 0.6 * (-(velocity_rad_s / 0.15).powi(2)).exp()
}

/// Returns the torque of Coulomb and viscous friction, Nm.
pub fn linear_torque(row: &LogRow) -> f64 {
    row.direction() + 0.3 * row.velocity_rad_s
}

/// Returns the torque of friction whose level rises with the pressure, Nm.
pub fn pressure_torque(row: &LogRow) -> f64 {
    linear_torque(row) + 0.5 * (row.pressure_mpa - 0.5) * row.direction()
}

/// Returns the torque of friction whose level falls with the speed, Nm.
pub fn stribeck_torque(row: &LogRow) -> f64 {
    stribeck_level(row.velocity_rad_s) * row.direction() + 0.3 * row.velocity_rad_s
}

/// Returns the torque of friction with bristles, Nm.
pub fn bristle_torque(row: &LogRow) -> f64 {
    row.bristle_share + 0.3 * row.velocity_rad_s
}

/// Returns the torque of friction with bristles whose level falls with the speed, Nm.
pub fn stribeck_bristle_torque(row: &LogRow) -> f64 {
    row.stribeck_bristle_share + 0.3 * row.velocity_rad_s
}

/// Returns the fit of the linear law to a log.
pub fn linear_base(log: &TrainTest) -> FittedModel {
    fitted(log, &Spec::law(LawKind::Linear), None, &[], None).expect("a law without terms")
}

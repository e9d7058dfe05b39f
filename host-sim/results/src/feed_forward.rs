//! A friction feed-forward for drives of other makers: a table of torque over speed, in the drive's units.
//!
//! The model is the one of all laws that predicts held-out rows best. The table is its torque in steady sliding. Drives that
//! only add a torque to their set-point cannot run the law itself, so the result states what the table costs: its error on
//! held-out rows stands beside that of the complete model and of no feed-forward.
//!
//! A table without a gain beyond its interval is not handed out.

mod document;
mod drive;
mod judged;
mod script;
mod steady;
mod table;

pub use drive::Drive;
pub use judged::{Judged, RigidBody};
pub use table::TablePoint;

use crate::ResultError;
use crate::files::{Files, pretty};
use crate::fits::{fit_page, recommended};
use crate::provenance::parameter_file;
use compensator_core::parameters::Choices;
use compensator_core::{LawKind, ParameterId as Id, TermKind};
use drive::TableUnits;
use friction_diagnose::Gain;
use friction_diagnose::prepare::{Error, Prepared, identify_each};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Measurement, Outcome, State, predict};
use joint_log::JointKind;
use joint_log::work;
use judged::table_errors;
use steady::{Estimated, SteadyModel};
use table::best_table;

/// Minimum share of the path in the rarer direction.
const MIN_BACK_SHARE: f64 = 0.05;

/// Maximum standard error of the offset beside gravity, as a share of the largest torque of the table. In a log of a small
/// angle, both are nearly the same torque, and each of them is then meaningless alone.
const MAX_OFFSET_ERROR_SHARE: f64 = 0.1;

/// A friction feed-forward.
pub struct FeedForward {
    /// The drive.
    pub drive: Drive,
    /// The held-out errors.
    pub judged: Judged,
    /// Name of the model.
    model: String,
    /// Names of the log's files.
    files: Vec<String>,
    /// Torque over velocity, in SI units.
    table: Vec<TablePoint>,
    units: TableUnits,
    rigid_body: RigidBody,
    /// Inertia, kg m^2, if the log determines it.
    inertia: Option<Estimated>,
    /// True if `--columns` reverses the sign of the torque.
    is_reversed: bool,
    /// Remarks for the user, one sentence each.
    remarks: Vec<String>,
}

/// Fits all laws without side load and pressure, and returns the best one on held-out rows. Gravity is added if it reduces
/// the held-out error beyond its interval and does not blur the offset.
///
/// # Errors
/// If a fit fails.
pub fn fit_for_feed_forward(input: &Prepared) -> Result<Outcome, Error> {
    let laws = LawKind::ALL.iter().copied().filter(|law| !law.has_seal_load());
    let specs: Vec<Spec> = laws.map(Spec::law).collect();
    let options = FitOptions { passive: true, ..FitOptions::default() };
    let mut fits = identify_each(&specs, input, Choices::default(), &options)?;
    work::report_stage("comparing the models");
    let best = fits.swap_remove(recommended(&fits, input));
    let has_position =
        input.train.iter().flat_map(|track| &track.samples).any(|of| of.position_rad != 0.0);
    if input.rigid_body.contains(&TermKind::GravityImbalance) || !has_position {
        return Ok(best);
    }
    let mut with_gravity = input.clone();
    with_gravity.rigid_body.push(TermKind::GravityImbalance);
    let spec = [Spec::law(best.spec.law)];
    let mut fits = identify_each(&spec, &with_gravity, Choices::default(), &options)?;
    let gravity = fits.swap_remove(0);
    let errors = |fit: &Outcome| predict(&fit.parameters, input.test_rows(), fit.resolution);
    let has_gain = Gain::between(&errors(&best), &errors(&gravity), 0).ci95[0] > 0.0;
    Ok(if has_gain && !has_blurred_offset(&gravity, input) { gravity } else { best })
}

/// Returns true if the offset of a fit with gravity is poorly determined.
fn has_blurred_offset(fit: &Outcome, input: &Prepared) -> bool {
    let form = fit.for_driver();
    let offset = form.estimates.iter().find(|estimate| estimate.id == Id::TorqueOffset);
    let fastest = table::covered_speed(&input.train);
    let level = steady::torque_without_gravity(&form.parameters, fastest)
        - steady::torque_without_gravity(&form.parameters, -fastest);
    let most = MAX_OFFSET_ERROR_SHARE * 0.5 * level.abs();
    // An offset without a standard error is not determined.
    offset.is_some_and(|offset| offset.std_error.is_none_or(|error| error > most))
}

impl FeedForward {
    /// Makes the feed-forward of a fitted model for a drive.
    ///
    /// # Errors
    /// One line if the drive has no such joint, or the log moves in one direction only.
    pub fn new(drive: Drive, fit: &Outcome, input: &Prepared) -> Result<Self, Error> {
        let data = &input.data;
        let units = drive.units(data.joint).ok_or_else(|| {
            format!(
                "{}: found a log of a linear joint, expected one of a rotary joint",
                drive.name()
            )
        })?;
        refuse_one_direction(input)?;
        let model = SteadyModel::new(fit);
        let rigid_body = RigidBody::of(&model.parameters);
        let error =
            |table: &[TablePoint]| table_errors(table, &rigid_body, input.train_rows()).metrics.sse;
        let table = best_table(&model, &input.train, error);
        let judged = Judged::new(fit, &table, input.test_rows());
        let file_name = |path: &std::path::PathBuf| {
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            // A quotation mark or a backslash would end or change the text of the script.
            name.replace(['"', '\\', '\n'], "_")
        };
        let torque_unit =
            data.sources.iter().find(|of| ["torque_nm", "force_n"].contains(&&*of.name));
        let torque_unit = torque_unit.and_then(|of| of.unit.clone()).unwrap_or_default();
        let mut made = Self {
            drive,
            judged,
            model: fit.spec.full_name(),
            files: data.files.iter().map(file_name).collect(),
            table,
            units,
            rigid_body,
            inertia: determined_inertia(fit),
            is_reversed: torque_unit.starts_with('-'),
            remarks: Vec::new(),
        };
        made.remarks = made.remarks_on(&torque_unit);
        Ok(made)
    }

    /// Returns the points of the table in the drive's units.
    fn rows(&self) -> impl Iterator<Item = TablePoint> + '_ {
        let size = self.units.speed_size;
        self.table.iter().map(move |point| TablePoint { velocity: point.velocity / size, ..*point })
    }

    /// Returns the torque per acceleration in the drive's units.
    fn inertia_in_units(&self) -> Option<f64> {
        self.inertia.map(|inertia| self.units.speed_size * inertia.value)
    }

    fn inertia_unit(&self) -> &'static str {
        if self.units.torque == "N" { "kg" } else { "kg m^2" }
    }

    fn has_gravity(&self) -> bool {
        self.rigid_body.gravity_sine != 0.0 || self.rigid_body.gravity_cosine != 0.0
    }

    fn remarks_on(&self, torque_unit: &str) -> Vec<String> {
        let mut remarks = Vec::new();
        if torque_unit.trim_start_matches('-') == "A" {
            remarks.push(
                "the torque is a current times --torque-constant: the drive's own torque constant must be the same".into(),
            );
        }
        if self.is_reversed {
            remarks.push(
                "the sign of the torque was reversed while reading: check with a small SCALE that the drive's command has \
                 the sign of the table"
                    .into(),
            );
        }
        if self.inertia.is_none() {
            remarks.push("the inertia is not determined by this log and is left out".into());
        }
        if self.has_gravity() {
            remarks.push(
                "gravity depends on the position: its zero must be that of the log after every start of the drive".into(),
            );
        }
        remarks
    }

    /// Returns the result files: those of the drive and `params.toml` only if the table has a gain.
    ///
    /// # Errors
    /// One line, if a value cannot be represented in JSON.
    pub fn files(&self, fit: &Outcome, input: &Prepared) -> Result<Files, ResultError> {
        let document = ("feed-forward.json", pretty(&document::json(self))?);
        let mut others = vec![("fit.html", fit_page(fit, input).into_bytes())];
        if self.judged.has_gain() {
            others.push(("feed-forward.csv", document::csv(self).into_bytes()));
            others.push(("feed_forward.py", script::script(self).into_bytes()));
            others.push((
                "params.toml",
                parameter_file("tune", input, fit, None, &Measurement::default()).into_bytes(),
            ));
            if let (Drive::Moteus, Some(inertia)) = (self.drive, self.inertia) {
                let line = format!("conf set servo.inertia_feedforward {:.9}\n", inertia.value);
                others.push(("moteus.cfg", line.into_bytes()));
            }
        }
        Ok(Files { document, others })
    }

    /// Returns the result in sentences.
    pub fn text(&self) -> String {
        document::text(self)
    }
}

/// Returns the inertia, if the rows determine it.
fn determined_inertia(fit: &Outcome) -> Option<Estimated> {
    let form = fit.for_driver();
    let inertia = form.estimates.iter().find(|estimate| estimate.id == Id::Inertia)?;
    let is_known = inertia.state == State::Determined && inertia.value > 0.0;
    let std_error = inertia.std_error.filter(|_| is_known)?;
    Some(Estimated { value: inertia.value, std_error })
}

/// Refuses a log that hardly moves in one of the directions: the table has both.
fn refuse_one_direction(input: &Prepared) -> Result<(), Error> {
    let velocities = || input.data.runs.iter().flat_map(|run| &run.velocity);
    let path = |sign: f64| velocities().map(|velocity| (sign * velocity).max(0.0)).sum::<f64>();
    let (ahead, back) = (path(1.0), path(-1.0));
    let share = ahead.min(back) / (ahead + back).max(f64::MIN_POSITIVE);
    if share >= MIN_BACK_SHARE {
        return Ok(());
    }
    let way = if ahead < back { "positive" } else { "negative" };
    let column = match input.data.joint {
        JointKind::Revolute => "velocity_rad_s",
        JointKind::Prismatic => "velocity_m_s",
    };
    let file =
        input.data.files.first().map_or(String::new(), |file| format!("{}: ", file.display()));
    Err(format!(
        "{file}{column}: found {:.0} % of the path in {way} direction, expected motion in both directions",
        100.0 * share
    )
    .into())
}

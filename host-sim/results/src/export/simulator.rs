//! Export as dry friction and damping of a simulator's joint.
//!
//! MuJoCo (`frictionloss`, `damping`) and URDF (`friction`, `damping`) have a constant torque against the motion and a
//! torque proportional to speed. Both come from a least-squares line through the core's torque in steady sliding, over
//! the speed range of the model. For the law `linear`, the line equals the law. The header of the file states the
//! largest error, because the simulator has no Stribeck curve.
//!
//! A MuJoCo joint also has an inertia of its own, `armature`: that of the term `unmodelled-inertia`, which `--rigid-body inertia`
//! fits.
//!
//! A simulator's joint has no pressure, side load or temperature. Terms of such covariates are evaluated at the means of the
//! log, which the parameter file states.

use super::ExportedModel;
use crate::steady_torque::steady_torque;
use compensator_core::{ParameterId, Parameters, Quantity, Sample, TermKind};
use friction_fit::params::ParameterFile;
use joint_log::JointKind;
use joint_log::number::significant;

/// Number of speeds for the least-squares fit.
const SPEED_COUNT: usize = 200;

/// Dry friction and damping of a joint.
struct FrictionLine {
    /// Dry friction, Nm or N.
    dry: f64,
    /// Damping, Nm s/rad or N s/m.
    damping: f64,
    /// Largest deviation from the model in steady sliding, and its speed.
    max_error: (f64, f64),
    /// Largest speed of the fit.
    max_speed: f64,
    /// Covariates at the log's means, each as `pressure_diff_pa = 1.64e5`.
    at_means: Vec<String>,
    /// Names of the terms whose covariate has no mean in the file.
    without_mean: Vec<&'static str>,
    /// Names of the terms that the line does not represent.
    left_out: Vec<&'static str>,
}

/// Fits the line to the model's friction in steady sliding.
fn fit_line(file: &ParameterFile) -> FrictionLine {
    let mut model = file.parameters.clone();
    let (mut without_mean, mut left_out) = (Vec::new(), Vec::new());
    model.terms.retain(|term| match place_of(*term, file) {
        Place::OnLine => true,
        Place::WithoutMean => {
            without_mean.push(term.name());
            false
        }
        Place::Nowhere => {
            left_out.push(term.name());
            false
        }
    });
    let (covariates, at_means) = covariates_at_means(file, &model);
    let max_speed = f64::from(model.envelope.velocity_max_rad_s);
    let speeds = (1..=SPEED_COUNT).map(|at| max_speed * at as f64 / SPEED_COUNT as f64);
    let one_way = |velocity_rad_s| steady_torque(&model, &Sample { velocity_rad_s, ..covariates });
    // The friction at a speed, averaged over both directions.
    let points: Vec<(f64, f64)> =
        speeds.map(|speed| (speed, 0.5 * (one_way(speed) - one_way(-speed)))).collect();
    let (mut dry, mut damping) = least_squares(&points);
    let mean = points.iter().map(|point| point.1).sum::<f64>() / points.len() as f64;
    // Simulators reject negative values: a negative one is set to zero and the other is fitted alone.
    if damping < 0.0 {
        (dry, damping) = (mean, 0.0);
    } else if dry < 0.0 {
        let squares: f64 = points.iter().map(|(v, _)| v * v).sum();
        (dry, damping) = (0.0, points.iter().map(|(v, y)| v * y).sum::<f64>() / squares);
    }
    let max_error = points
        .iter()
        .map(|(speed, torque)| ((torque - dry - damping * speed).abs(), *speed))
        .fold((0.0, 0.0), |largest, next| if next.0 > largest.0 { next } else { largest });
    FrictionLine { dry, damping, max_error, max_speed, at_means, without_mean, left_out }
}

/// Where a term's effect is in the line.
enum Place {
    /// In the friction of steady sliding.
    OnLine,
    /// It would be there, but the file states no mean of its covariate.
    WithoutMean,
    /// A joint has no attribute for it.
    Nowhere,
}

fn place_of(term: TermKind, file: &ParameterFile) -> Place {
    match term {
        // The average of both directions includes an asymmetry.
        TermKind::DirectionAsymmetry | TermKind::StribeckShape | TermKind::QuadraticDrag => {
            Place::OnLine
        }
        TermKind::PressureCoulomb
        | TermKind::RadialForceCoulomb
        | TermKind::LoadTorqueCoulomb
        | TermKind::TemperatureViscous
        | TermKind::TemperatureCoulomb => {
            let mean = term.reads().and_then(|quantity| file.fit.internal_mean(quantity));
            if mean.is_some() { Place::OnLine } else { Place::WithoutMean }
        }
        _ => Place::Nowhere,
    }
}

/// Returns a sample with the covariates that the model reads at the log's means, and their names with values.
fn covariates_at_means(
    file: &ParameterFile,
    model: &Parameters<f64>,
) -> (Sample<f64>, Vec<String>) {
    let mut sample = Sample::default();
    let mut named = Vec::new();
    let mut read: Vec<Quantity> = model.terms.iter().filter_map(|term| term.reads()).collect();
    if model.law.has_seal_load() {
        read.extend([Quantity::RadialForce, Quantity::Pressure]);
    }
    read.dedup();
    for (quantity, mean) in &file.fit.log_means {
        if read.contains(quantity) {
            quantity.set_in_sample(&mut sample, mean * quantity.info().inside_scale);
            named.push(format!("{} = {}", quantity.name(file.joint), significant(*mean, 3)));
        }
    }
    (sample, named)
}

/// Returns constant and slope of the least-squares line.
fn least_squares(points: &[(f64, f64)]) -> (f64, f64) {
    let count = points.len() as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (v, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let slope = mean(&|p| (p.0 - v) * (p.1 - y)) / mean(&|p| (p.0 - v).powi(2));
    (y - slope * v, slope)
}

fn units(joint: JointKind) -> [&'static str; 3] {
    match joint {
        JointKind::Revolute => ["Nm", "Nm s/rad", "rad/s"],
        JointKind::Prismatic => ["N", "N s/m", "m/s"],
    }
}

/// Exports the line as an element. `armature` is the inertia that the element has besides the line.
fn export(
    file: &ParameterFile,
    source: &str,
    armature: Option<f64>,
    element: impl Fn(&FrictionLine) -> String,
) -> ExportedModel {
    let mut line = fit_line(file);
    if armature.is_some() {
        line.left_out.retain(|name| *name != TermKind::UnmodelledInertia.name());
    }
    let [torque, damping, speed] = units(file.joint);
    let mut notes = Vec::new();
    // For a linear law, the error is only rounding.
    if line.max_error.0 > 1e-9 * line.dry {
        notes.push(format!(
            "line fitted to the friction in steady sliding up to {} {speed}; the largest error is {} {torque}, at {} {speed}",
            significant(line.max_speed, 3),
            significant(line.max_error.0, 2),
            significant(line.max_error.1, 2),
        ));
    }
    if file.parameters.law.has_bristles() {
        notes.push("not represented: bristles (presliding, hysteresis)".to_owned());
    }
    if !line.at_means.is_empty() {
        notes.push(format!("covariates at the means of the log: {}", line.at_means.join(", ")));
    } else if file.parameters.law.has_seal_load() {
        notes.push(
            "valid without side load and pressure: the file states no means of the log".to_owned(),
        );
    }
    if !line.without_mean.is_empty() {
        notes.push(format!(
            "terms left out, because the file states no mean of their covariate ([log_means]): {}",
            line.without_mean.join(", ")
        ));
    }
    if !line.left_out.is_empty() {
        notes.push(format!(
            "terms left out, because a simulator's joint has no such attribute: {}",
            line.left_out.join(", ")
        ));
    }
    if armature.is_some() {
        let unit = if file.joint == JointKind::Revolute { "kg m^2" } else { "kg" };
        notes.push(format!(
            "armature in {unit} is the whole inertia of the fit: subtract that of the bodies that the simulator moves"
        ));
    }
    // Two hyphens are not allowed inside an XML comment.
    let mut text = format!(
        "<!-- {} from {}: dry friction in {torque}, damping in {damping}.\n",
        file.spec.full_name(),
        source.replace("--", "- -")
    );
    notes.iter().for_each(|note| text += &format!("     {note}.\n"));
    text.truncate(text.trim_end().len());
    text += &format!(" -->\n{}\n", element(&line));
    ExportedModel::new(text.into_bytes(), notes)
}

/// Returns the joint's own inertia, kg m^2 or kg, if the model has a possible one.
fn armature(file: &ParameterFile) -> Option<f64> {
    let has_inertia = file.parameters.terms.contains(&TermKind::UnmodelledInertia);
    let inertia = file.parameters.get(ParameterId::Inertia);
    (has_inertia && inertia > 0.0).then_some(inertia)
}

/// Exports the attributes of a MuJoCo joint.
pub(super) fn mujoco(file: &ParameterFile, source: &str) -> ExportedModel {
    let kind = if file.joint == JointKind::Revolute { "hinge" } else { "slide" };
    let armature = armature(file);
    export(file, source, armature, |line| {
        let inertia =
            armature.map_or(String::new(), |inertia| format!(" armature=\"{}\"", inertia as f32));
        format!(
            "<joint name=\"joint\" type=\"{kind}\"{inertia} frictionloss=\"{}\" damping=\"{}\"/>",
            line.dry as f32, line.damping as f32
        )
    })
}

/// Exports the dynamics element of a URDF joint.
pub(super) fn urdf(file: &ParameterFile, source: &str) -> ExportedModel {
    export(file, source, None, |line| {
        format!("<dynamics friction=\"{}\" damping=\"{}\"/>", line.dry as f32, line.damping as f32)
    })
}

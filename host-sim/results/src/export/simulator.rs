//! Export as dry friction and damping of a simulator's joint.
//!
//! MuJoCo (`frictionloss`, `damping`) and URDF (`friction`, `damping`) have a constant torque against the motion and a
//! torque proportional to speed. Both come from a least-squares line through the core's torque in steady sliding, over
//! the speed range of the model. For the law `linear`, the line equals the law. The header of the file states the
//! largest error, because the simulator has no Stribeck curve.

use super::ExportedModel;
use compensator_core::{ModelState, Parameters, Sample, TermKind};
use friction_identification::data::JointKind;
use friction_identification::number::significant;
use friction_identification::params::ParameterFile;

/// Number of speeds for the least-squares fit.
const SPEED_COUNT: usize = 200;

/// Sample period, s. It is long enough for every bristle to reach steady sliding.
const STEADY_PERIOD_S: f64 = 10.0;
/// Number of samples at each speed.
const STEPS: usize = 100;

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
    /// Names of the terms that the line does not represent.
    left_out: Vec<&'static str>,
}

/// Returns the friction in steady sliding at this speed, averaged over both directions.
fn sliding(model: &Parameters<f64>, speed: f64) -> f64 {
    let built = model.build_unchecked::<f64>(STEADY_PERIOD_S);
    let one_way = |velocity: f64| {
        let mut state = ModelState::default();
        let sample = Sample { velocity_rad_s: velocity, ..Sample::default() };
        (0..STEPS).map(|_| built.step(&mut state, &sample)).last().unwrap_or(0.0)
    };
    0.5 * (one_way(speed) - one_way(-speed))
}

/// Fits the line to the model's friction in steady sliding.
fn fit_line(file: &ParameterFile) -> FrictionLine {
    let mut model = file.parameters.clone();
    // The average of both directions includes an asymmetry. A joint has no attributes for other terms.
    let kept = [TermKind::DirectionAsymmetry, TermKind::StribeckShape];
    let left_out: Vec<&'static str> =
        model.terms.iter().filter(|term| !kept.contains(term)).map(|term| term.name()).collect();
    model.terms.retain(|term| kept.contains(term));
    let max_speed = f64::from(model.envelope.velocity_max_rad_s);
    let speeds = (1..=SPEED_COUNT).map(|at| max_speed * at as f64 / SPEED_COUNT as f64);
    let points: Vec<(f64, f64)> = speeds.map(|speed| (speed, sliding(&model, speed))).collect();
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
    FrictionLine { dry, damping, max_error, max_speed, left_out }
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

fn export(
    file: &ParameterFile,
    source: &str,
    element: impl Fn(&FrictionLine) -> String,
) -> ExportedModel {
    let line = fit_line(file);
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
    if file.parameters.law.has_seal_load() {
        notes.push("valid without side load and pressure".to_owned());
    }
    if !line.left_out.is_empty() {
        notes.push(format!(
            "terms left out, because a simulator's joint has no such attribute: {}",
            line.left_out.join(", ")
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
    ExportedModel { content: text.into_bytes(), notes }
}

/// Exports the attributes of a MuJoCo joint.
pub(super) fn mujoco(file: &ParameterFile, source: &str) -> ExportedModel {
    let kind = if file.joint == JointKind::Revolute { "hinge" } else { "slide" };
    export(file, source, |line| {
        format!(
            "<joint name=\"joint\" type=\"{kind}\" frictionloss=\"{}\" damping=\"{}\"/>",
            line.dry as f32, line.damping as f32
        )
    })
}

/// Exports the dynamics element of a URDF joint.
pub(super) fn urdf(file: &ParameterFile, source: &str) -> ExportedModel {
    export(file, source, |line| {
        format!("<dynamics friction=\"{}\" damping=\"{}\"/>", line.dry as f32, line.damping as f32)
    })
}

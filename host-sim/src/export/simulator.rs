//! A joint's dry friction and damping, as simulators take them.
//!
//! MuJoCo (`frictionloss`, `damping`) and URDF (`friction`, `damping`) know a constant torque against the motion
//! and one proportional to speed. Both are read off the core: the model is run at constant speeds to where its
//! bristles slip, and a line is laid through what it gives, by least squares over the speeds it was declared for.
//! For the law `linear` that is the law itself. The heading states the largest error, so that a Stribeck curve
//! the simulator cannot have is not lost in silence.

use super::Export;
use compensator_core::{Parameters, Sample, State, TermKind};
use friction_identification::data::JointKind;
use friction_identification::number::significant;
use friction_identification::params::ParameterFile;

/// Speeds the line is laid through.
const SPEEDS: usize = 200;

/// A sample period in which any bristle slips through, s, and how many of them a model is given.
const LONG_S: f64 = 10.0;
const STEPS: usize = 100;

/// Dry friction and damping of a joint.
struct Line {
    dry: f64,
    damping: f64,
    /// Largest difference from the model in steady sliding, and the speed it is met at.
    worst: (f64, f64),
    fastest: f64,
    left_out: Vec<&'static str>,
}

/// Friction in steady sliding at this speed, the mean of both directions.
fn sliding(model: &Parameters<f64>, speed: f64) -> f64 {
    let built = model.build_unchecked::<f64>(LONG_S);
    let one_way = |velocity: f64| {
        let mut state = State::default();
        let sample = Sample { velocity_rad_s: velocity, ..Sample::default() };
        (0..STEPS).map(|_| built.step(&mut state, &sample)).last().unwrap_or(0.0)
    };
    0.5 * (one_way(speed) - one_way(-speed))
}

fn line(file: &ParameterFile) -> Line {
    let mut model = file.parameters.clone();
    // What differs by direction is in the mean of both; of the rest a joint's attributes know nothing.
    let kept = [TermKind::DirectionAsymmetry, TermKind::StribeckShape];
    let left_out: Vec<&'static str> =
        model.terms.iter().filter(|term| !kept.contains(term)).map(|term| term.name()).collect();
    model.terms.retain(|term| kept.contains(term));
    let fastest = f64::from(model.envelope.velocity_max_rad_s);
    let speeds = (1..=SPEEDS).map(|at| fastest * at as f64 / SPEEDS as f64);
    let points: Vec<(f64, f64)> = speeds.map(|speed| (speed, sliding(&model, speed))).collect();
    let (mut dry, mut damping) = least_squares(&points);
    let mean = points.iter().map(|point| point.1).sum::<f64>() / points.len() as f64;
    // A simulator takes no negative one: then the other alone.
    if damping < 0.0 {
        (dry, damping) = (mean, 0.0);
    } else if dry < 0.0 {
        let squares: f64 = points.iter().map(|(v, _)| v * v).sum();
        (dry, damping) = (0.0, points.iter().map(|(v, y)| v * y).sum::<f64>() / squares);
    }
    let worst = points
        .iter()
        .map(|(speed, torque)| ((torque - dry - damping * speed).abs(), *speed))
        .fold((0.0, 0.0), |worst, next| if next.0 > worst.0 { next } else { worst });
    Line { dry, damping, worst, fastest, left_out }
}

/// Constant and slope.
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

fn export(file: &ParameterFile, source: &str, element: impl Fn(&Line) -> String) -> Export {
    let line = line(file);
    let [torque, damping, speed] = units(file.joint);
    let mut notes = Vec::new();
    // What is left of a line through a line is rounding.
    if line.worst.0 > 1e-9 * line.dry {
        notes.push(format!(
            "a line through the sliding friction up to {} {speed}; it is at most {} {torque} off, at {} {speed}",
            significant(line.fastest, 3),
            significant(line.worst.0, 2),
            significant(line.worst.1, 2),
        ));
    }
    if file.parameters.law.has_bristles() {
        notes.push("bristles (presliding, hysteresis) are not in it".to_owned());
    }
    if file.parameters.law.has_seal_load() {
        notes.push("it holds without side load and pressure".to_owned());
    }
    if !line.left_out.is_empty() {
        notes.push(format!(
            "left out, as a simulator's joint has no such attribute: {}",
            line.left_out.join(", ")
        ));
    }
    // Two hyphens would end a comment.
    let mut text = format!(
        "<!-- {} out of {}: dry friction in {torque}, damping in {damping}.\n",
        file.spec.full_name(),
        source.replace("--", "- -")
    );
    notes.iter().for_each(|note| text += &format!("     {note}.\n"));
    text.truncate(text.trim_end().len());
    text += &format!(" -->\n{}\n", element(&line));
    Export { content: text.into_bytes(), notes }
}

/// Attributes of a MuJoCo joint.
pub(super) fn mujoco(file: &ParameterFile, source: &str) -> Export {
    let kind = if file.joint == JointKind::Revolute { "hinge" } else { "slide" };
    export(file, source, |line| {
        format!(
            "<joint name=\"joint\" type=\"{kind}\" frictionloss=\"{}\" damping=\"{}\"/>",
            line.dry as f32, line.damping as f32
        )
    })
}

/// The dynamics of a URDF joint.
pub(super) fn urdf(file: &ParameterFile, source: &str) -> Export {
    export(file, source, |line| {
        format!("<dynamics friction=\"{}\" damping=\"{}\"/>", line.dry as f32, line.damping as f32)
    })
}

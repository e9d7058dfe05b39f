//! Charts of the page: angles of each joint and errors of each model.

use super::arm::JOINTS;
use super::fit::Course;
use super::study::{EvaluatedFit, ModelStudy};
use friction_results::report::{Axis, Block, Chart, Series, thin_series};

/// Maximum number of points of a curve.
const MAX_CURVE_POINTS: usize = 1200;

/// Returns charts of angles and errors, with a section for each joint.
pub fn blocks(studies: &[ModelStudy], courses: &[Course]) -> Vec<Block> {
    let mut blocks = Vec::new();
    for joint in 0..JOINTS {
        blocks.push(Block::Heading(format!("Joint {}", joint + 1)));
        blocks.push(Block::Chart(angles(studies, &courses[0], joint)));
        let errors = |title: &str, way: fn(&ModelStudy) -> &EvaluatedFit, course: usize| {
            errors(title, studies, way, courses, course, joint)
        };
        blocks.push(Block::Row(vec![
            errors("As printed, on its own course", |study| &study.printed, 0),
            errors("Properly, on its own course", |study| &study.proper, 0),
        ]));
        blocks.push(Block::Row(vec![
            errors("As printed, held out", |study| &study.printed, 1),
            errors("Properly, held out", |study| &study.proper, 1),
        ]));
    }
    blocks
}

fn curve(name: &str, course: &Course, values: impl Iterator<Item = f64>) -> Series {
    let values: Vec<f64> = values.collect();
    let time: Vec<f64> = (0..values.len()).map(|row| row as f64 * course.drive.period_s).collect();
    let (x, y) = thin_series(&time, &values, MAX_CURVE_POINTS);
    Series::line(name, x, y)
}

fn angles(studies: &[ModelStudy], course: &Course, joint: usize) -> Chart {
    let measured = course.angles_rad[joint].iter().map(|angle| angle.to_degrees());
    let mut series = vec![curve("the arm", course, measured).muted()];
    series.extend(studies.iter().map(|study| {
        let own = study.printed.errors[0].angles_rad[joint].iter().map(|angle| angle.to_degrees());
        curve(study.model.name, course, own)
    }));
    Chart {
        title: format!("Joint {}: angle on the {}", joint + 1, course.name),
        caption: "The simulated arm, averaged over its repeats, and each model's arm with the printed start and bounds.".into(),
        x: Axis::new("time (s)"),
        y: Axis::new("angle (deg)"),
        series,
    }
}

fn errors(
    title: &str,
    studies: &[ModelStudy],
    way: fn(&ModelStudy) -> &EvaluatedFit,
    courses: &[Course],
    course: usize,
    joint: usize,
) -> Chart {
    let on = &courses[course];
    let series = studies.iter().map(|study| {
        let own = &way(study).errors[course].angles_rad[joint];
        let error = own.iter().zip(&on.angles_rad[joint]).map(|(a, b)| (a - b).to_degrees());
        curve(study.model.name, on, error)
    });
    Chart {
        title: title.into(),
        caption: format!("Each model's angle minus the arm's, joint {}, {}.", joint + 1, on.name),
        x: Axis::new("time (s)"),
        y: Axis::new("error (deg)"),
        series: series.collect(),
    }
}

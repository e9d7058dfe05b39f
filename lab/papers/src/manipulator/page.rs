//! Charts of the page: angles of each joint and errors of each model.

use super::arm::JOINTS;
use super::fit::Course;
use super::study::{EvaluatedFit, ModelStudy};
use friction_results::report::{Axis, Block, Chart, Section, Series, thin_series};

/// Maximum number of points of a curve.
const MAX_CURVE_POINTS: usize = 1200;

/// Returns charts of angles and errors, with a section for each joint.
pub fn blocks(studies: &[ModelStudy], courses: &[Course]) -> Vec<Block> {
    let section = |joint: usize| {
        let errors = |title: &str, protocol: fn(&ModelStudy) -> &EvaluatedFit, course: usize| {
            let fits = studies.iter().map(|study| (study.model.name, protocol(study)));
            errors(title, fits, &courses[course], course, joint)
        };
        Section::new(format!("Joint {}", joint + 1))
            .chart(angles(studies, &courses[0], joint))
            .charts(vec![
                errors("As printed, on its own course", |study| &study.printed, 0),
                errors("Properly, on its own course", |study| &study.proper, 0),
            ])
            .charts(vec![
                errors("As printed, held out", |study| &study.printed, 1),
                errors("Properly, held out", |study| &study.proper, 1),
            ])
    };
    (0..JOINTS).flat_map(section).collect()
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
        let angles = study.printed.errors[0].angles_rad[joint].iter();
        curve(study.model.name, course, angles.map(|angle| angle.to_degrees()))
    }));
    Chart {
        title: format!("Joint {}: angle on the {}", joint + 1, course.name),
        caption: "The simulated arm, averaged over its repeats, and each model's arm with the printed start and bounds.".into(),
        x: Axis::new("time (s)"),
        y: Axis::new("angle (deg)"),
        series,
    }
}

fn errors<'a>(
    title: &str,
    fits: impl Iterator<Item = (&'static str, &'a EvaluatedFit)>,
    on: &Course,
    course: usize,
    joint: usize,
) -> Chart {
    let series = fits.map(|(model, fit)| {
        let angles = fit.errors[course].angles_rad[joint].iter().zip(&on.angles_rad[joint]);
        curve(model, on, angles.map(|(simulated, arm)| (simulated - arm).to_degrees()))
    });
    Chart {
        title: title.into(),
        caption: format!("Each model's angle minus the arm's, joint {}, {}.", joint + 1, on.name),
        x: Axis::new("time (s)"),
        y: Axis::new("error (deg)"),
        series: series.collect(),
    }
}

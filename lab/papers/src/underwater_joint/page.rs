//! The page, for a reader of the paper.

use super::arms::{DIAGNOSED, IMPROVED, NONE, PERFECT, PUBLISHED, REFITTED};
use super::estimation::SPEEDS_RPM;
use super::goals::ReductionGoal;
use super::harm::Circumstance;
use super::parameter_transfer::TransferResult;
use super::tasks::{Course, RPM, Task};
use super::{JointStudy, WATER_C, harm};
use crate::row::percent;
use friction_fit::Estimate;
use friction_results::report::{Axis, Block, Cell, Chart, Section, Series, Table, thin_series};
use joint_log::number::significant;

/// Maximum number of points of a curve.
const MAX_CURVE_POINTS: usize = 800;

/// Sample period of the bench logs, s.
const BENCH_PERIOD_S: f64 = 0.004;

/// Returns all blocks below the summary.
pub fn blocks(study: &JointStudy, goals: &[ReductionGoal]) -> Vec<Block> {
    let against = Section::new("Against the LuGre fitted as published").table(goal_table(goals));
    let method = Section::new("Method")
        .list(how(study))
        .details("The models, as identified", [models(study).into()]);
    let estimation = Section::new("Estimation (Fig. 4 and 6)")
        .chart(errors(study))
        .with([Block::Row(mean_curves(study))]);
    let tasks = study.tasks.iter().map(|(task, _)| {
        Section::new(format!("{} ({})", task.title(), task.figure()))
            .with([Block::Row(courses(study, *task))])
    });
    let found = study.diagnosis.findings.iter().map(|finding| finding.in_words.clone());
    let found = found.chain(study.diagnosis.log.notes.iter().cloned());
    let transfers = study.transfers.iter().map(closed_chart).collect();
    let last = [
        Section::new("Result of the diagnosis").list(found),
        Section::new("Parameters into the running joint").with([Block::Row(transfers)]),
        Section::new("Harm").chart(harm_chart(study)).table(harm_table(study)),
        Section::new("The plant").details(
            "Every constant of the simulated joint, with its source",
            [plant(study).into()],
        ),
    ];
    [against, method, estimation].into_iter().chain(tasks).chain(last).flatten().collect()
}

fn how(study: &JointStudy) -> Vec<String> {
    let amount = &study.amount;
    vec![
        format!(
            "Bench runs of the simulated joint in random order: 8 without side load and pressure, {} of a full factorial of \
             speed, side load, pressure and brake, each in water of another temperature ({} to {} degC, which the paper does not \
             vary), and of each of the paper's 8 kinds {} repeats to fit and {} to evaluate.",
            if amount.both_motions { 48 } else { 24 },
            WATER_C[0],
            WATER_C[1],
            amount.learned,
            amount.held_out
        ),
        "Every model but the first and the last is identified from these runs and not from the truth. \"LuGre, as published\" is \
         fitted on the unloaded runs alone, as in II-B; the others on all of them. The perfect model is the plant's own friction, \
         compensated by an ideal actuator at the same share (0.9) as all arms and within the driver's current limit."
            .into(),
        "The loop contains the shipped driver: its CAN frames, background loop, current loop at 20 kHz and compensator, compiled for \
         this PC. Velocity and position loops run above it at 1 kHz, with crossovers at 2 and 1 Hz and feedforward of inertia and \
         weight; they are the same for all arms."
            .into(),
        "The perfect model is no lower bound of a task: it cancels friction, and friction also damps. If a task gets worse with \
         less friction, the perfect model shows it."
            .into(),
    ]
}

/// Table of each arm's fit.
fn models(study: &JointStudy) -> Table {
    let rows = study.arms.iter().filter_map(|arm| {
        let fit = arm.fit.as_ref()?;
        let value = |of: &Estimate| {
            format!("{} {} {}", of.id.name(), significant(of.value, 3), of.id.unit())
        };
        let values: Vec<String> = fit.estimates.iter().map(value).collect();
        Some(vec![
            arm.name.into(),
            fit.spec.to_string().into(),
            fit.train.rmse.into(),
            values.join(", ").into(),
        ])
    });
    let caption = "Fitted on the bench runs of the simulated joint";
    Table::new(caption, "arm|model|error on its own rows (Nm)|parameters", rows)
}

/// Table of the changes against the LuGre fitted as published.
pub fn goal_table(goals: &[ReductionGoal]) -> Table {
    let row = |goal: &ReductionGoal| {
        let optional = |value: Option<String>| value.map_or(Cell::Empty, Cell::from);
        vec![
            goal.what.clone().into(),
            percent(goal.printed).into(),
            percent(goal.diagnosed).into(),
            if goal.is_reached() { "reached" } else { "missed" }.into(),
            percent(goal.improved).into(),
            percent(goal.refitted).into(),
            optional(goal.perfect.map(percent)),
            optional(goal.over_perfect.map(|of| format!("{of:.2}"))),
        ]
    };
    let caption = "Change against the plain LuGre fitted as in the paper (simulated)";
    let header = "|paper|diagnosed||improved LuGre|refitted alone|perfect|over the perfect";
    Table::new(caption, header, goals.iter().map(row))
}

fn errors(study: &JointStudy) -> Chart {
    let series = study.errors.iter().map(|(arm, errors)| {
        let x = (0..errors.len()).map(|at| at as f64).collect();
        let bars = Series::bars(*arm, x, errors.iter().map(|error| error.mean).collect());
        bars.with_error(errors.iter().map(|error| error.deviation).collect())
    });
    Chart {
        title: "Estimation error on held-out runs (simulated)".into(),
        caption: "Mean curve measured against mean curve estimated, as a share of the friction; error bars over groups of repeats. \
                  The paper prints 3.54, 5.95, 9.95 % for its LuGre and 2.19, 1.63, 3.31 % for the improved one."
            .into(),
        x: Axis::of_names("", SPEEDS_RPM.map(|rpm| format!("{rpm} rpm"))),
        y: Axis::new("estimation error (%)"),
        series: series.collect(),
    }
}

fn mean_curves(study: &JointStudy) -> Vec<Chart> {
    let Some((_, first)) = study.curves.first() else { return Vec::new() };
    let chart = |rpm: f64| {
        let last = |kinds: &[super::estimation::Curves]| {
            kinds.iter().rev().find(|of| of.rpm == rpm).cloned().unwrap_or_default()
        };
        let measured = last(first).measured;
        let time = |rows: usize| (0..rows).map(|row| row as f64 * BENCH_PERIOD_S).collect();
        let mut series = vec![Series::line("measured", time(measured.len()), measured).muted()];
        series.extend(study.curves.iter().map(|(arm, kinds)| {
            let estimated = last(kinds).estimated;
            Series::line(*arm, time(estimated.len()), estimated)
        }));
        Chart {
            title: format!("{rpm} rpm, high side load and pressure (simulated)"),
            caption: "Mean over the held-out repeats of the last kind at this speed.".into(),
            x: Axis::new("time (s)"),
            y: Axis::new("friction torque (Nm)"),
            series,
        }
    };
    SPEEDS_RPM.map(chart).to_vec()
}

fn courses(study: &JointStudy, task: Task) -> Vec<Chart> {
    let results = study.task(task);
    let Some(first) = results.first() else { return Vec::new() };
    // Seven lines would hide each other.
    let shown = [NONE, PUBLISHED, REFITTED, IMPROVED, DIAGNOSED, PERFECT];
    let curves = |values: &dyn Fn(&Course) -> Vec<f64>| -> Vec<Series> {
        let drawn = results.iter().filter(|result| shown.contains(&result.arm));
        drawn.map(|result| curve(result.arm, &result.course, &values(&result.course))).collect()
    };
    let with_reference = |values: &[f64], of_arms: &dyn Fn(&Course) -> Vec<f64>| {
        let mut series = vec![curve("reference", &first.course, values).muted()];
        series.extend(curves(of_arms));
        series
    };
    let rpm = |values: &[f64]| values.iter().map(|v| v / RPM).collect::<Vec<_>>();
    let chart = |title: &str, caption: &str, y: &str, series: Vec<Series>| Chart {
        title: format!("{title} (simulated, first seed)"),
        caption: caption.into(),
        x: Axis::new("time (s)"),
        y: Axis::new(y),
        series,
    };
    let speeds =
        with_reference(&rpm(&first.course.reference_rad_s), &|course| rpm(&course.velocity_rad_s));
    let second = match task {
        Task::Impact => chart(
            "Position",
            "The paper's Fig. 11: time to the target, and overshoot.",
            "position (rad)",
            with_reference(&first.course.reference_rad, &|course| course.position_rad.clone()),
        ),
        _ => chart(
            "Velocity error",
            "Actual minus reference.",
            "velocity error (rpm)",
            curves(&velocity_error_rpm),
        ),
    };
    let caption = "Velocity of the joint and its reference.";
    vec![chart("Velocity", caption, "velocity (rpm)", speeds), second]
}

/// Returns a thinned curve over the time of a course.
fn curve(name: &str, course: &Course, values: &[f64]) -> Series {
    let (x, y) = thin_series(&course.time_s, values, MAX_CURVE_POINTS);
    Series::line(name, x, y)
}

fn velocity_error_rpm(course: &Course) -> Vec<f64> {
    let pairs = course.velocity_rad_s.iter().zip(&course.reference_rad_s);
    pairs.map(|(is, reference)| (is - reference) / RPM).collect()
}

fn closed_chart(of: &TransferResult) -> Chart {
    let names = ["before: LuGre as published", "after: diagnosed set"];
    let error = |(name, course): (&str, &Course)| curve(name, course, &velocity_error_rpm(course));
    Chart {
        title: format!("{}: before and after (simulated, first seed)", of.task.title()),
        caption: "The same driver on the same joint: first with the LuGre fitted as published, then with the diagnosed set, \
                  written over its bus without a restart."
            .into(),
        x: Axis::new("time (s)"),
        y: Axis::new("velocity error (rpm)"),
        series: names.into_iter().zip(&of.courses).map(error).collect(),
    }
}

fn harm_chart(study: &JointStudy) -> Chart {
    let known: Vec<_> = study.harm.iter().filter_map(|of| Some((of, of.tracking_ratio?))).collect();
    let series = harm::TASKS.iter().enumerate().map(|(at, task)| {
        let places = (0..known.len()).map(|at| at as f64).collect();
        Series::bars(
            task.title(),
            known.iter().map(|(_, tracking_ratio)| tracking_ratio[at]).collect(),
            places,
        )
    });
    Chart {
        title: "Velocity error with the diagnosed model over that without compensation (simulated)"
            .into(),
        caption: "Each circumstance with and without compensation. Above 1.05 the compensation does harm.".into(),
        x: Axis::new("error over that without compensation"),
        y: Axis::of_names("", known.iter().map(|(of, _)| of.name.clone())),
        series: series.collect(),
    }
}

fn harm_table(study: &JointStudy) -> Table {
    let row =
        |of: &Circumstance| {
            // A rejected set has no results.
            let met = |value: f64| of.tracking_ratio.map(|_| value).into();
            let mut row = vec![Cell::from(of.name.clone())];
            row.extend((0..harm::TASKS.len()).map(|task| {
                Cell::from(of.tracking_ratio.map(|tracking_ratio| tracking_ratio[task]))
            }));
            row.extend([
                of.jump_position_ratio.into(),
                met(1e3 * of.swing_rad),
                met(1e3 * of.swing_without_rad),
                met(of.largest_a),
                of.reported_s.into(),
                Cell::from(match (of.tracking_ratio, of.is_harmless()) {
                    (None, _) => "rejected",
                    (_, false) => "breaks a requirement",
                    _ if of.stopped => "harmless; stopped",
                    _ => "harmless",
                }),
            ]);
            row
        };
    Table::new(
        "The map of harm (simulated): velocity error over that without compensation in each task; swing while holding, with \
         and without; largest current; when the driver itself reported \"model out of band\" in the sine",
        "circumstance|lifting|sine|jump|jump, position|swing (mrad)|without (mrad)|current (A)|reported (s)|",
        study.harm.iter().map(row),
    )
}

fn plant(study: &JointStudy) -> Table {
    let entries = study.parameters.table().into_iter();
    let rows = entries.map(|entry| {
        vec![entry.name.into(), entry.value.into(), entry.unit.into(), entry.source.into()]
    });
    Table::new("Constants of the simulated joint", "constant|value|unit|source", rows)
}

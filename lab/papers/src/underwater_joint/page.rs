//! The page, for a reader of the paper.

use super::arms::{DIAGNOSED, IMPROVED, NONE, PERFECT, PUBLISHED, REFITTED};
use super::estimation::SPEEDS_RPM;
use super::goals::ReductionGoal;
use super::parameter_transfer::TransferResult;
use super::tasks::{Course, RPM, Task};
use super::{JointStudy, WATER_C, harm};
use crate::row::percent;
use friction_results::report::{Axis, Block, Cell, Chart, Series, Table, thin_series};
use joint_log::number::significant;

/// Maximum number of points of a curve.
const MAX_CURVE_POINTS: usize = 800;

/// Sample period of the bench logs, s.
const BENCH_PERIOD_S: f64 = 0.004;

/// Returns all blocks below the summary.
pub fn blocks(study: &JointStudy, goals: &[ReductionGoal]) -> Vec<Block> {
    let mut blocks = vec![
        Block::Heading("Against the LuGre fitted as published".into()),
        Block::Table(goal_table(goals)),
    ];
    blocks.push(Block::Heading("Method".into()));
    blocks.push(Block::List(how(study)));
    blocks.push(models(study));
    blocks.push(Block::Heading("Estimation (Fig. 4 and 6)".into()));
    blocks.push(Block::Chart(errors(study)));
    blocks.push(Block::Row(mean_curves(study)));
    for (task, _) in &study.tasks {
        blocks.push(Block::Heading(format!("{} ({})", task.title(), task.figure())));
        blocks.push(Block::Row(courses(study, *task)));
    }
    blocks.push(Block::Heading("Result of the diagnosis".into()));
    let found = study.diagnosis.findings.iter().map(|finding| finding.in_words.clone());
    blocks.push(Block::List(found.chain(study.diagnosis.log.notes.iter().cloned()).collect()));
    blocks.push(Block::Heading("Parameters into the running joint".into()));
    blocks.push(Block::Row(study.transfers.iter().map(closed_chart).collect()));
    blocks.push(Block::Heading("Harm".into()));
    blocks.push(Block::Chart(harm_chart(study)));
    blocks.push(harm_table(study));
    blocks.push(Block::Heading("The plant".into()));
    blocks.push(Block::Details {
        summary: "Every constant of the simulated joint, with its source".into(),
        blocks: vec![plant(study)],
    });
    blocks
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
fn models(study: &JointStudy) -> Block {
    let rows = study.arms.iter().filter_map(|arm| {
        let fit = arm.fit.as_ref()?;
        let values = fit
            .estimates
            .iter()
            .map(|of| format!("{} {} {}", of.id.name(), significant(of.value, 3), of.id.unit()));
        Some(vec![
            Cell::from(arm.name),
            Cell::from(fit.spec.to_string()),
            Cell::Number(fit.train.rmse),
            Cell::from(values.collect::<Vec<_>>().join(", ")),
        ])
    });
    Block::Details {
        summary: "The models, as identified".into(),
        blocks: vec![Block::Table(Table {
            caption: "Fitted on the bench runs of the simulated joint".into(),
            header: ["arm", "model", "error on its own rows (Nm)", "parameters"]
                .map(str::to_owned)
                .to_vec(),
            rows: rows.collect(),
            best: Vec::new(),
        })],
    }
}

/// Table of the changes against the LuGre fitted as published.
pub fn goal_table(goals: &[ReductionGoal]) -> Table {
    let header = [
        "",
        "paper",
        "diagnosed",
        "",
        "improved LuGre",
        "refitted alone",
        "perfect",
        "over the perfect",
    ];
    let rows = goals.iter().map(|goal| {
        let optional = |value: Option<String>| value.map_or(Cell::Empty, Cell::from);
        vec![
            Cell::from(goal.what.clone()),
            Cell::from(percent(goal.printed)),
            Cell::from(percent(goal.diagnosed)),
            Cell::from(if goal.is_reached() { "reached" } else { "missed" }),
            Cell::from(percent(goal.improved)),
            Cell::from(percent(goal.refitted)),
            optional(goal.perfect.map(percent)),
            optional(goal.over_perfect.map(|of| format!("{of:.2}"))),
        ]
    });
    Table {
        caption: "Change against the plain LuGre fitted as in the paper (simulated)".into(),
        header: header.map(str::to_owned).to_vec(),
        rows: rows.collect(),
        best: Vec::new(),
    }
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
    let reference = &first.course;
    // Seven lines would hide each other.
    let shown = [NONE, PUBLISHED, REFITTED, IMPROVED, DIAGNOSED, PERFECT];
    let line = |name: &str, x: &[f64], y: Vec<f64>| {
        let (x, y) = thin_series(x, &y, MAX_CURVE_POINTS);
        Series::line(name, x, y)
    };
    let own = || results.iter().filter(|result| shown.contains(&result.arm));
    let seconds = &reference.time_s;
    let speeds = |values: &[f64]| values.iter().map(|v| v / RPM).collect::<Vec<_>>();
    let velocity = Chart {
        title: "Velocity (simulated, first seed)".into(),
        caption: "Velocity of the joint and its reference.".into(),
        x: Axis::new("time (s)"),
        y: Axis::new("velocity (rpm)"),
        series: std::iter::once(
            line("reference", seconds, speeds(&reference.reference_rad_s)).muted(),
        )
        .chain(own().map(|of| line(of.arm, seconds, speeds(&of.course.velocity_rad_s))))
        .collect(),
    };
    let second = match task {
        Task::Impact => Chart {
            title: "Position (simulated, first seed)".into(),
            caption: "The paper's Fig. 11: time to the target, and overshoot.".into(),
            x: Axis::new("time (s)"),
            y: Axis::new("position (rad)"),
            series: std::iter::once(
                line("reference", seconds, reference.reference_rad.clone()).muted(),
            )
            .chain(own().map(|of| line(of.arm, seconds, of.course.position_rad.clone())))
            .collect(),
        },
        _ => {
            let error = |of: &super::experiments::TaskResult| {
                let pairs = of.course.velocity_rad_s.iter().zip(&of.course.reference_rad_s);
                pairs.map(|(is, reference)| (is - reference) / RPM).collect::<Vec<_>>()
            };
            Chart {
                title: "Velocity error (simulated, first seed)".into(),
                caption: "Actual minus reference.".into(),
                x: Axis::new("time (s)"),
                y: Axis::new("velocity error (rpm)"),
                series: own().map(|of| line(of.arm, seconds, error(of))).collect(),
            }
        }
    };
    vec![velocity, second]
}

fn closed_chart(of: &TransferResult) -> Chart {
    let error = |name: &str, course: &Course| {
        let pairs = course.velocity_rad_s.iter().zip(&course.reference_rad_s);
        let errors: Vec<f64> = pairs.map(|(is, reference)| (is - reference) / RPM).collect();
        let (x, y) = thin_series(&course.time_s, &errors, MAX_CURVE_POINTS);
        Series::line(name, x, y)
    };
    let [before, after] = &of.courses;
    Chart {
        title: format!("{}: before and after (simulated, first seed)", of.task.title()),
        caption: "The same driver on the same joint: first with the LuGre fitted as published, then with the diagnosed set, \
                  written over its bus without a restart."
            .into(),
        x: Axis::new("time (s)"),
        y: Axis::new("velocity error (rpm)"),
        series: vec![error("before", before), error("after params set", after)],
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

fn harm_table(study: &JointStudy) -> Block {
    let rows = study.harm.iter().map(|of| {
        // A rejected set has no results.
        let met = |value: f64| of.tracking_ratio.map(|_| value).into();
        let mut row = vec![Cell::from(of.name.clone())];
        row.extend(
            (0..harm::TASKS.len())
                .map(|at| Cell::from(of.tracking_ratio.map(|tracking_ratio| tracking_ratio[at]))),
        );
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
    });
    let header = [
        "circumstance",
        "lifting",
        "sine",
        "jump",
        "jump, position",
        "swing (mrad)",
        "without (mrad)",
        "current (A)",
        "reported (s)",
        "",
    ];
    Block::Table(Table {
        caption: "The map of harm (simulated): velocity error over that without compensation in each task; swing while holding, with \
                  and without; largest current; when the driver itself reported \"model out of band\" in the sine"
            .into(),
        header: header.map(str::to_owned).to_vec(),
        rows: rows.collect(),
        best: Vec::new(),
    })
}

fn plant(study: &JointStudy) -> Block {
    let rows = study.parameters.table().into_iter().map(|entry| {
        vec![
            Cell::from(entry.name),
            Cell::Number(entry.value),
            Cell::from(entry.unit),
            Cell::from(entry.source),
        ]
    });
    Block::Table(Table {
        caption: "Constants of the simulated joint".into(),
        header: ["constant", "value", "unit", "source"].map(str::to_owned).to_vec(),
        rows: rows.collect(),
        best: Vec::new(),
    })
}

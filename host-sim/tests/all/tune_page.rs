//! The files of a tuning session, from an artificial session with the sizes of a real one.
//!
//! They are left in the target folder's `tmp/tune`, to be looked at; `tests/schemas/run` validates `tune.json` there.

use crate::browser::chromium;
use crate::drawn_chart::{charts, sentences, without_scripts};
use crate::report_browser::{framed, read_frame};
use crate::snapshot;
use friction_results::Files;
use friction_results::report::{Axis, Block, Chart, Page, Series};
use friction_results::tune::*;
use joint_log::ReadOptions;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::Value;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

const HOSTILE: &str = "<script>alert(1)</script> & \"side\"";

/// Duration of the motion of the trial, s, and time between its rows, s.
const MOTION_S: f64 = 10.0;
const PERIOD_S: f64 = 1e-3;

/// Demanded position, rad, and velocity, rad/s: a slow triangle, then a sine through reversals.
fn demand(time: f64) -> [f64; 2] {
    if time < 5.0 {
        let phase = (time / 5.0 + 0.25).fract();
        let slope = if phase < 0.5 { 1.0 } else { -1.0 };
        [0.4 * slope * (4.0 * phase.rem_euclid(0.5) - 1.0), 0.32 * slope]
    } else {
        let phase = TAU * 0.6 * (time - 5.0);
        [0.4 * phase.sin(), 0.4 * TAU * 0.6 * phase.cos()]
    }
}

/// A performance: `stick_rad` is the error that builds up after a reversal.
fn course(stick_rad: f64, lag_s: f64, seed: u64) -> TuneCourse {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut course = TuneCourse::default();
    let (mut bump, mut sign) = (0.0, 1.0);
    for row in 0..(MOTION_S / PERIOD_S) as usize {
        let time = row as f64 * PERIOD_S;
        let [position, velocity] = demand(time);
        if velocity.signum() != sign {
            (bump, sign) = (0.0, velocity.signum());
        }
        bump += PERIOD_S * (velocity.abs().min(stick_rad * 30.0) - bump / 0.06);
        let error = sign * (bump * stick_rad * 60.0).min(stick_rad) + lag_s * velocity;
        let noise = 2e-4 * (random.random::<f64>() - 0.5);
        course.time_s.push(time);
        course.demand_rad.push(position);
        course.position_rad.push(position - error + noise);
        course.current_a.push(1.4 * sign + 0.9 * velocity + 0.05 * random.random::<f64>());
    }
    course
}

fn gain(quantity: TuneQuantity, before: f64, after: f64, half: f64) -> TuneGain {
    let gain = 1.0 - after / before;
    TuneGain {
        quantity,
        unit: quantity.unit(),
        before,
        after,
        gain,
        ci95: [gain - half, gain + half],
    }
}

/// Order of the blocks.
const ORDER: &str = "ACBBCACBAABC";

fn blocks() -> Vec<TuneBlock> {
    let mut random = Pcg64Mcg::seed_from_u64(46);
    let block = |arm: TuneArm| {
        let [reversal, tracking, current, stuck] = match arm {
            TuneArm::Former => [0.012, 0.0041, 1.52, 0.35],
            TuneArm::NewLoop => [0.008, 0.0031, 1.51, 0.12],
            TuneArm::New => [0.004, 0.0022, 1.47, 0.02],
        };
        let mut spread = |value: f64| value * (0.94 + 0.12 * random.random::<f64>());
        let values = [spread(reversal), spread(tracking), spread(current), spread(stuck)];
        TuneBlock { arm, values }
    };
    let arm = |letter: char| TuneArm::ALL.into_iter().find(|arm| arm.letter().starts_with(letter));
    ORDER.chars().filter_map(arm).map(block).collect()
}

/// A velocity loop whose inertia has a resonance at 62 Hz.
fn control() -> TuneLoop {
    let at = |step: usize| {
        let frequency: f64 = 0.5 * 10f64.powf(step as f64 * 2.5 / 29.0);
        let inertia = 40.0 / (TAU * frequency);
        let near = 1.0 / ((1.0 - (frequency / 62.0).powi(2)).powi(2) + 0.01).sqrt();
        [frequency, inertia * near.max(0.2), -90.0 - 360.0 * frequency * 7e-4]
    };
    TuneLoop {
        inertia_kg_m2: 0.034,
        delay_s: 7e-4,
        resonance_hz: Some(62.0),
        velocity_noise_rad_s: 0.0021,
        crossover_hz: 18.0,
        phase_margin_deg: 55.0,
        gain_margin_db: 9.5,
        response: (0..30).map(at).collect(),
    }
}

fn texts<const N: usize>(pairs: [(&str, &str); N]) -> Vec<(String, String)> {
    pairs.map(|(name, value)| (name.to_owned(), value.to_owned())).into()
}

fn rounds() -> Vec<TuneRound> {
    let round = |motion: &str, seconds, why: &str| TuneRound {
        motion: motion.to_owned(),
        seconds,
        why: why.to_owned(),
    };
    vec![
        round("slow sweep ±0.05 rad", 40.0, "The stiffness before sliding was not known."),
        round(
            "steady speeds 0.05 to 1.5 rad/s",
            62.0,
            "Both directions at seven speeds give the curve over speed.",
        ),
        round(
            "dwells of 1 to 20 s",
            48.0,
            "It separates dwell-time-static (0.41) from direction-asymmetry (0.52).",
        ),
        round("multisine", 12.5, "The inertia and the delay of the loop were not known."),
    ]
}

fn parameters() -> Vec<TuneParameter> {
    let parameter = |name: &str, before: &str, after: &str| TuneParameter {
        name: name.to_owned(),
        before: before.to_owned(),
        after: after.to_owned(),
    };
    vec![
        parameter("coulomb_torque", "1.200 Nm", "1.482 Nm"),
        parameter("static_torque", "1.500 Nm", "1.911 Nm"),
        parameter("stribeck_velocity", "0.1000 rad/s", "0.0764 rad/s"),
        parameter("velocity_gain", "0.800 A s/rad", "1.320 A s/rad"),
    ]
}

/// A session that gained.
fn saved() -> TuneReport {
    TuneReport {
        joint: "can0, node 1".to_owned(),
        is_simulated: true,
        identity: texts([
            ("serial number", "0x00A1B2C3"),
            ("firmware", "0.2.0, STM32G474"),
            ("range of position", "−0.45 to 0.45 rad"),
            ("reaction to a stop", "slow down on the ramp, then disarm"),
            ("temperature of the bridge", "31 °C"),
            ("name", HOSTILE),
        ]),
        outcome: TuneOutcome::Saved,
        cause: "direction-asymmetry".to_owned(),
        probability: 0.934,
        gains: vec![
            gain(TuneQuantity::ReversalError, 0.012, 0.004, 0.06),
            gain(TuneQuantity::TrackingRms, 0.0041, 0.0022, 0.05),
            gain(TuneQuantity::CurrentRms, 1.52, 1.47, 0.051),
            gain(TuneQuantity::StuckTime, 0.35, 0.02, 0.04),
        ],
        arm: TuneArm::New,
        parts: TuneParts {
            loop_gains: vec![
                gain(TuneQuantity::ReversalError, 0.012, 0.008, 0.05),
                gain(TuneQuantity::TrackingRms, 0.0041, 0.0031, 0.04),
                gain(TuneQuantity::CurrentRms, 1.52, 1.51, 0.05),
                gain(TuneQuantity::StuckTime, 0.35, 0.12, 0.05),
            ],
            friction_model: vec![
                gain(TuneQuantity::ReversalError, 0.008, 0.004, 0.06),
                gain(TuneQuantity::TrackingRms, 0.0031, 0.0022, 0.05),
                gain(TuneQuantity::CurrentRms, 1.51, 1.47, 0.05),
                gain(TuneQuantity::StuckTime, 0.12, 0.02, 0.05),
            ],
        },
        rounds: rounds(),
        not_learnt: vec![
            "Pressure did not vary: its effect is unknown.".to_owned(),
            "Side load did not vary: its effect is unknown.".to_owned(),
            "Temperature varied by 1.2 °C only: its effect is unknown.".to_owned(),
        ],
        trial: TuneTrial { blocks: blocks() },
        courses: [course(0.012, 0.003, 1), course(0.004, 0.002, 2)],
        control: Some(control()),
        parameters: parameters(),
        bounds_nm: [2.31, 1.98],
        warnings: vec!["The joint warmed by 1.2 °C during the trial.".to_owned()],
        seconds: 292.0,
    }
}

/// A session that found nothing better and lost some values.
fn returned() -> TuneReport {
    let mut report = saved();
    report.outcome =
        TuneOutcome::Returned(format!("the error at reversals did not fall, by {HOSTILE}"));
    report.gains = vec![
        gain(TuneQuantity::ReversalError, 0.012, 0.0118, 0.05),
        TuneGain {
            gain: f64::NAN,
            ci95: [f64::NAN; 2],
            after: f64::NAN,
            ..report.gains[1].clone()
        },
        gain(TuneQuantity::CurrentRms, 1.5, 1.8, 0.04),
        gain(TuneQuantity::StuckTime, 0.0, 0.0, 0.0),
    ];
    for gains in [&mut report.parts.loop_gains, &mut report.parts.friction_model] {
        gains[3] = gain(TuneQuantity::StuckTime, 0.0, 0.0, 0.0);
    }
    report.trial.blocks.iter_mut().for_each(|block| block.values[3] = 0.0);
    report.trial.blocks[3].values = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0];
    report.trial.blocks[4].values[0] = f64::NAN;
    report.courses[1].position_rad[500] = f64::NAN;
    report.not_learnt.extend((1..5).map(|number| format!("Column {number} did not vary.")));
    report.probability = f64::NAN;
    report.bounds_nm = [f64::NAN, f64::INFINITY];
    let mut control = control();
    control.response[7] = [3.0, f64::NAN, f64::INFINITY];
    control.resonance_hz = None;
    control.phase_margin_deg = f64::NAN;
    report.control = Some(control);
    report
}

/// A page in place of that of a diagnosis, with the same kinds of blocks.
fn diagnosis() -> Page {
    let chart = Chart {
        title: "Error above the noise floor".to_owned(),
        x: Axis::new("RMSE (Nm)"),
        y: Axis::of_names("", ["before", "after"]),
        series: vec![
            Series::bars("before", vec![0.12], vec![0.0]),
            Series::bars("after", vec![0.03], vec![1.0]),
        ],
        ..Chart::default()
    };
    let mut page = Page::new("direction-asymmetry", "runs.parquet");
    page.push(Block::Lead {
        facts: texts([("Cause", "one direction rubs harder")]),
        charts: vec![chart],
    });
    page.push(Block::Contents).push(Block::Heading("Evidence".into()));
    page
}

/// Recorded rows; the second run lacks the temperature and ends early in a column.
fn runs() -> Vec<TuneRun> {
    let course = course(0.012, 0.003, 3);
    let rows = 2000;
    let column = |name: &str, values: &dyn Fn(usize) -> f64| {
        (name.to_owned(), (0..rows).map(values).collect::<Vec<f64>>())
    };
    let mut first = TuneRun {
        name: "slow sweep ±0.05 rad".to_owned(),
        columns: vec![
            column("demand_rad", &|row| course.demand_rad[row]),
            column("torque_nm", &|row| 0.1 * course.current_a[row]),
            column("velocity_rad_s", &|row| demand(row as f64 * PERIOD_S)[1]),
            column("position_rad", &|row| course.position_rad[row]),
            column("current_a", &|row| course.current_a[row]),
            column("temperature_c", &|row| 21.0 + 1e-3 * row as f64),
            column("radial_force_n", &|_| f64::NAN),
            column("time_s", &|row| row as f64 * PERIOD_S),
        ],
    };
    let mut second = first.clone();
    second.columns.retain(|(name, _)| name != "temperature_c");
    second.columns[4].1.truncate(rows - 1);
    first.columns[5].1[3] = f64::NAN;
    vec![first, second]
}

/// Writes the files of a session and returns their folder.
fn written(name: &str, report: &TuneReport) -> (PathBuf, Files) {
    let texts = vec![("before.toml", "# before\n".to_owned())];
    let files = report.files(&runs(), Some(diagnosis()), texts).expect("files");
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    files.write(&folder).expect("written");
    (folder, files)
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[test]
fn page_of_a_gain_has_each_change_with_its_interval() {
    let report = saved();
    let page = report.page(Some(diagnosis())).render();
    let visible = without_scripts(&page);
    snapshot::check("tune-page", "a gain", &sentences(&page));
    for text in [
        "can0, node 1",
        "4\u{a0}min 52\u{a0}s",
        "−67\u{a0}%</p><p class=\"note\">12.0 → 4.00\u{a0}mrad</p><p class=\"note\">95\u{a0}%: −73 to −61\u{a0}%",
        "−46\u{a0}%</p><p class=\"note\">4.10 → 2.20\u{a0}mrad</p><p class=\"note\">95\u{a0}%: −51 to −41\u{a0}%",
        "−3.3\u{a0}%</p><p class=\"note\">1.52 → 1.47\u{a0}A</p><p class=\"note\">95\u{a0}%: −8.4 to +1.8\u{a0}%</p><p class=\"note\">",
        "−94\u{a0}%</p><p class=\"note\">0.350 → 0.0200\u{a0}s</p><p class=\"note\">95\u{a0}%: −98 to −90\u{a0}%",
        "(direction-asymmetry), probability 0.93",
        &report.not_learnt[0],
        &report.warnings[0],
        &report.rounds[2].why,
        "A C B B C A C B A A B C",
        "loop gains −33\u{a0}%, then model −50\u{a0}%",
        "−33\u{a0}% (−38 to −28\u{a0}%)",
        "2.31\u{a0}Nm",
        "1.98\u{a0}Nm",
        "velocity_gain",
        "0.0764 rad/s",
        "62.0\u{a0}Hz",
        "one direction rubs",
    ] {
        assert!(visible.contains(text), "{text}");
    }
    assert!(visible.contains(&escaped(HOSTILE)) && !visible.contains("<script>alert"));
}

#[test]
fn charts_show_errors_blocks_and_response_of_the_session() {
    let report = saved();
    let visible = without_scripts(&report.page(None).render());
    let charts = charts(&visible);
    let titled = |title: &str| charts.iter().find(|chart| chart.title == title).expect(title);
    let largest = |series: &str| {
        let drawn = charts[0].named(series).expect(series);
        drawn.along(1).into_iter().fold(0.0, |most: f64, value| most.max(value.abs()))
    };
    let error = |course: &TuneCourse| {
        let pairs = course.demand_rad.iter().zip(&course.position_rad);
        pairs.fold(0.0, |most: f64, (demand, is)| most.max(1e3 * (demand - is).abs()))
    };
    let [before, after] = report.courses.each_ref().map(error);
    assert!(before > 1.5 * after, "{before} mrad, {after} mrad");
    assert!((largest("before") - before).abs() < 0.01, "{} instead of {before}", largest("before"));
    assert!((largest("after") - after).abs() < 0.01, "{} instead of {after}", largest("after"));
    // On the same time axis as the error.
    assert_eq!(charts[1].named("demanded position").map(|series| series.parts.len()), Some(1));
    let strip = titled("Time stuck");
    assert_eq!(strip.named("after").expect("after").along(0).len(), 4);
    assert_eq!(strip.named("new loop gains alone").expect("a series").along(0).len(), 4);
    let magnitude = &titled("Magnitude").series[0];
    assert_eq!((magnitude.along(0).len(), titled("Phase").series[0].along(0).len()), (30, 30));
    assert!((magnitude.along(0)[0] - 0.5).abs() < 0.01, "{:?}", magnitude.along(0));
}

#[test]
fn page_of_a_returned_set_says_why_and_shows_no_value_that_was_not_measured() {
    let report = returned();
    let page = report.page(None).render();
    let visible = without_scripts(&page);
    snapshot::check("tune-page", "a returned set", &sentences(&page));
    let TuneOutcome::Returned(why) = &report.outcome else { panic!("{:?}", report.outcome) };
    // The reason is a sentence of its own.
    let why = format!("T{}.", escaped(&why[1..]));
    for text in [
        "can0, node 1",
        "4 new values",
        "12 blocks",
        &why,
        "–</p><p class=\"note\">4.10\u{a0}mrad → not measured",
        "+20\u{a0}%</p><p class=\"note\">1.50 → 1.80\u{a0}A</p><p class=\"note\">95\u{a0}%: +16 to +24\u{a0}%",
        "158\u{a0}Hz",
        "And 3 more",
        report.not_learnt.last().expect("a column"),
    ] {
        assert!(visible.contains(text), "{text}");
    }
    assert!(!visible.contains("Time stuck"), "it was never stuck");
    // Attributes and texts: style sheet and scripts are not of this session.
    let body = visible.split_once("<body>").expect("a body").1;
    for number in ["NaN", "inf", "∞"] {
        let in_words = ["information", "confirm"];
        let mut rest = body.to_owned();
        in_words.iter().for_each(|word| rest = rest.replace(word, ""));
        assert!(!rest.contains(number), "{number}");
    }
    let gap = charts(&visible).into_iter().find(|chart| chart.title == "Magnitude").expect("drawn");
    assert_eq!(gap.series[0].parts.len(), 2);
}

#[test]
fn page_without_anything_measured_has_no_chart() {
    let report = TuneReport {
        outcome: TuneOutcome::Returned("the joint has no position window".to_owned()),
        cause: "none".to_owned(),
        gains: Vec::new(),
        parts: TuneParts::default(),
        rounds: Vec::new(),
        not_learnt: Vec::new(),
        trial: TuneTrial::default(),
        courses: [TuneCourse::default(), TuneCourse::default()],
        control: None,
        parameters: Vec::new(),
        warnings: Vec::new(),
        identity: Vec::new(),
        ..saved()
    };
    let page = report.page(None).render();
    assert!(charts(&page).is_empty());
    assert!(page.contains("no position window"), "the reason is there");
    snapshot::check("tune-page", "nothing measured", &sentences(&page));
    let files = report.files(&[], None, Vec::new()).expect("files");
    let names: Vec<&str> = files.all().map(|(name, _)| name).collect();
    assert_eq!(names, ["tune.html", "tune.json"]);
}

#[test]
fn document_has_the_keys_of_the_contract_and_null_for_missing_values() {
    let (_, files) = written("tune", &saved());
    let document: Value = serde_json::from_str(&files.document.1).expect("JSON");
    let at = |path: &str| document.pointer(path).unwrap_or_else(|| panic!("{path}")).clone();
    assert_eq!(
        (at("/schema"), at("/saved"), at("/cause")),
        (1.into(), true.into(), "direction-asymmetry".into())
    );
    assert_eq!((at("/trial/blocks"), at("/trial/order")), (12.into(), ORDER.into()));
    assert_eq!(
        (at("/gains/0/quantity"), at("/gains/3/quantity")),
        ("reversal-error".into(), "stuck-time".into())
    );
    assert_eq!((at("/trial/values/1/set"), at("/handed_over")), ("C".into(), "both".into()));
    assert_eq!(at("/parts/friction_model/0/quantity"), "reversal-error");
    assert_eq!((at("/rounds/3/seconds"), at("/not_learnt/0").is_string()), (12.5.into(), true));
    assert!(document.get("why_not").is_none());
    let (_, files) = written("tune-returned", &returned());
    let text = &files.document.1;
    let document: Value = serde_json::from_str(text).expect("JSON");
    assert_eq!(document.pointer("/gains/1/ci95"), Some(&serde_json::json!([null, null])));
    assert_eq!(document.pointer("/trial/values/3/values/1"), Some(&Value::Null));
    assert!(document["why_not"].is_string() && document["probability"].is_null());
    assert_eq!(document["saved"], false);
}

#[test]
fn rows_are_a_log_with_the_runs_as_recorded() {
    let (folder, files) = written("tune-rows", &saved());
    let names: Vec<&str> = files.all().map(|(name, _)| name).collect();
    assert_eq!(names, ["tune.html", "runs.parquet", "before.toml", "tune.json"]);
    let file = folder.join("runs.parquet");
    let log = joint_log::read(&[file], &ReadOptions::default(), &|_, _| {}).expect("a log");
    let recorded = runs();
    let names: Vec<&str> = log.runs.iter().map(|run| run.name.as_str()).collect();
    assert_eq!(names, [recorded[0].name.clone(), format!("{} (2)", recorded[0].name)]);
    for (run, recorded) in log.runs.iter().zip(&recorded) {
        let column =
            |name: &str| &recorded.columns.iter().find(|(known, _)| known == name).expect(name).1;
        assert_eq!((&run.time_s, &run.torque), (column("time_s"), column("torque_nm")));
        assert_eq!(log.column(run, "velocity_rad_s"), Some(&column("velocity_rad_s")[..]));
        assert_eq!(log.column(run, "position_rad"), Some(&column("position_rad")[..]));
    }
    // The demand is no cause of friction, and nothing was measured of the side load.
    assert_eq!(log.covariates, ["current_a"]);
    let left_out: Vec<&str> =
        log.left_out_columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(left_out, ["demand_rad", "temperature_c"]);
}

#[test]
fn first_screen_needs_no_scrolling_and_narrow_page_has_no_overflow() {
    let Some(chromium) = chromium() else { return };
    for report in [saved(), returned()] {
        let (folder, _) = written("tune-browser", &report);
        let page = folder.join("tune.html");
        let said = read_frame(&chromium, &framed(&page, 1280));
        let bottom: f64 = said("bottom").and_then(|text| text.parse().ok()).expect("a lead");
        assert!((400.0..=720.0).contains(&bottom), "{bottom} px");
        let said = read_frame(&chromium, &framed(&page, 380));
        assert_eq!((said("out").as_deref(), said("beyond").as_deref()), (Some(""), Some("0")));
    }
}

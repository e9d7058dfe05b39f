//! Checks of a log: each defect added to an exact log must be found with its size, and the exact log must have none.

use compensator_core::ParameterId;
use friction_diagnose::{Diagnosis, DiagnosisOptions, diagnose};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Loss, Rows, identify_robustly, tracks};
use joint_log::log_check::{Corrections, LogFinding, LogFindingKind, check};
use joint_log::{Dataset, Run, SplitRule, split};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const STEP_S: f64 = 0.002;
const ROWS: usize = 5000;
const RUNS: usize = 4;

/// Columns of a run: time, velocity, torque, position, and one that follows the torque.
type Columns = [Vec<f64>; 5];

const NAMES: [&str; 5] =
    ["time_s", "velocity_rad_s", "torque_nm", "position_rad", "gauge_torque_nm"];

/// Simulates a joint that oscillates with rests, faster in each run: bristles of 2 mrad, torque noise of 0.02 Nm.
fn exact(run: usize) -> Columns {
    let mut random = Pcg64::seed_from_u64(run as u64);
    let mut noise = move || -> f64 { (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0 };
    let mut columns: Columns = Default::default();
    let (mut angle, mut bristle, mut before) = (0.3 * run as f64, 0.0, 0.0);
    for row in 0..ROWS {
        let time = STEP_S * row as f64;
        // Swings of one second, of different size and hardness, and every fifth second a rest.
        let (second, share) = (time.floor() as usize, time.fract());
        let size = [0.4, 1.0, 0.05, 2.5, 0.0][(second + run) % 5];
        let swing =
            (std::f64::consts::TAU * share).sin() * (std::f64::consts::PI * share).sin().abs();
        let velocity = size * swing;
        for step in 1..=20 {
            let now = before + (velocity - before) * f64::from(step) / 20.0;
            let time = STEP_S / 20.0;
            bristle = (bristle + now * time) / (1.0 + 500.0 * now.abs() * time);
        }
        angle += 0.5 * STEP_S * (velocity + before);
        before = velocity;
        let torque = 750.0 * bristle + 0.3 * velocity;
        let values = [time, velocity, torque + 0.02 * noise(), angle, torque + 0.02 * noise()];
        columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
    }
    columns
}

fn log(spoil: impl Fn(usize, &mut Columns)) -> Dataset {
    let names = NAMES.map(str::to_owned);
    let runs = (0..RUNS).map(|run| {
        let mut columns = exact(run);
        spoil(run, &mut columns);
        (run.to_string(), columns.to_vec())
    });
    Dataset::from_columns(&names, runs).expect("the columns of a log")
}

fn found(spoil: impl Fn(usize, &mut Columns)) -> Vec<LogFinding> {
    check(log(spoil), Corrections::default()).findings
}

/// Returns the finding of a kind. Only the kinds in `beside` may be found as well.
fn only(findings: &[LogFinding], kind: LogFindingKind, beside: &[LogFindingKind]) -> LogFinding {
    for finding in findings {
        let expected = finding.kind == kind || beside.contains(&finding.kind);
        assert!(expected, "not in this log: {finding:?}");
    }
    let of_kind = findings.iter().find(|finding| finding.kind == kind);
    of_kind.unwrap_or_else(|| panic!("{} not found in {findings:?}", kind.name())).clone()
}

fn near(value: f64, expected: f64, within: f64) {
    assert!((value - expected).abs() < within, "{value}, expected {expected}");
}

/// Delays values by some rows.
fn late(values: &[f64], rows: usize) -> Vec<f64> {
    (0..values.len()).map(|row| values[row.saturating_sub(rows)]).collect()
}

#[test]
fn check_with_exact_log_finds_nothing_and_returns_it_unchanged() {
    let checked = check(log(|_, _| ()), Corrections::default());
    assert_eq!(checked.findings, []);
    assert!(checked.sensors.exact);
    for (run, before) in checked.data.runs.iter().zip(log(|_, _| ()).runs) {
        assert!(run.velocity_is_smooth, "and is known to be");
        assert_eq!(*run, Run { velocity_is_smooth: true, ..before });
    }
}

#[test]
fn check_with_noisy_velocity_reports_and_reconstructs_it() {
    let spoil = |run: usize, columns: &mut Columns| {
        let mut random = Pcg64::seed_from_u64(99 + run as u64);
        for value in &mut columns[1] {
            let noise: f64 = (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
            *value += 5e-3 * noise;
        }
    };
    let finding = only(&found(spoil), LogFindingKind::VelocityNoise, &[]);
    near(finding.value, 5e-3, 1e-3);
    assert!(finding.corrected);
    let as_logged = check(log(spoil), Corrections::of_motion(Some(false)));
    assert!(!only(&as_logged.findings, LogFindingKind::VelocityNoise, &[]).corrected);
    assert_eq!(as_logged.data.runs, log(spoil).runs);
}

#[test]
fn check_with_late_velocity_reports_lag() {
    let finding = only(&found(|_, c| c[1] = late(&c[1], 3)), LogFindingKind::VelocityLag, &[]);
    near(finding.value, 3.0 * STEP_S, 0.2 * STEP_S);
}

#[test]
fn check_with_late_torque_reports_lag() {
    let spoil = |_: usize, columns: &mut Columns| {
        columns[2] = late(&columns[2], 6);
        // The gauge is the torque's own, or it would be early.
        columns[4] = columns[2].clone();
    };
    let finding = only(&found(spoil), LogFindingKind::TorqueLag, &[]);
    near(finding.value, 6.0 * STEP_S, 1.5 * STEP_S);
}

#[test]
fn check_with_late_channel_reports_lag() {
    let finding = only(&found(|_, c| c[4] = late(&c[4], 20)), LogFindingKind::ChannelLag, &[]);
    near(finding.value, 20.0 * STEP_S, 1.5 * STEP_S);
    assert_eq!(finding.columns, ["gauge_torque_nm"]);
}

#[test]
fn check_with_held_channel_reports_it() {
    let spoil = |_: usize, columns: &mut Columns| {
        let all = columns[4].clone();
        columns[4] = (0..all.len()).map(|row| all[row - row % 4]).collect();
    };
    let finding = only(&found(spoil), LogFindingKind::HeldChannel, &[]);
    near(finding.value, 4.0 * STEP_S, 1e-9);
    assert!(!finding.corrected, "a covariate is taken as it stands");
}

#[test]
fn check_with_held_torque_leaves_out_rows_between() {
    let spoil = |_: usize, columns: &mut Columns| {
        let held = |all: &[f64]| (0..all.len()).map(|row| all[row - row % 4]).collect::<Vec<f64>>();
        (columns[2], columns[4]) = (held(&columns[2]), held(&columns[4]));
    };
    let checked = check(log(spoil), Corrections::default());
    let held = |finding: &&LogFinding| finding.kind == LogFindingKind::HeldChannel;
    let torque = checked.findings.iter().filter(held).find(|f| f.columns == ["torque_nm"]);
    assert!(torque.is_some_and(|finding| finding.corrected), "{:?}", checked.findings);
    let run = &checked.data.runs[0];
    let exact = exact(0);
    assert_eq!(run.len(), ROWS / 4);
    for (row, (time, torque)) in run.time_s.iter().zip(&run.torque).enumerate() {
        assert_eq!((*time, *torque), (exact[0][4 * row], exact[2][4 * row]), "row {row}");
    }
    let as_logged =
        check(log(spoil), Corrections::default().without(&[LogFindingKind::HeldChannel]));
    assert_eq!(as_logged.data.runs[0].len(), ROWS);
    assert!(as_logged.findings.iter().all(|finding| !finding.corrected));
}

#[test]
fn check_with_held_motion_leaves_out_rows_between_and_keeps_rests() {
    let spoil = |_: usize, columns: &mut Columns| {
        for column in [1, 3] {
            let all = columns[column].clone();
            columns[column] = (0..all.len()).map(|row| all[row - row % 3]).collect();
        }
    };
    let checked = check(log(spoil), Corrections::of_motion(Some(false)));
    let position = checked.findings.iter().find(|finding| finding.columns == ["position_rad"]);
    assert!(position.is_some_and(|finding| finding.corrected), "{:?}", checked.findings);
    for (index, run) in checked.data.runs.iter().enumerate() {
        let exact = exact(index);
        // A rest of a second has as many rows as any other.
        assert!(run.len() >= ROWS / 3, "run {index}: {} rows", run.len());
        let longest = run.time_s.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
        assert!(longest < 3.5 * STEP_S, "run {index}: a gap of {longest} s");
        let stale = |row: usize| {
            (run.velocity[row] - exact[1][(run.time_s[row] / STEP_S).round() as usize]).abs()
                > 1e-12
        };
        assert!((0..run.len()).filter(|row| stale(*row)).count() < run.len() / 50, "run {index}");
    }
}

/// Diagnoses the joint with each run held out once; each run is reduced to four oscillations and a rest.
fn diagnosed(mut data: Dataset, as_logged: Vec<LogFindingKind>) -> Diagnosis {
    for run in &mut data.runs {
        *run = run.slice(0..2500);
    }
    let parts = split(&data, &SplitRule::LeaveOneRunOut, 0).expect("runs to leave out");
    let question = DiagnosisOptions { as_logged, ..DiagnosisOptions::default() };
    diagnose(&data, &parts, &question, &|_| {}).expect("a diagnosis")
}

#[test]
fn diagnose_with_low_passed_torque_uses_low_passed_model() {
    let time_constant_s = 0.015;
    let spoil = |_: usize, columns: &mut Columns| {
        for column in [2, 4] {
            let mut held = columns[column][0];
            for value in &mut columns[column] {
                held -= (*value - held) * (-STEP_S / time_constant_s).exp_m1();
                *value = held;
            }
        }
    };
    let found = diagnosed(log(spoil), Vec::new());
    let finding = only(&found.log_findings, LogFindingKind::TorqueLag, &[]);
    assert!(finding.corrected);
    near(finding.value, time_constant_s, 0.1 * time_constant_s);
    println!("{}", crate::candidates(&found));
    // No cause is certain beside a filter.
    assert!(found.findings.iter().all(|finding| finding.probability < 0.9), "{:?}", found.findings);
    let stiffness = found.extended.parameters.get(ParameterId::BristleStiffness);
    println!("stiffness {stiffness}");
    near(stiffness, 750.0, 75.0);
    let as_logged = diagnosed(log(spoil), vec![LogFindingKind::TorqueLag]);
    assert!(as_logged.log_findings.is_empty());
    assert!(as_logged.before.metrics.rmse > 3.0 * found.after.metrics.rmse);
}

#[test]
fn diagnose_with_late_velocity_without_position_shifts_it() {
    let spoiled = || {
        let names = ["time_s", "velocity_rad_s", "torque_nm"].map(str::to_owned);
        let runs = (0..RUNS).map(|run| {
            let [time, velocity, torque, ..] = exact(run);
            (run.to_string(), vec![time, late(&velocity, 7), torque])
        });
        Dataset::from_columns(&names, runs).expect("the columns of a log")
    };
    let found = diagnosed(spoiled(), Vec::new());
    let finding = only(&found.log_findings, LogFindingKind::VelocityLag, &[]);
    assert!(finding.corrected);
    near(finding.value, 7.0 * STEP_S, 0.5 * STEP_S);
    assert!(found.after.metrics.rmse < 1.3 * 0.02, "{}", found.after.metrics.rmse);
}

#[test]
fn diagnose_with_exact_log_finds_no_lag() {
    let found = diagnosed(log(|_, _| ()), Vec::new());
    assert!(found.log_findings.is_empty(), "{:?}", found.log_findings);
}

#[test]
fn check_with_coarse_encoder_reports_quantisation() {
    let step = std::f64::consts::TAU / 4096.0;
    let spoil = |_: usize, columns: &mut Columns| {
        columns[3].iter_mut().for_each(|value| *value = (*value / step).floor() * step);
    };
    let finding = only(&found(spoil), LogFindingKind::Quantised, &[]);
    near(finding.value, step, 1e-3 * step);
}

#[test]
fn check_with_clipped_torque_reports_saturation() {
    let spoil = |_: usize, columns: &mut Columns| {
        columns[2].iter_mut().for_each(|value| *value = value.clamp(-1.45, 1.45));
    };
    let finding = only(&found(spoil), LogFindingKind::Saturated, &[]);
    near(finding.value.abs(), 1.45, 1e-12);
}

#[test]
fn check_with_coarse_clock_or_gap_reports_time_jump() {
    let repeated = found(|_, c| {
        c[0].iter_mut().for_each(|time| *time = (*time / 0.005).floor() * 0.005);
    });
    let repeated = repeated.iter().find(|finding| finding.kind == LogFindingKind::TimeJump);
    assert!(repeated.is_some_and(|finding| finding.unit == "rows"));
    let gap = found(|run, c| {
        if run == 1 {
            c[0].iter_mut().skip(2000).for_each(|time| *time += 0.5);
        }
    });
    near(only(&gap, LogFindingKind::TimeJump, &[]).value, 0.502, 1e-6);
}

#[test]
fn check_with_lost_rows_and_regular_clock_reports_position_jump() {
    let spoil = |run: usize, columns: &mut Columns| {
        if run == 1 {
            // Somewhere in a fast swing, a twentieth of a second.
            for column in columns.iter_mut().skip(1) {
                column.drain(1100..1125);
            }
            columns[0].truncate(ROWS - 25);
        }
    };
    let finding = only(&found(spoil), LogFindingKind::PositionJump, &[]);
    assert_eq!(finding.columns, ["position_rad"]);
}

#[test]
fn check_with_other_units_reports_suspect_unit() {
    for (factor, word) in [(60.0 / std::f64::consts::TAU, "rpm"), (57.295_779_513, "deg/s")] {
        let findings = found(|_, c| c[1].iter_mut().for_each(|velocity| *velocity *= factor));
        let finding = only(&findings, LogFindingKind::UnitSuspect, &[]);
        near(finding.value, factor, 0.01 * factor);
        assert!(finding.in_words.contains(word), "{}", finding.in_words);
    }
    let micro = found(|_, c| c[0].iter_mut().for_each(|time| *time *= 1e6));
    assert!(micro.iter().any(|f| f.kind == LogFindingKind::UnitSuspect && f.columns == ["time_s"]));
}

#[test]
fn check_with_integrated_position_reports_it() {
    let spoil = |_: usize, columns: &mut Columns| {
        let (mut sum, mut step) = (0.0, 0.0);
        let [_, velocity, _, position, _] = columns;
        for (velocity, position) in velocity.iter_mut().zip(position) {
            // A steady turning beside the swings, so that runs end elsewhere.
            *velocity += 0.2;
            sum += step * *velocity;
            *position = sum;
            step = STEP_S;
        }
    };
    let findings = found(spoil);
    let finding = findings.iter().find(|finding| finding.kind == LogFindingKind::UnitSuspect);
    assert!(finding.is_some_and(|f| f.columns == ["position_rad"]), "{findings:?}");
    let set_to_zero = found(|_, c| {
        let start = c[3][0];
        c[3].iter_mut().for_each(|angle| *angle -= start);
    });
    assert_eq!(set_to_zero, []);
}

#[test]
fn check_with_inverted_torque_reports_suspect_sign() {
    let turn = |_: usize, c: &mut Columns| c[2].iter_mut().for_each(|torque| *torque = -*torque);
    let checked = check(log(turn), Corrections::default());
    assert!(only(&checked.findings, LogFindingKind::SignSuspect, &[]).corrected);
    assert_eq!(checked.data.runs[0].torque, log(|_, _| ()).runs[0].torque);
    let as_logged =
        check(log(turn), Corrections::default().without(&[LogFindingKind::SignSuspect]));
    assert!(!only(&as_logged.findings, LogFindingKind::SignSuspect, &[]).corrected);
    assert_eq!(as_logged.data.runs[0].torque, log(turn).runs[0].torque);
}

#[test]
fn check_with_impossible_values_leaves_out_rows() {
    let spoil = |run: usize, columns: &mut Columns| {
        if run == 2 {
            columns[2][700] = 9999.0;
            columns[2][2700] = -9999.0;
        }
    };
    let checked = check(log(spoil), Corrections::default());
    let finding = only(&checked.findings, LogFindingKind::Outlier, &[]);
    near(finding.value.abs(), 9999.0, 1e-9);
    assert!(finding.corrected);
    assert_eq!(checked.data.rows, RUNS * ROWS - 2);
    let kept = check(log(spoil), Corrections::default().without(&[LogFindingKind::Outlier]));
    assert_eq!(kept.data.rows, RUNS * ROWS);
    assert!(!only(&kept.findings, LogFindingKind::Outlier, &[]).corrected);
}

#[test]
fn check_with_few_rows_reports_too_little() {
    let few = found(|_, c| c.iter_mut().for_each(|column| column.truncate(30)));
    near(only(&few, LogFindingKind::TooLittle, &[LogFindingKind::Quantised]).value, 120.0, 1e-9);
}

/// Adds spikes of ten times the torque and of random sign to a fifth of the rows.
fn spiked(run: usize, columns: &mut Columns) {
    let mut random = Pcg64::seed_from_u64(100 + run as u64);
    for torque in &mut columns[2] {
        let size = if random.random::<bool>() { 20.0 } else { -20.0 };
        *torque += if random.random::<f64>() < 0.2 { size } else { 0.0 };
    }
}

#[test]
fn check_with_many_spikes_keeps_the_fit() {
    let checked = check(log(spiked), Corrections::default());
    let share = only(&checked.findings, LogFindingKind::Outlier, &[]).value;
    near(share, 0.2, 0.01);
    let level = |data: &Dataset, loss| {
        let spec = Spec::parse("lugre").expect("a model");
        let base = spec.parameters().expect("parameters");
        let tracks = tracks(data);
        let rows = Rows { tracks: &tracks, decimate: 1 };
        let fit = identify_robustly(loss, &spec, &base, rows, rows, &FitOptions::default());
        fit.parameters.get(ParameterId::CoulombTorque)
    };
    let clean = level(&log(|_, _| ()), Loss::Squares);
    for loss in [Loss::Squares, Loss::Huber] {
        near(level(&checked.data, loss) / clean, 1.0, 0.01);
    }
    let as_logged = check(log(spiked), Corrections::default().without(&[LogFindingKind::Outlier]));
    assert!(as_logged.findings.iter().any(|found| !found.corrected));
    assert_eq!(as_logged.data.runs[0].torque, log(spiked).runs[0].torque);
}

#[test]
fn check_with_all_channels_held_keeps_one_row_of_each_reading() {
    let spoil = |_: usize, columns: &mut Columns| {
        for column in columns.iter_mut().skip(1) {
            *column = (0..ROWS).map(|row| column[row - row % 10]).collect();
        }
    };
    let checked = check(log(spoil), Corrections::of_motion(Some(false)));
    let held =
        checked.findings.iter().filter(|finding| finding.kind == LogFindingKind::HeldChannel);
    for finding in held.filter(|finding| finding.columns != ["gauge_torque_nm"]) {
        assert!(finding.corrected, "{finding:?}");
    }
    let run = &checked.data.runs[0];
    near(run.len() as f64, ROWS as f64 / 10.0, 10.0);
    let exact = exact(0);
    for (row, torque) in run.torque.iter().enumerate() {
        assert_eq!(*torque, exact[2][(run.time_s[row] / STEP_S).round() as usize], "row {row}");
    }
}

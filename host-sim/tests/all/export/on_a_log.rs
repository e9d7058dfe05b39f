//! An exported model errs on a log as the prediction says, whatever its form.

use super::compiled_c::{CRow, run_c};
use compensator_core::{ModelState, Sample};
use friction_fit::params;
use friction_fit::prediction::{PredictionOptions, PredictionStart, log_tracks, predict_tracks};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Rows, identify, tracks};
use host_sim::driver_file;
use joint_log::Dataset;

/// A log of a joint that starts under a torque: Maxwell-slip elements, a pressure that preloads them, an offset of one direction.
fn log(pressure_coulomb: f64, asymmetry: f64) -> Dataset {
    const STEP_S: f64 = 0.005;
    let names = ["time_s", "velocity_rad_s", "torque_nm", "pressure_diff_pa"].map(String::from);
    let run = |run: usize| {
        let mut columns = vec![Vec::new(); names.len()];
        let mut elements = [0.0f64; 5];
        // The joint holds a torque from its past.
        elements.iter_mut().for_each(|element| *element = 0.15 - 0.1 * run as f64);
        for row in 0..1200 {
            let time = row as f64 * STEP_S;
            let moving = if row < 150 { 0.02 } else { 1.0 };
            let velocity = moving * (0.6 + 0.3 * run as f64) * (2.0 * time).sin();
            let pressure = 1e5 * (1.0 + (0.7 * time + run as f64).sin());
            let level = 1.2 + 0.4 * (-(velocity / 0.08).abs()).exp() + pressure_coulomb * pressure;
            let level = level * (1.0 + asymmetry * velocity.signum());
            for (at, element) in elements.iter_mut().enumerate() {
                let most = level * (0.12 + 0.04 * at as f64);
                let stiffness = 60.0 * (1.0 + at as f64);
                *element = (*element + stiffness * velocity * STEP_S).clamp(-most, most);
            }
            let noise = 0.004 * (((row * 7919 + run * 31) % 1000) as f64 / 500.0 - 1.0);
            let torque = elements.iter().sum::<f64>() + 0.3 * velocity + noise;
            for (column, value) in columns.iter_mut().zip([time, velocity, torque, pressure]) {
                column.push(value);
            }
        }
        (run.to_string(), columns)
    };
    Dataset::from_columns(&names, (0..3).map(run)).expect("a valid log")
}

#[test]
fn export_gives_the_same_error_on_a_log_in_every_form() {
    for (model, data) in [
        ("lugre+pressure-coulomb", log(2e-6, 0.0)),
        ("lugre+direction-asymmetry+pressure-coulomb", log(1e-6, 0.15)),
    ] {
        let spec = Spec::parse(model).expect("a model");
        let tracks = tracks(&data);
        let rows = Rows { tracks: &tracks, decimate: 1 };
        let base = spec.parameters().expect("parameters");
        let fit = identify(&spec, &base, rows, rows, &FitOptions::default());
        let file = driver_file::parse(&params::emit(&fit, &data, None)).expect("a legal model");
        let tracks = log_tracks(&file, &data).expect("tracks");
        let predict = |options| predict_tracks(&file, &data, &tracks, options).expect("rows");
        let predicted = predict(&PredictionOptions::AS_EXPORTED);
        let from_zero =
            PredictionOptions { start: PredictionStart::Rest, ..PredictionOptions::AS_EXPORTED };
        let from_zero = predict(&from_zero).metrics.rmse;
        let expected = predicted.metrics.rmse;
        assert!(from_zero > 1.05 * expected, "a start of no use: {from_zero} {expected}");

        let mut in_rows: Vec<CRow> = Vec::new();
        let mut measured = Vec::new();
        let mut in_rust = Vec::new();
        for track in &tracks {
            let period_s = track.period_s as f32;
            let built = file.friction().model.build::<f32>(period_s).expect("a legal model");
            let samples = track.samples.iter().map(|sample| sample.map(|value| value as f32));
            let samples: Vec<Sample<f32>> = samples.collect();
            let first = track.torque[0] as f32;
            let mut state = built.state_for_torque(ModelState::default(), &samples[0], first);
            in_rust.extend(samples.iter().map(|s| f64::from(built.step(&mut state, s))));
            measured.extend(&track.torque);
            let begin = in_rows.len();
            in_rows.extend(samples.into_iter().map(CRow::from));
            in_rows[begin].start_torque_nm = Some(first);
        }
        let in_c = run_c(&file, tracks[0].period_s as f32, &in_rows);
        let rmse = |torques: &[f64]| {
            let squares = torques.iter().zip(&measured).map(|(a, b): (&f64, &f64)| (a - b).powi(2));
            (squares.sum::<f64>() / measured.len() as f64).sqrt()
        };
        for (form, torques) in [("Rust", &in_rust), ("C", &in_c)] {
            assert_eq!(torques.len(), measured.len(), "{form}");
            let found = rmse(torques);
            let apart = (found / expected - 1.0).abs();
            assert!(apart < 2e-4, "{model} in {form}: {found}, expected {expected}");
        }
    }
}

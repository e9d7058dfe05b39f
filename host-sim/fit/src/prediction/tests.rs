//! Predictions of small hand-made logs.

use super::*;
use crate::params;
use crate::spec::Spec;
use crate::{FitOptions, Rows, identify, message, predict, tracks};
use joint_log::Dataset;

fn predict_log(
    file: &ParameterFile,
    data: &Dataset,
    options: &PredictionOptions,
) -> Result<LogPrediction, PredictionError> {
    predict_tracks(file, data, &log_tracks(file, data)?, options)
}

const PERIOD_S: f64 = 0.01;

/// Returns a log of LuGre friction: at rest under a growing torque, then sliding to and fro.
fn log() -> Dataset {
    let parameters = params::parse(MODEL, &[]).expect("a valid file").parameters;
    let model = parameters.build_unchecked::<f64>(PERIOD_S);
    let names = ["time_s", "velocity_rad_s", "torque_nm"].map(String::from);
    let run = |index: usize| {
        let mut state = ModelState::holding(-0.9 + 0.5 * index as f64);
        let mut columns = vec![Vec::new(); 3];
        for row in 0..800 {
            let time = row as f64 * PERIOD_S;
            let moves = if row < 100 { 0.0 } else { (time - 1.0).sin() };
            let sample = compensator_core::Sample {
                velocity_rad_s: 0.8 * moves,
                ..compensator_core::Sample::default()
            };
            let torque = model.step(&mut state, &sample);
            for (column, value) in columns.iter_mut().zip([time, 0.8 * moves, torque]) {
                column.push(value);
            }
        }
        (format!("run {index}"), columns)
    };
    Dataset::from_columns(&names, (0..3).map(run)).expect("a valid log")
}

const MODEL: &str = "schema = 1\njoint = \"revolute\"\nmodel = \"lugre\"\n[parameters]\n\
    coulomb_torque = 1.2\nstatic_torque = 1.6\nbristle_stiffness = 300\nbristle_damping = 0.5\n\
    viscous_friction = 0.4\n";

fn start_at(start: PredictionStart) -> PredictionOptions {
    PredictionOptions { start, resolution: None, of_driver: false }
}

#[test]
fn predict_log_from_first_torque_returns_torque_of_model() {
    let (file, data) = (params::parse(MODEL, &[]).unwrap(), log());
    let found = predict_log(&file, &data, &PredictionOptions::AS_EXPORTED).unwrap();
    assert!(found.metrics.rmse < 1e-9, "{}", found.metrics.rmse);
    assert_eq!(found.metrics.rows, data.rows);
    let rest = predict_log(&file, &data, &start_at(PredictionStart::Rest)).unwrap();
    assert!(rest.metrics.rmse > 0.1, "{}", rest.metrics.rmse);
    assert!(found.remarks.is_empty(), "{:?}", found.remarks);
}

#[test]
fn predict_log_with_loaded_fit_returns_bits_of_fit() {
    let data = log();
    let all = tracks(&data);
    let rows = Rows { tracks: &all, decimate: 1 };
    let spec = Spec::parse("lugre").unwrap();
    let base = spec.parameters().unwrap();
    let fit = identify(&spec, &base, rows, rows, &FitOptions::default());
    let of_fit = predict(&fit.parameters, rows, fit.resolution);
    let file = params::parse(&params::emit(&fit, &data, None), &[]).unwrap();
    assert_eq!(file.fit.resolution(), fit.resolution);
    let found = predict_log(&file, &data, &start_at(PredictionStart::Fitted)).unwrap();
    for (track, torque) in all.iter().zip(&of_fit.torque) {
        assert_eq!(&found.runs[track.run].torque, torque);
    }
}

#[test]
fn predict_log_beyond_range_flags_rows() {
    let text = format!("{MODEL}[envelope]\nvelocity_max_rad_s = 0.5\n");
    let data = log();
    let found =
        predict_log(&params::parse(&text, &[]).unwrap(), &data, &start_at(PredictionStart::Rest));
    let found = found.unwrap();
    for (run, predicted) in data.runs.iter().zip(&found.runs) {
        for (velocity, flags) in run.velocity.iter().zip(&predicted.flags) {
            assert_eq!(flags.contains(Flags::VELOCITY_INVALID), velocity.abs() > 0.5);
        }
    }
    assert!(found.remarks[0].ends_with("velocity-invalid"), "{:?}", found.remarks);
}

#[test]
fn predict_log_without_column_of_term_remarks_it() {
    let text = MODEL.replace("\"lugre\"", "\"lugre+pressure-coulomb\"");
    let found =
        predict_log(&params::parse(&text, &[]).unwrap(), &log(), &PredictionOptions::default());
    let remarks = found.unwrap().remarks;
    assert!(remarks[0].contains("pressure_diff_pa"), "{remarks:?}");
}

#[test]
fn predict_log_without_channel_of_measurement_remarks_it() {
    let share =
        "channel_gains = { pressure_diff_pa = 1e-6 }\nchannel_means = { pressure_diff_pa = 0 }";
    for section in ["measurement", "driver_measurement"] {
        let file = params::parse(&format!("{MODEL}[{section}]\n{share}\n"), &[]).unwrap();
        let remarks = predict_log(&file, &log(), &PredictionOptions::default()).unwrap().remarks;
        assert!(remarks[0].contains("pressure_diff_pa"), "{section}: {remarks:?}");
    }
}

#[test]
fn predict_log_of_other_joint_returns_error() {
    let text = MODEL.replace("revolute", "prismatic");
    let file = params::parse(&text, &[]).unwrap();
    let error = predict_log(&file, &log(), &PredictionOptions::default()).unwrap_err().to_string();
    message::check("files", "log of another joint", &error, &["revolute", "prismatic"]);
}

#[test]
fn predict_log_applies_to_each_model_its_own_measurement() {
    let data = log();
    let linear =
        "\n[[linear.term]]\npart = \"viscous\"\nsize = 0.5\nfactors = [{ kind = \"velocity\" }]\n";
    let measured = "\n[measurement]\ntorque_sign = -1\n\n[driver_measurement]\ntorque_sign = 1\n";
    let file = params::parse(&format!("{MODEL}{measured}{linear}"), &[]).unwrap();
    let of_driver = predict_log(&file, &data, &PredictionOptions::AS_EXPORTED).unwrap();
    assert!(of_driver.metrics.rmse < 1e-9, "{}", of_driver.metrics.rmse);
    let predicted = predict_log(&file, &data, &PredictionOptions::default()).unwrap();
    for (row, torque) in predicted.runs[0].torque.iter().enumerate() {
        assert_eq!(*torque, -0.5 * data.runs[0].velocity[row]);
    }
}

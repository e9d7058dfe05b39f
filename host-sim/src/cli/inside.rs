//! `--inside`: fits friction models within the known dynamics of a machine, to the angles of all joints at once.

use super::error::{Result, found, unfit};
use super::input::{DataArguments, LogInputs};
use super::output::{OutputArguments, pretty};
use super::progress::in_stages;
use friction_diagnose::prepare::Prepared;
use friction_fit::params::emit_model;
use joint_log::number::significant;
use joint_log::work;
use joint_log::{Part, SplitRule};
use published_experiments::coupled::{ArmLog, InsideFit, model};
use serde_json::{Value, json};

/// Fits the models within the machine's dynamics. Writes the parameters of the model with the smallest held-out error,
/// one file for each joint.
///
/// # Errors
/// Returns one line if the data do not fit the machine; no file is written in that case.
pub fn run(
    data: &DataArguments,
    output: &OutputArguments,
    models: &[String],
    starts: usize,
    document: &str,
) -> Result {
    let models = models.iter().map(|name| Ok(model(name)?)).collect::<Result<Vec<_>>>()?;
    let joints = match data.read(&SplitRule::default())? {
        LogInputs::Several(joints) => joints,
        LogInputs::One(_) => {
            return Err(found("--inside manipulator", "the log of one joint", "three"));
        }
    };
    let logs: Vec<_> = joints.iter().map(|(name, input)| (name.clone(), &input.data)).collect();
    let held_out = held_out_runs(&joints[0].1)?;
    let log = ArmLog::new(&logs, &held_out, starts)?;
    let mut fits = in_stages(data.log.threads, || {
        let fits = models.into_iter().map(|model| {
            let name = &model.name;
            work::report_stage(&format!("fitting {name} within the dynamics of the arm"));
            Ok(log.fit(model)?)
        });
        fits.collect::<Result<Vec<InsideFit>>>()
    })?;
    let all = |fit: &InsideFit| fit.test_deg.iter().map(|error| error * error).sum::<f64>();
    fits.sort_by(|a, b| all(a).total_cmp(&all(b)));

    let names: Vec<&str> = joints.iter().map(|(name, _)| name.as_str()).collect();
    let [train, test] = log.runs();
    let json = json!({
        "schema": 1, "inside": "manipulator", "fitted_on": train, "held_out": test,
        "models": fits.iter().map(|fit| model_json(fit, &names)).collect::<Vec<_>>(),
    });
    let json = pretty(&json)?;
    let best = &fits[0];
    let mut files = vec![(document.to_owned(), json.clone())];
    for (at, name) in names.iter().enumerate() {
        let kind = joints[at].1.data.joint;
        files.push((format!("joint-{name}/params.toml"), emit_model(&best.joint(at), kind)));
    }
    let text = text(&fits, &names);
    let files: Vec<(&str, &[u8])> =
        files.iter().map(|(name, text)| (&**name, text.as_bytes())).collect();
    output.finish(&files, &json, &text)
}

/// Returns the names of the held-out runs. The arm is simulated over whole runs.
fn held_out_runs(input: &Prepared) -> Result<Vec<&str>> {
    let name = |part: &Part| input.data.runs[part.run].name.as_str();
    let held_out: Vec<&str> = input.split.test.iter().map(name).collect();
    match input.split.train.iter().map(name).find(|name| held_out.contains(name)) {
        None => Ok(held_out),
        Some(mixed) => Err(unfit(
            "--inside manipulator",
            format!("only a part of run {mixed} is held out, expected whole runs"),
        )),
    }
}

/// Returns the errors of each joint, best model first.
fn text(fits: &[InsideFit], names: &[&str]) -> String {
    let mut text = String::new();
    for fit in fits {
        text +=
            &format!("{}: RMSE of the angle (deg) on held-out and on training runs:\n", fit.model);
        for (at, name) in names.iter().enumerate() {
            let [test, train] = [fit.test_deg[at], fit.train_deg[at]].map(|of| significant(of, 3));
            text += &format!("  joint {name}: {test}, {train}\n");
        }
    }
    text + &format!("params.toml of each joint contains {}\n", fits[0].model)
}

fn model_json(fit: &InsideFit, names: &[&str]) -> Value {
    let joint = |(at, name): (usize, &&str)| {
        let parameters = &fit.fitted.parameters[at];
        let values = parameters.active().map(|id| {
            let about = json!({"value": parameters.get(id), "unit": id.unit()});
            (id.name().to_owned(), about)
        });
        json!({
            "joint": name, "params": serde_json::Map::from_iter(values),
            "first_deflection_rad": fit.fitted.deflection_rad[at],
            "fitted_rmse_deg": fit.train_deg[at], "held_out_rmse_deg": fit.test_deg[at],
        })
    };
    json!({
        "model": fit.model.to_lowercase(), "converged": fit.fitted.converged,
        "simulations": fit.fitted.evaluations,
        "joints": names.iter().enumerate().map(joint).collect::<Vec<_>>(),
    })
}

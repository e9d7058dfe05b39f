//! `--inside`: models fitted to the angles of a machine whose dynamics are known, all its joints at once.

use super::input::{DataArguments, Inputs, spinner};
use super::output::{OutputArguments, say, tell};
use crate::papers::coupled::{ArmLog, Inside, model};
use friction_identification::data::SplitRule;
use friction_identification::number::significant;
use friction_identification::params::emit_model;
use serde_json::{Value, json};

/// Machines whose dynamics are known.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
pub enum Machine {
    /// The arm of three joints on fluidic muscles of `simulate manipulator`.
    Manipulator,
}

/// Fits these models inside the machine and writes the best on held-out runs, joint by joint.
///
/// # Errors
/// One line; nothing is written then.
pub fn run(
    data: &DataArguments,
    output: &OutputArguments,
    models: &[String],
    starts: usize,
    document: &str,
) -> Result<(), String> {
    let models = models.iter().map(|name| model(name)).collect::<Result<Vec<_>, String>>()?;
    let joints = match data.read(&SplitRule::default())? {
        Inputs::Several(joints) => joints,
        Inputs::One(_) => {
            return Err("--inside manipulator: found the log of one joint, expected three".into());
        }
    };
    let logs: Vec<_> = joints.iter().map(|(name, input)| (name.clone(), &input.data)).collect();
    let (_, first) = &joints[0];
    let runs = &first.data.runs;
    let held_out: Vec<&str> =
        first.split.test.iter().map(|part| runs[part.run].name.as_str()).collect();
    let mixed = first.split.train.iter().find(|part| held_out.contains(&&*runs[part.run].name));
    if let Some(part) = mixed {
        let name = &runs[part.run].name;
        return Err(format!(
            "--inside manipulator: run {name} is held out in part, expected whole runs"
        ));
    }
    let log = ArmLog::new(&logs, &held_out, starts)?;
    let fits = models.into_iter().map(|model| {
        let bar = spinner(format!("fitting {} inside the arm", model.name));
        let fit = log.fit(model);
        bar.finish_and_clear();
        fit
    });
    let mut fits: Vec<Inside> = fits.collect::<Result<_, String>>()?;
    let all = |fit: &Inside| fit.test_deg.iter().map(|error| error * error).sum::<f64>();
    fits.sort_by(|a, b| all(a).total_cmp(&all(b)));

    let names: Vec<&str> = joints.iter().map(|(name, _)| name.as_str()).collect();
    let [train, test] = log.runs();
    let json = json!({
        "schema": 1, "inside": "manipulator", "fitted_on": train, "held_out": test,
        "models": fits.iter().map(|fit| found(fit, &names)).collect::<Vec<_>>(),
    });
    let json = serde_json::to_string_pretty(&json).map_err(|error| error.to_string())? + "\n";
    let best = &fits[0];
    let mut files = vec![(document.to_owned(), json.clone())];
    for (at, name) in names.iter().enumerate() {
        let kind = joints[at].1.data.joint;
        files.push((format!("joint-{name}/params.toml"), emit_model(&best.joint(at), kind)));
    }
    let named: Vec<(&str, &str)> = files.iter().map(|(name, text)| (&**name, &**text)).collect();
    output.write(&named)?;
    if output.json {
        return say(&json);
    }
    let mut text = String::new();
    for fit in &fits {
        text += &format!("{}, error of the angle (deg), held out and fitted:\n", fit.model);
        for (at, name) in names.iter().enumerate() {
            let [test, train] = [fit.test_deg[at], fit.train_deg[at]].map(|of| significant(of, 3));
            text += &format!("  joint {name}: {test}, {train}\n");
        }
    }
    let out = output.folder().display();
    let written: Vec<String> = files.iter().map(|(name, _)| format!("{out}/{name}")).collect();
    tell(&format!(
        "{text}params.toml is {} in each joint\nwritten: {}\n",
        best.model,
        written.join(", ")
    ))
}

fn found(fit: &Inside, names: &[&str]) -> Value {
    let joint = |(at, name): (usize, &&str)| {
        let parameters = &fit.fitted.parameters[at];
        let values = parameters.active().map(|id| {
            let about = json!({"value": parameters.get(id), "unit": id.info().unit});
            (id.info().name.to_owned(), about)
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

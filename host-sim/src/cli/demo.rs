//! `demo`: the whole story with nothing but this program.
//!
//! A joint is drawn at random, with one effect hidden in it that its model does not know. It moves, its
//! CAN traffic is recorded, and from there on only that recording is looked at: what the model misses, why,
//! what a better one gains. That one is given to a joint driver, and the recording replayed to it. At the end the hidden effect is shown, and whether the diagnosis was right
//! is said either way: a wrong one is a story that ran. The same seed is the same story.

use super::input::spinner;
use super::output::{OutputArguments, say};
use crate::benchmark::{Grade, grade};
use crate::driver_file;
use crate::results::diagnosis;
use crate::results::diagnosis_page::{self, Diagnosed};
use crate::simulated;
use compensator_core::can::Node;
use friction_identification::data::{
    Dataset, EmitOptions, ReadOptions, Split, SplitRule, emit, read, split,
};
use friction_identification::diagnose::{Diagnosis, Question, diagnose};
use friction_identification::number::figure;
use friction_identification::params;
use joint_bus::replay::{Plan, Setup, Tally, in_process};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::{Value, json};
use simulated_machines::scenarios::{HiddenCause, Kind, Options, Scenario, draw_with};
use std::path::Path;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Arguments of `demo`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    output: OutputArguments,
    /// Draws joint and effect; the same seed, the same story. Without it, the time draws
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
}

/// Runs of the joint: with six, what a covariate does may lie in the two that are held out.
const RUNS: usize = 16;

/// Seeds drawn by the time are below this: short enough to be typed again.
const SEEDS: u64 = 1_000_000;

/// Says what is going on: on standard output, or beside it where that is for JSON.
struct Teller {
    json: bool,
    begin: Instant,
}

impl Teller {
    fn step(&self, text: &str) -> Result<(), String> {
        if self.json {
            return Ok(());
        }
        let seconds = self.begin.elapsed().as_secs_f64();
        say(&format!("[{seconds:4.1} s] {text}\n"))
    }
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<(), String> {
    let teller = Teller { json: arguments.output.json, begin: Instant::now() };
    let seed = arguments.seed.unwrap_or_else(by_the_time);
    let out = arguments.output.folder();
    teller.step(&format!(
        "Drawing an underwater joint and hiding one effect in it that its model does not know. \
         Which one stays hidden until the end. (--seed {seed} is this story again.)"
    ))?;
    let options = Options { runs: Some(RUNS), ..Options::default() };
    let scenario = draw_with(Kind::One(effect(seed)), &[], seed, &options);
    let truth = pretty(&scenario.truth.json())?;
    record(&scenario, &truth, &arguments.output)?;
    teller.step(&format!(
        "It has moved {} times, {} rows in all; its CAN traffic is in {}/trace.log.",
        scenario.log.runs.len(),
        scenario.log.rows(),
        out.display()
    ))?;

    let (data, parts, hash) = listen(&out.join("trace.log"))?;
    teller.step(&format!(
        "Read {} rows back from the recording. From here on that is all there is to go by; each of its {} runs is judged by fits that have not seen it.",
        data.rows,
        data.runs.len()
    ))?;
    let bar = spinner("diagnosing".into());
    let question = Question { seed, ..Question::default() };
    let found = diagnose(&data, &parts, &question, &|what| bar.set_message(what.to_owned()))
        .map_err(|error| error.to_string())?;
    bar.finish_and_clear();
    teller.step(&format!(
        "Fitted {} and heard {} candidates for what it misses{}.",
        found.baseline.spec,
        found.scores.len(),
        extension(&found)
    ))?;

    let document = diagnosis::document(&found, &data, &parts, std::slice::from_ref(&hash));
    let value = serde_json::to_value(&document).map_err(|error| error.to_string())?;
    let toml = params::emit(&found.extended, data.joint);
    let about = Diagnosed {
        found: &found,
        data: &data,
        split: &parts,
        hashes: std::slice::from_ref(&hash),
        columns: &[],
        skip: 0,
        seed,
    };
    let html = diagnosis_page::page(&about).render();
    let files = [
        ("report.html", html.as_str()),
        ("diagnosis.json", &pretty(&value)?),
        ("params.toml", &toml),
    ];
    arguments.output.write(&files)?;
    teller.step("Wrote the report.")?;
    let played = deploy(&out.join("trace.log"), &toml);
    teller.step(&deployed(&played))?;

    let grade = grade(Kind::One(effect(seed)), seed, &scenario, &found);
    if arguments.output.json {
        return say(&pretty(&summary(seed, &scenario, &grade, value, &played))?);
    }
    let mut text = "\nWhat the diagnosis says, from the recording alone:\n".to_owned();
    for (index, sentence) in document.story().iter().enumerate() {
        text += &format!("{}. {sentence}\n", index + 1);
    }
    text += &format!("\n{}\n", reveal(&scenario, &found, &grade));
    text += &format!(
        "\n{:.0} s. To be looked at: {out}/report.html. Beside it: diagnosis.json, params.toml, data.csv, trace.log, \
         truth.json.\n",
        teller.begin.elapsed().as_secs_f64(),
        out = out.display()
    );
    say(&text)
}

fn by_the_time() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    (since.as_nanos() as u64 / 1000) % SEEDS
}

/// The effect a seed hides: one of the catalogue, all as likely.
fn effect(seed: u64) -> HiddenCause {
    let known: Vec<HiddenCause> = HiddenCause::ALL
        .into_iter()
        .filter(|effect| *effect != HiddenCause::OutsideCatalogue)
        .collect();
    known[Pcg64::seed_from_u64(seed).random_range(0..known.len())]
}

fn pretty(value: &Value) -> Result<String, String> {
    Ok(serde_json::to_string_pretty(value).map_err(|error| error.to_string())? + "\n")
}

/// Writes what the joint did, as a table and as its CAN traffic, and the truth behind it.
fn record(scenario: &Scenario, truth: &str, output: &OutputArguments) -> Result<(), String> {
    let mut log = Vec::new();
    let data = simulated::dataset(&scenario.log);
    // A covariate beyond those of the contract fits into the traffic, if there is just one.
    let auxiliary = data.covariates.first().cloned();
    let options = EmitOptions { auxiliary, ..EmitOptions::default() };
    emit(&data, &options, &mut log).map_err(|error| error.to_string())?;
    let log = String::from_utf8(log).map_err(|error| error.to_string())?;
    output.write(&[("data.csv", &scenario.log.csv()), ("trace.log", &log), ("truth.json", truth)])
}

/// Reads the recording as `diagnose` would.
fn listen(file: &Path) -> Result<(Dataset, Split, String), String> {
    let files = [file.to_owned()];
    let data = read(&files, &ReadOptions::default(), &|_, _| {}).map_err(|e| e.to_string())?;
    let parts = split(&data, &SplitRule::EachOut, 0).map_err(|e| e.to_string())?;
    Ok((data, parts, super::input::hash(file)?))
}

/// What the extension is and gains, as the end of a sentence.
fn extension(found: &Diagnosis) -> String {
    if found.extended.spec == found.baseline.spec {
        return ", of which none passed".to_owned();
    }
    format!(
        "; extended to {}, the error on runs left out falls by {:.1} %",
        found.extended.spec,
        100.0 * found.gain.value
    )
}

/// Gives the extended model to a joint driver, the firmware's own code on a bus in this process, and plays
/// the recording to it.
fn deploy(trace: &Path, toml: &str) -> Result<Tally, String> {
    let friction = driver_file::parse(toml)?.friction();
    let plan = Plan::read(trace, Node::FIRST).map_err(|error| error.to_string())?;
    let period_s = plan.period_s as f32;
    let setup = Setup { friction: Some(friction), network: None, number: None, period_s };
    let played = in_process(&plan, Node::FIRST, &setup).map_err(|error| error.to_string())?;
    Ok(played.tally)
}

fn deployed(played: &Result<Tally, String>) -> String {
    match played {
        Ok(tally) => format!(
            "Gave the extended model to a joint driver (the firmware's own code, on a bus in this process) and replayed the \
             recording to it: {} of {} answers are the core's, bit for bit.",
            tally.equal, tally.samples
        ),
        Err(why) => format!("A joint driver would not run the extended model: {why}."),
    }
}

/// What had been hidden, and whether it was found.
fn reveal(scenario: &Scenario, found: &Diagnosis, grade: &Grade) -> String {
    let truth = &scenario.truth;
    let mut text = String::from("What had been hidden: ");
    for hidden in &truth.hidden {
        text += &format!(
            "{}, which changes the torque by {} Nm RMS under {} Nm of noise. ",
            hidden.in_words,
            figure(hidden.visible_rms_nm),
            figure(truth.noise_nm)
        );
    }
    let named = found.cause();
    text += &match (grade.right, grade.named.len()) {
        (true, 1) => "The diagnosis was right.".to_owned(),
        (true, _) => format!(
            "The diagnosis was right about the first cause, but named more than there was: {}.",
            grade.named[1..].join(", ")
        ),
        (false, _) if named == "none" => "The diagnosis was wrong: it found nothing.".to_owned(),
        (false, _) => {
            let hedged = grade.hidden.iter().any(|hidden| grade.confusable.contains(hidden));
            let but =
                if hedged { ", though it said that it could not tell the two apart" } else { "" };
            format!("The diagnosis was wrong: it named {named}{but}.")
        }
    };
    if let Some((size, value, [low, high])) = grade.sizes {
        let inside = if (low..=high).contains(&size) { "lies in" } else { "is outside" };
        text += &format!(
            " Of the size it said {}; the true one {inside} its 95 % interval.",
            figure(value)
        );
    }
    text
}

/// The result for a machine.
fn summary(
    seed: u64,
    scenario: &Scenario,
    grade: &Grade,
    diagnosis: Value,
    played: &Result<Tally, String>,
) -> Value {
    let replay = match played {
        Ok(tally) => json!(tally),
        Err(why) => json!({ "refused": why }),
    };
    json!({
        "schema": 1,
        "seed": seed,
        "hidden": grade.hidden,
        "named": grade.named,
        "right": grade.right,
        "size_inside_ci95": grade.size_inside,
        "truth": scenario.truth.json(),
        "replay": replay,
        "diagnosis": diagnosis,
    })
}

//! `demo`: runs all steps of the tool chain in one process, without hardware or a bus.
//!
//! 1. Simulate a random underwater joint with one hidden effect that the friction model does not contain.
//! 2. Record its CAN traffic. All following steps use this recording only.
//! 3. Diagnose the recording: the missing effect, and the gain of the extended model.
//! 4. Write the extended model to a joint driver and replay the recording to it.
//! 5. Show the hidden effect and whether the diagnosis was right.
//!
//! A wrong diagnosis is reported as such and is not an error of the command. The same seed gives the same demo.

use super::error::{CommandError, Result};
use super::output::{OutputArguments, pretty, print_formatted, print_text};
use super::progress::{in_stages, spinner};
use super::table;
use crate::driver_file;
use crate::simulated;
use compensator_core::can::NodeId;
use friction_diagnose::prepare::{PrepareOptions, Prepared, Source, prepare};
use friction_diagnose::summary::summary;
use friction_diagnose::{Diagnosis, diagnose};
use friction_results::diagnosis::{DiagnosedLog, parameter_text};
use friction_results::stochastic::StochasticExtension;
use joint_bus::replay::{Plan, ReplaySetup, Tally, in_process};
use joint_log::number::figure;
use joint_log::work;
use joint_log::{EmitOptions, SplitRule, emit};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::{Value, json};
use simulated_machines::scenarios::{HiddenCause, Options, Scenario, draw_with};
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Arguments of `demo`.
#[derive(clap::Args)]
pub struct DemoArguments {
    /// Seed of the joint and of its hidden effect; by default taken from the clock. The same seed repeats the demo
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    output: OutputArguments,
}

/// Number of simulated runs. With few runs, all variation of a covariate may lie in the held-out ones.
const RUN_COUNT: usize = 16;

/// Upper bound of a seed taken from the clock; a short number is easy to type again.
const CLOCK_SEED_BOUND: u64 = 1_000_000;

/// Prints the steps on standard output, unless that is reserved for JSON.
struct StepPrinter {
    json: bool,
    begin: Instant,
}

impl StepPrinter {
    fn step(&self, text: &str) -> Result {
        if self.json {
            return Ok(());
        }
        let seconds = self.begin.elapsed().as_secs_f64();
        print_formatted(&format!("[{seconds:4.1} s] {text}\n"))
    }
}

/// Runs the command.
pub fn run(arguments: &DemoArguments) -> Result {
    let output = &arguments.output.of_command("demo");
    let printer = StepPrinter { json: output.json, begin: Instant::now() };
    let seed = arguments.seed.unwrap_or_else(seed_from_clock);
    let out = output.folder();
    printer.step(&format!(
        "Simulating an underwater joint with one hidden effect that the friction model does not contain. \
         The effect is shown at the end. (--seed {seed} repeats this demo.)"
    ))?;
    let scenario = simulate(seed, output)?;
    printer.step(&format!(
        "Recorded {} runs with {} rows in all; the CAN traffic is in {}/trace.log.",
        scenario.log.runs.len(),
        scenario.log.rows(),
        out.display()
    ))?;
    let input = &read_recording(out.join("trace.log"), seed)?;
    printer.step(&format!(
        "Read {} rows back from the recording; all following steps use only these. Each of the {} runs is held out once: the models are tested on it after a fit to the other runs.",
        input.data.rows,
        input.data.runs.len()
    ))?;
    let (found, stochastic) = in_stages(0, || {
        let found = diagnose(&input.data, &input.split, &input.question(), &work::report_stage)?;
        let stochastic = StochasticExtension::new(&found, seed, &work::report_stage);
        Ok::<_, CommandError>((found, stochastic))
    })?;
    printer.step(&format!(
        "Fitted {} and evaluated {} of the candidate causes{}.",
        found.baseline.spec,
        found.candidates.len(),
        describe_extension(&found)
    ))?;
    let diagnosed = DiagnosedLog { found: &found, stochastic: &stochastic, input };
    let diagnosis = write_results(&diagnosed, output)?;
    printer.step("Wrote the report.")?;
    let replay = replay_on_driver(&out.join("trace.log"), &out.join("params.toml"));
    printer.step(&describe_replay(&replay))?;

    let answer = Answer::of(&scenario, &found);
    if output.json {
        return print_text(&pretty(&json_result(seed, &scenario, &answer, diagnosis, &replay))?);
    }
    print_formatted(&format!(
        "\nDiagnosis of the recording:\n{}\n{}\n\nFinished in {:.0} s. Open {out}/report.html for the report. \
         Other files in {out}: diagnosis.json, params.toml, data.csv, trace.log, truth.json.\n",
        table::numbered(&summary(&found)),
        describe_truth(&scenario, &found, &answer),
        printer.begin.elapsed().as_secs_f64(),
        out = out.display()
    ))
}

fn seed_from_clock() -> u64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    (since.as_nanos() as u64 / 1000) % CLOCK_SEED_BOUND
}

/// Returns the hidden effect of a seed. All effects of the catalogue are equally likely.
fn effect(seed: u64) -> HiddenCause {
    let known: Vec<HiddenCause> = HiddenCause::ALL
        .into_iter()
        .filter(|effect| *effect != HiddenCause::OutsideCatalogue)
        .collect();
    known[Pcg64::seed_from_u64(seed).random_range(0..known.len())]
}

/// Simulates the joint, and writes its log as `data.csv` and as CAN traffic in `trace.log`, and the truth in `truth.json`.
fn simulate(seed: u64, output: &OutputArguments) -> Result<Scenario> {
    let bar = spinner("simulating and recording".into());
    let options = Options { runs: Some(RUN_COUNT), ..Options::default() };
    let scenario = draw_with(&[effect(seed).into()], seed, &options);
    let mut log = Vec::new();
    let data = simulated::dataset(&scenario.log);
    // The CAN traffic has room for one covariate besides the standard quantities.
    let auxiliary = data.covariates.first().cloned();
    let options = EmitOptions { auxiliary, ..EmitOptions::default() };
    emit(&data, &options, &mut log)?;
    output.write(&[
        ("data.csv", scenario.log.csv().as_bytes()),
        ("trace.log", &log),
        ("truth.json", pretty(&scenario.truth.json())?.as_bytes()),
    ])?;
    bar.finish_and_clear();
    Ok(scenario)
}

/// Reads, checks and splits the recording as `diagnose` does.
fn read_recording(trace: PathBuf, seed: u64) -> Result<Prepared> {
    let split = SplitRule::LeaveOneRunOut;
    let options = PrepareOptions { split, seed, ..PrepareOptions::default() };
    Ok(in_stages(0, || prepare(&Source::Files(vec![trace]), &options))?)
}

/// Writes the files of `diagnose` without the table of the rows. Returns the document.
fn write_results(diagnosed: &DiagnosedLog, output: &OutputArguments) -> Result<Value> {
    let bar = spinner("writing the report".into());
    let document = diagnosed.document()?;
    output.write(&[
        ("report.html", diagnosed.page_text().as_bytes()),
        ("diagnosis.json", pretty(&document)?.as_bytes()),
        ("params.toml", parameter_text(diagnosed.found, diagnosed.input).as_bytes()),
    ])?;
    bar.finish_and_clear();
    Ok(document)
}

/// Describes the extended model and its gain, as the end of a sentence.
fn describe_extension(found: &Diagnosis) -> String {
    let Some(extension) = found.extension() else { return "; all were rejected".to_owned() };
    format!(
        "; the extended model {extension} reduces the error on held-out runs by {:.1} %",
        100.0 * found.gain.value
    )
}

/// Writes the extended model to a joint driver in this process and replays the recording to it. The driver runs the
/// firmware's code.
fn replay_on_driver(trace: &Path, parameters: &Path) -> Result<Tally> {
    let bar = spinner("replaying the recording".into());
    let friction = Some(driver_file::read(parameters)?.friction());
    let plan = Plan::read(trace, NodeId::FIRST)?;
    let period_s = plan.period_s as f32;
    let setup = ReplaySetup { friction, network: None, number: None, period_s, adaptation: None };
    let played = in_process(&plan, NodeId::FIRST, &setup)?;
    bar.finish_and_clear();
    Ok(played.tally)
}

fn describe_replay(replay: &Result<Tally>) -> String {
    match replay {
        Ok(tally) => format!(
            "Wrote the extended model to a joint driver (the firmware's code, on a bus in this process) and replayed the \
             recording to it: {} of {} answers equal those of the host model, bit for bit.",
            tally.equal, tally.samples
        ),
        Err(why) => format!("The joint driver rejected the extended model: {why}."),
    }
}

/// The diagnosis beside the hidden effect.
struct Answer {
    /// Hidden causes.
    hidden: Vec<&'static str>,
    /// Named causes, in order.
    named: Vec<&'static str>,
    /// Causes that the first one is confusable with.
    confusable: Vec<&'static str>,
    /// True if the first named cause is hidden.
    is_right: bool,
    /// `None` if the answer is not right.
    size: Option<EstimatedSize>,
}

/// The size of the first named cause.
struct EstimatedSize {
    value: f64,
    /// True if the true size lies in the 95 % interval.
    is_truth_inside: bool,
}

impl Answer {
    fn of(scenario: &Scenario, found: &Diagnosis) -> Self {
        let hidden: Vec<&'static str> =
            scenario.truth.hidden.iter().map(|effect| effect.cause).collect();
        let named: Vec<&'static str> =
            found.findings.iter().map(|finding| finding.cause.name()).collect();
        let first = found.findings.first();
        let confusable = first.map_or(Vec::new(), |finding| {
            finding.confusable_with.iter().map(|rival| rival.cause.name()).collect()
        });
        let is_right = named.first().is_some_and(|name| hidden.contains(name));
        let size = first.zip(scenario.truth.hidden.first()).filter(|_| is_right);
        let size = size.map(|(finding, truth)| {
            let [low, high] = finding.size.ci95();
            EstimatedSize {
                value: finding.size.value,
                is_truth_inside: (low..=high).contains(&truth.size),
            }
        });
        Self { hidden, named, confusable, is_right, size }
    }
}

/// Describes the hidden effect and whether the diagnosis found it.
fn describe_truth(scenario: &Scenario, found: &Diagnosis, answer: &Answer) -> String {
    let truth = &scenario.truth;
    let mut text = String::from("Hidden effect: ");
    for hidden in &truth.hidden {
        text += &format!(
            "{}; it changes the torque by {} Nm RMS at {} Nm of sensor noise. ",
            hidden.in_words,
            figure(hidden.visible_rms_nm),
            figure(truth.noise_nm)
        );
    }
    let named = found.cause();
    text += &match (answer.is_right, answer.named.len()) {
        (true, 1) => "The diagnosis was right.".to_owned(),
        (true, _) => format!(
            "The first cause of the diagnosis was right, but it named causes that are not present: {}.",
            answer.named[1..].join(", ")
        ),
        (false, _) if named == "none" => "The diagnosis was wrong: it found nothing.".to_owned(),
        (false, _) => {
            let hedged = answer.hidden.iter().any(|hidden| answer.confusable.contains(hidden));
            let but = if hedged {
                ", but listed the true cause as indistinguishable from it"
            } else {
                ""
            };
            format!("The diagnosis was wrong: it named {named}{but}.")
        }
    };
    if let Some(EstimatedSize { value, is_truth_inside }) = answer.size {
        let inside = if is_truth_inside { "inside" } else { "outside" };
        text += &format!(
            " The estimated size is {}; the true size is {inside} the 95 % confidence interval.",
            figure(value)
        );
    }
    text
}

/// Returns the result of `--json`.
fn json_result(
    seed: u64,
    scenario: &Scenario,
    answer: &Answer,
    diagnosis: Value,
    replay: &Result<Tally>,
) -> Value {
    let replay = match replay {
        Ok(tally) => json!(tally),
        Err(why) => json!({ "refused": why.to_string() }),
    };
    json!({
        "schema": 1,
        "seed": seed,
        "hidden": answer.hidden,
        "named": answer.named,
        "right": answer.is_right,
        "size_inside_ci95": answer.size.as_ref().map(|size| size.is_truth_inside),
        "truth": scenario.truth.json(),
        "replay": replay,
        "diagnosis": diagnosis,
    })
}

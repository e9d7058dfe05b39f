//! `simulate`: a simulated machine's log and the truth behind it.
//!
//! Without `--hide` the log is of a joint whose load and pressure act as paper 0 says. With it, one
//! physical effect or two, or none, is hidden in an otherwise random campaign, for a diagnosis to find.

use super::output::{OutputArguments, say};
use crate::simulated;
use clap::ValueEnum;
use friction_identification::data::{Dataset, EmitOptions, emit};
use serde_json::Value;
use simulated_machines::scenarios::{self, HiddenCause, Kind, Options, ScenarioTruth};
use simulated_machines::{Recording, record};

/// Machines that can be simulated.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Simulation {
    /// The joint of paper 0 on its test stand: speeds, side loads and pressures
    UnderwaterJoint,
}

/// Arguments of `simulate`.
#[derive(clap::Args)]
pub struct Arguments {
    /// The machine
    #[arg(value_enum)]
    scenario: Simulation,
    #[command(flatten)]
    output: OutputArguments,
    /// Hide a physical effect, of SIZE in its term's unit or of one that shows; `none` and `unknown`
    /// are causes too. Twice for two effects. What is not given below is then drawn by the seed
    #[arg(long, value_name = "CAUSE[:SIZE]", value_parser = Hide::parse, conflicts_with_all = ["unloaded", "steady"])]
    hide: Vec<Hide>,
    /// Draws the machine; the same seed, the same log
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Number of runs [default: 8]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: Option<u32>,
    /// Length of a run, s [default: 10]
    #[arg(long, value_name = "S", value_parser = positive)]
    seconds: Option<f64>,
    /// Sample rate, Hz [default: 1000]
    #[arg(long, value_name = "HZ", value_parser = positive)]
    rate: Option<f64>,
    /// Standard deviation of the torque sensor, Nm [default: 0.05]
    #[arg(long, value_name = "NM", value_parser = positive)]
    noise: Option<f64>,
    /// No side load and no pressure
    #[arg(long)]
    unloaded: bool,
    /// Steady sliding only
    #[arg(long)]
    steady: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number <= 1e6 => Ok(number),
        _ => Err("expected a number above 0 and up to 1e6".into()),
    }
}

/// What is to be hidden: an effect, or nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hide {
    effect: Option<HiddenCause>,
    size: Option<f64>,
}

/// The cause that is none.
const NONE: &str = "none";

impl Hide {
    /// Reads `CAUSE` or `CAUSE:SIZE`.
    fn parse(text: &str) -> Result<Self, String> {
        let (name, size) = match text.split_once(':') {
            Some((name, size)) => (name, Some(size)),
            None => (text, None),
        };
        let effect = HiddenCause::parse(name);
        if effect.is_none() && name != NONE {
            let known: Vec<&str> = HiddenCause::ALL.iter().map(|effect| effect.name()).collect();
            return Err(format!("unknown cause, expected one of {NONE}, {}", known.join(", ")));
        }
        let Some(size) = size else { return Ok(Self { effect, size: None }) };
        let Some(effect) = effect.filter(|effect| *effect != HiddenCause::OutsideCatalogue) else {
            return Err(format!("{name} takes no size"));
        };
        let (least, most) = effect.bounds();
        match size.parse::<f64>() {
            Ok(number) if (least..=most).contains(&number) => {
                Ok(Self { effect: Some(effect), size: Some(number) })
            }
            _ => Err(format!(
                "expected a size from {least} to {most} {} ({} is no effect)",
                effect.unit(),
                effect.neutral()
            )),
        }
    }
}

/// What kind of scenario is asked for.
fn kind(hide: &[Hide]) -> Result<Kind, String> {
    let kind = match *hide {
        [Hide { effect: None, .. }] => Kind::None,
        [Hide { effect: Some(effect), .. }] => Kind::One(effect),
        [Hide { effect: Some(one), .. }, Hide { effect: Some(other), .. }] if one != other => {
            Kind::Two(one, other)
        }
        [_, _] => {
            return Err("--hide: expected two different causes, and none only by itself".into());
        }
        _ => return Err(format!("--hide: found {} causes, expected at most two", hide.len())),
    };
    Ok(kind)
}

/// A log ready to be written.
struct Log {
    csv: String,
    truth: Value,
    data: Dataset,
    hidden: String,
}

/// Runs the command.
pub fn run(arguments: &Arguments) -> Result<(), String> {
    let Simulation::UnderwaterJoint = arguments.scenario;
    let log = if arguments.hide.is_empty() { plain(arguments)? } else { hidden(arguments)? };
    let json = serde_json::to_string_pretty(&log.truth).map_err(|e| e.to_string())? + "\n";
    let mut files = vec![("data.csv", log.csv.as_str()), ("truth.json", json.as_str())];
    let trace = log.trace()?;
    files.extend(trace.as_ref().map(|trace| ("trace.log", trace.as_str())));
    arguments.output.write(&files)?;
    if arguments.output.json {
        return say(&json);
    }
    let out = arguments.output.out.display();
    let written: Vec<String> = files.iter().map(|(name, _)| format!("{out}/{name}")).collect();
    let (runs, rows, hidden, seed) =
        (log.data.runs.len(), log.data.rows, &log.hidden, arguments.seed);
    let written = written.join(", ");
    say(&format!("simulated: {runs} runs, {rows} rows, seed {seed}\n{hidden}written: {written}\n"))
}

/// Rows from which on no trace is written: six frames each would be a gigabyte.
const MOST_TRACED: usize = 2_000_000;

impl Log {
    /// The log as `candump -L` would have written it on the joint's bus.
    fn trace(&self) -> Result<Option<String>, String> {
        if self.data.rows > MOST_TRACED {
            return Ok(None);
        }
        let options = EmitOptions {
            auxiliary: self.data.covariates.first().cloned(),
            ..EmitOptions::default()
        };
        let mut trace = Vec::new();
        emit(&self.data, &options, &mut trace).map_err(|error| format!("trace.log: {error}"))?;
        String::from_utf8(trace).map(Some).map_err(|error| format!("trace.log: {error}"))
    }
}

/// The joint with load and pressure as they are in the paper.
fn plain(arguments: &Arguments) -> Result<Log, String> {
    let default = Recording::default();
    let how = Recording {
        runs: arguments.runs.map_or(default.runs, |runs| runs as usize),
        seconds: arguments.seconds.unwrap_or(default.seconds),
        rate_hz: arguments.rate.unwrap_or(default.rate_hz),
        noise_nm: arguments.noise.unwrap_or(default.noise_nm),
        loaded: !arguments.unloaded,
        steady: arguments.steady,
    };
    if how.seconds * how.rate_hz * how.runs as f64 > 1e8 {
        return Err("--runs x --seconds x --rate: more than 1e8 rows".into());
    }
    let truth = record(arguments.seed, how);
    Ok(Log {
        csv: truth.csv(),
        truth: truth.json(),
        data: simulated::dataset(&truth.log()),
        hidden: String::new(),
    })
}

/// Most seconds and rows of a hidden scenario: every step of all runs is held in memory.
const MOST_SECONDS: f64 = 2000.0;
const MOST_ROWS: f64 = 5e6;

/// A joint with something hidden.
fn hidden(arguments: &Arguments) -> Result<Log, String> {
    let kind = kind(&arguments.hide)?;
    let options = Options {
        runs: arguments.runs.map(|runs| runs as usize),
        seconds: arguments.seconds,
        rate_hz: arguments.rate,
        noise_nm: arguments.noise,
        ..Options::default()
    };
    // What is not given is drawn: some 170 s in all, in six runs at least of a second at least.
    let seconds = match (arguments.runs.map(f64::from), arguments.seconds) {
        (Some(runs), Some(seconds)) => runs * seconds,
        (runs, seconds) => (runs.unwrap_or(6.0) * seconds.unwrap_or(1.0)).max(170.0),
    };
    if seconds > MOST_SECONDS {
        return Err(format!("--runs x --seconds: more than {MOST_SECONDS} s with --hide"));
    }
    if seconds * arguments.rate.unwrap_or(2000.0) > MOST_ROWS {
        return Err(format!("--runs x --seconds x --rate: more than {MOST_ROWS} rows with --hide"));
    }
    let sizes: Vec<Option<f64>> = arguments.hide.iter().map(|hide| hide.size).collect();
    let scenario = scenarios::draw_with(kind, &sizes, arguments.seed, &options);
    Ok(Log {
        csv: scenario.log.csv(),
        truth: scenario.truth.json(),
        hidden: told(&scenario.truth),
        data: simulated::dataset(&scenario.log),
    })
}

/// A line for each hidden effect.
fn told(truth: &ScenarioTruth) -> String {
    if truth.hidden.is_empty() {
        return "hidden: none\n".to_owned();
    }
    let noise_nm = truth.noise_nm;
    let line = |hidden: &scenarios::Hidden| {
        let scenarios::Hidden { in_words, visible_rms_nm, .. } = hidden;
        format!("hidden: {in_words}; {visible_rms_nm:.3} Nm RMS under {noise_nm:.3} Nm of noise\n")
    };
    truth.hidden.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_and_sizes_are_read() {
        let hide = |text| Hide::parse(text).unwrap();
        assert_eq!(hide("none"), Hide { effect: None, size: None });
        let effect = Some(HiddenCause::PressureCoulomb);
        assert_eq!(hide("pressure-coulomb"), Hide { effect, size: None });
        assert_eq!(hide("pressure-coulomb:2e-6"), Hide { effect, size: Some(2e-6) });
        assert_eq!(hide("torque-offset:-0.1").size, Some(-0.1));
        assert_eq!(hide("unknown").effect, Some(HiddenCause::OutsideCatalogue));
    }

    #[test]
    fn what_is_wrong_is_said() {
        for (text, word) in [
            ("pressure", "expected one of none, radial-force-coulomb"),
            ("", "expected one of none"),
            (":", "expected one of none"),
            ("None", "expected one of none"),
            ("none:1", "none takes no size"),
            ("unknown:1", "unknown takes no size"),
            ("pressure-coulomb:", "from 0 to 0.0001 Nm/Pa"),
            ("pressure-coulomb:1", "from 0 to 0.0001 Nm/Pa"),
            ("pressure-coulomb:-1e-9", "from 0 to 0.0001 Nm/Pa"),
            ("pressure-coulomb:1e-6:2", "from 0 to 0.0001 Nm/Pa"),
            ("torque-offset:nan", "from -10 to 10 Nm"),
            ("torque-offset:inf", "from -10 to 10 Nm"),
            ("stribeck-shape:0", "from 0.3 to 8 1 (2 is no effect)"),
        ] {
            let said = Hide::parse(text).unwrap_err();
            assert!(said.contains(word), "{text}: {said}");
        }
    }

    #[test]
    fn no_text_brings_the_reader_down() {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_pcg::Pcg64::seed_from_u64(1);
        let parts = [
            "none",
            "unknown",
            "backlash",
            "time-drift",
            ":",
            "-",
            ".",
            "0",
            "1e",
            "e-3",
            "99",
            "inf",
            "NaN",
            " ",
            "\u{e9}",
            "\0",
            "",
        ];
        for _ in 0..5000 {
            let count = random.random_range(0..5);
            let text: String =
                (0..count).map(|_| parts[random.random_range(0..parts.len())]).collect();
            match Hide::parse(&text) {
                Ok(Hide { effect: Some(effect), size: Some(size) }) => {
                    let (least, most) = effect.bounds();
                    assert!((least..=most).contains(&size), "{text:?}");
                }
                Ok(Hide { effect, size }) => assert_eq!(size, None, "{text:?} {effect:?}"),
                Err(said) => assert!(!said.is_empty() && !said.contains('\n'), "{text:?}"),
            }
        }
    }

    #[test]
    fn at_most_two_different_causes() {
        let kind = |texts: &[&str]| {
            kind(&texts.iter().map(|text| Hide::parse(text).unwrap()).collect::<Vec<_>>())
        };
        assert_eq!(kind(&["none"]), Ok(Kind::None));
        assert_eq!(kind(&["backlash"]), Ok(Kind::One(HiddenCause::Backlash)));
        let both = Kind::Two(HiddenCause::Backlash, HiddenCause::TorqueOffset);
        assert_eq!(kind(&["backlash", "torque-offset"]), Ok(both));
        for texts in [
            &["none", "backlash"][..],
            &["backlash", "none"],
            &["backlash", "backlash"],
            &["backlash", "torque-offset", "time-drift"],
        ] {
            assert!(kind(texts).is_err(), "{texts:?}");
        }
    }
}

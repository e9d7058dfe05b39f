//! Compares the diagnosis with the plain regression on unkind worlds and on measured logs.
//!
//! ```text
//! cargo run --release -p friction-grading --example unkind -- --worlds 60 --seed 1          the tables of both families
//! cargo run --release -p friction-grading --example unkind -- --world SEED --out DIR        one world: data.csv, truth.json
//! ```

use clap::Parser;
use friction_grading::contest::{Contest, run_contest};
use friction_grading::measured::{MEASURED_LOGS, MeasuredContest};
use friction_grading::{GradingError, end, score};
use measured_logs::MeasuredLogs;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use unkind_worlds::{Family, SensorKind};

/// Grades the diagnosis and the plain regression.
#[derive(Parser)]
struct Arguments {
    /// Number of worlds of each family
    #[arg(long, default_value_t = 60)]
    worlds: usize,
    /// Base of their seeds: 1 for tuning, others for grading
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only this family of worlds: training, lubricated-seal or mixed
    #[arg(long, value_parser = family)]
    family: Option<Family>,
    /// Only worlds with this kind of sensors: exact, encoder, velocity-noise, no-position, torque-filtered, held
    #[arg(long, value_parser = sensor)]
    only: Option<SensorKind>,
    /// Runs the regression only
    #[arg(long)]
    rival_only: bool,
    /// Seed of a single world
    #[arg(long)]
    world: Option<u64>,
    /// Writes data.csv and truth.json of that world to this folder
    #[arg(long, requires = "world")]
    out: Option<PathBuf>,
    /// Uses measured logs instead of worlds
    #[arg(long)]
    measured: bool,
    /// Only measured logs with this text in their file name
    #[arg(long, default_value = "")]
    file: String,
    /// Prints the other candidates on measured logs
    #[arg(long)]
    candidates: bool,
    /// Writes graded/diagnosis-benchmark.tsv
    #[arg(long)]
    update: bool,
    /// Writes all results as JSON
    #[arg(long)]
    json: Option<PathBuf>,
    /// Number of worlds computed at once
    #[arg(long, default_value_t = 2)]
    threads: usize,
}

fn sensor(name: &str) -> Result<SensorKind, String> {
    SensorKind::parse(name).ok_or_else(|| {
        let known: Vec<&str> = SensorKind::ALL.iter().map(|kind| kind.name()).collect();
        format!("expected one of {}", known.join(", "))
    })
}

fn family(name: &str) -> Result<Family, String> {
    Family::parse(name).ok_or_else(|| {
        let known: Vec<&str> = Family::ALL.iter().map(|family| family.name()).collect();
        format!("expected one of {}", known.join(", "))
    })
}

fn main() -> ExitCode {
    end(run(&Arguments::parse()))
}

fn run(arguments: &Arguments) -> Result<(), GradingError> {
    if let (Some(seed), Some(folder)) = (arguments.world, &arguments.out) {
        return write_world(seed, folder);
    }
    if arguments.measured {
        return measured_logs(arguments);
    }
    let seeds: Vec<u64> = match arguments.world {
        Some(seed) => vec![seed],
        None => {
            let is_chosen =
                |seed: &u64| arguments.only.is_none_or(|k| k == unkind_worlds::sensor_kind(*seed));
            unkind_worlds::seeds(arguments.seed).filter(is_chosen).take(arguments.worlds).collect()
        }
    };
    let families = match arguments.family {
        Some(family) => vec![family],
        None => vec![Family::Training, Family::LubricatedSeal],
    };
    let worlds: Vec<(u64, Family)> =
        families.iter().flat_map(|family| seeds.iter().map(move |seed| (*seed, *family))).collect();
    let contests = all(&worlds, arguments.rival_only, arguments.threads);
    if let Some(path) = &arguments.json {
        let list: Vec<Value> = contests.iter().map(Contest::json).collect();
        write(path, &format!("{:#}", Value::from(list)))?;
    }
    let tables = score::tables(&contests);
    println!("{tables}");
    if arguments.update {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/graded/diagnosis-benchmark.tsv");
        let text = score::file(&contests, arguments.seed, &tables);
        write(Path::new(path), &text)?;
    }
    println!("{}", score::times(&contests));
    println!("\nmissed:\n{}", score::misses(&contests));
    if contests.len() < worlds.len() {
        return Err(GradingError::NoAnswers(worlds.len() - contests.len()));
    }
    Ok(())
}

/// Computes all worlds in parallel, each on one thread; the results are in the order of the worlds.
fn all(worlds: &[(u64, Family)], rival_only: bool, threads: usize) -> Vec<Contest> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                loop {
                    let place = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&(seed, family)) = worlds.get(place) else { return };
                    match run_contest(seed, family, rival_only) {
                        Ok(found) => {
                            eprintln!("{}", found.line());
                            done.lock().expect("no thread panics").push((place, found));
                        }
                        Err(why) => eprintln!("FAILED {why}"),
                    }
                }
            });
        }
    });
    let mut done = done.into_inner().expect("no thread panics");
    done.sort_by_key(|(place, _)| *place);
    done.into_iter().map(|(_, contest)| contest).collect()
}

fn measured_logs(arguments: &Arguments) -> Result<(), GradingError> {
    let logs = MeasuredLogs::full().ok_or(GradingError::NoMeasuredLogs)?;
    println!("| file | rows | known | diagnosis | gain | s | regression | gain | s |");
    println!("|---|---|---|---|---|---|---|---|---|");
    let (mut all, mut right) = (0, [0, 0]);
    for log in MEASURED_LOGS.iter().filter(|log| log.file.contains(&arguments.file)) {
        let contest = log.contest(&logs, arguments.rival_only)?;
        let Some(MeasuredContest { rows, ours, rival }) = contest else {
            println!("| {} | not there |", log.file);
            continue;
        };
        all += 1;
        let cells = [ours, Some(rival)].into_iter().enumerate().map(|(side, answer)| {
            let Some(answer) = answer else { return "- | - | -".to_owned() };
            if arguments.candidates {
                eprintln!("{} side {side}: {}", log.file, answer.candidates);
            }
            let is_right = log.is_right(answer.first);
            right[side] += usize::from(is_right);
            let mark = if is_right { "" } else { "**not** " };
            let named =
                if answer.named.is_empty() { "none".into() } else { answer.named.join(", ") };
            format!("{mark}{named} | {:.3} | {:.1}", answer.gain, answer.seconds)
        });
        let cells: Vec<String> = cells.collect();
        println!("| {} | {rows} | {} | {} |", log.file, log.known(), cells.join(" | "));
    }
    println!("\nright: diagnosis {} of {all}, regression {} of {all}", right[0], right[1]);
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<(), GradingError> {
    std::fs::write(path, text).map_err(GradingError::io(path))
}

fn write_world(seed: u64, folder: &Path) -> Result<(), GradingError> {
    let world = unkind_worlds::draw(seed);
    std::fs::create_dir_all(folder).map_err(GradingError::io(folder))?;
    write(&folder.join("data.csv"), &world.log.csv())?;
    write(&folder.join("truth.json"), &format!("{:#}\n", world.truth.json()))?;
    println!("{}", world.truth.description);
    Ok(())
}

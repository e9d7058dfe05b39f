//! Compares the diagnosis with the plain regression on unkind worlds and on measured logs.
//!
//! ```text
//! cargo run --release -p friction-grading --example unkind -- --worlds 60 --seed 1          the tables of both families
//! cargo run --release -p friction-grading --example unkind -- --world SEED --out DIR        one world: data.csv, truth.json
//! ```

use clap::Parser;
use friction_grading::contest::{Contest, run_contest};
use friction_grading::{measured, score};
use measured_logs::MeasuredLogs;
use serde_json::Value;
use std::path::PathBuf;
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

fn main() -> Result<(), String> {
    let arguments = Arguments::parse();
    if let (Some(seed), Some(folder)) = (arguments.world, &arguments.out) {
        return write_world(seed, folder);
    }
    if arguments.measured {
        return measured_logs(&arguments);
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
        let text = serde_json::to_string_pretty(&list).map_err(|e| e.to_string())?;
        std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    let tables = score::tables(&contests);
    println!("{tables}");
    if arguments.update {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/graded/diagnosis-benchmark.tsv");
        let text = score::file(&contests, arguments.seed, &tables);
        std::fs::write(path, text).map_err(|e| format!("{path}: {e}"))?;
    }
    println!("{}", score::times(&contests));
    println!("\nmissed:\n{}", score::misses(&contests));
    if contests.len() < worlds.len() {
        return Err(format!("{} worlds had no answer", worlds.len() - contests.len()));
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
                            if let Ok(mut done) = done.lock() {
                                done.push((place, found));
                            }
                        }
                        Err(why) => eprintln!("FAILED {why}"),
                    }
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_default();
    done.sort_by_key(|(place, _)| *place);
    done.into_iter().map(|(_, contest)| contest).collect()
}

fn measured_logs(arguments: &Arguments) -> Result<(), String> {
    let logs = MeasuredLogs::full().ok_or("no measured logs: set MEASURED_DATA to their folder")?;
    println!("| file | rows | known | diagnosis | gain | s | regression | gain | s |");
    println!("|---|---|---|---|---|---|---|---|---|");
    let (mut all, mut right) = (0, [0, 0]);
    for log in measured::MEASURED_LOGS.iter().filter(|log| log.file.contains(&arguments.file)) {
        let Some((rows, ours, rival)) = log.contest(&logs, arguments.rival_only)? else {
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

fn write_world(seed: u64, folder: &std::path::Path) -> Result<(), String> {
    let world = unkind_worlds::draw(seed);
    let truth = serde_json::to_string_pretty(&world.truth.json()).map_err(|e| e.to_string())?;
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    for (name, text) in [("data.csv", world.log.csv()), ("truth.json", truth + "\n")] {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    println!("{}", world.truth.description);
    Ok(())
}

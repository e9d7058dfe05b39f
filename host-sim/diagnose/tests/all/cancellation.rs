//! A caller stops a diagnosis in any stage within 200 ms of processor time. The wall time would depend on other programs.

use friction_diagnose::diagnose;
use friction_diagnose::prepare::{Error, PrepareOptions, Source, prepare};
use joint_log::work::{Progress, report_stage, run};
use joint_log::{Cells, Table};
use std::cell::{Cell, RefCell};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Longest time from a key press to the end of the work that does not feel ignored.
const LIMIT: Duration = Duration::from_millis(200);

/// Attempts to end in time: other tests and programs may hold the processor during one of them.
const ATTEMPTS: usize = 5;

/// A log of a joint with friction that rises with pressure.
fn log(runs: usize, rows: usize) -> Table {
    let mut columns = vec![Vec::new(); 5];
    for run in 0..runs {
        for row in 0..rows {
            let time = 0.002 * row as f64;
            let velocity = (1.0 + 0.3 * run as f64) * (1.7 * time + run as f64).sin();
            let pressure = 1e5 * (run % 4) as f64 * (1.0 + 0.5 * (0.21 * time).sin());
            let noise = 0.02 * (((row * 7919 + run * 104_729) % 1000) as f64 / 1000.0 - 0.5);
            let level = 1.0 + 1e-6 * pressure + 0.4 * (-(velocity / 0.1).powi(2)).exp();
            let torque = level * (velocity / 0.01).tanh() + 0.3 * velocity + noise;
            for (column, value) in
                columns.iter_mut().zip([run as f64, time, velocity, torque, pressure])
            {
                column.push(value);
            }
        }
    }
    let names = ["run", "time_s", "velocity_rad_s", "torque_nm", "pressure_diff_pa"];
    let columns = names.map(String::from).into_iter().zip(columns.into_iter().map(Cells::Numbers));
    Table { name: "joint".into(), columns: columns.collect() }
}

fn diagnose_table(table: &Table) -> Result<String, Error> {
    let input = prepare(&Source::Tables(vec![table.clone()]), &PrepareOptions::default())?;
    let question = input.question();
    Ok(diagnose(&input.data, &input.split, &question, &report_stage)?.cause().to_owned())
}

/// Returns the processor time of the thread in this folder of `/proc`; zero on a system without it.
fn processor_time(thread: &Path) -> Duration {
    let text = std::fs::read_to_string(thread.join("schedstat")).unwrap_or_default();
    Duration::from_nanos(text.split(' ').next().and_then(|time| time.parse().ok()).unwrap_or(0))
}

/// The thread that computes, and its processor time at the end, however it ends.
#[derive(Default)]
struct Worker(Mutex<(PathBuf, Duration)>);

impl Worker {
    fn folder(&self) -> PathBuf {
        self.0.lock().expect("no panic").0.clone()
    }
}

struct Working<'a>(&'a Worker);

impl<'a> Working<'a> {
    fn begin(worker: &'a Worker) -> Self {
        let thread = std::fs::read_link("/proc/thread-self").unwrap_or_default();
        worker.0.lock().expect("no panic").0 = Path::new("/proc").join(thread);
        Self(worker)
    }
}

impl Drop for Working<'_> {
    fn drop(&mut self) {
        let mut worker = self.0.0.lock().expect("no panic");
        worker.1 = processor_time(&worker.0);
    }
}

/// Stops a diagnosis on one thread `delay` after it reported `count` states. Returns its outcome, the processor time from the
/// request to the end, and all states that it reported.
fn stop_after(
    count: usize,
    delay: Duration,
    table: &Table,
) -> (Result<String, Error>, Duration, Vec<Progress>) {
    let (states, reached) = (RefCell::new(Vec::new()), Cell::new(None));
    let (worker, stopped) = (Worker::default(), Cell::new(None));
    let progress = |state: &Progress| {
        let mut states = states.borrow_mut();
        if states.last() != Some(state) {
            states.push(state.clone());
        }
        if states.len() < count {
            return ControlFlow::Continue(());
        }
        let begin = reached.get().unwrap_or_else(Instant::now);
        reached.set(Some(begin));
        if begin.elapsed() < delay {
            return ControlFlow::Continue(());
        }
        stopped.set(Some(processor_time(&worker.folder())));
        ControlFlow::Break(())
    };
    let outcome = run(1, &progress, || {
        let _working = Working::begin(&worker);
        diagnose_table(table)
    });
    let end = worker.0.lock().expect("no panic").1;
    let took = stopped.get().map_or(Duration::ZERO, |at| end.saturating_sub(at));
    (outcome, took, states.into_inner())
}

#[test]
fn diagnosis_stopped_in_any_stage_ends_in_time() {
    let table = log(6, 2000);
    let (cause, _, states) = stop_after(usize::MAX, Duration::ZERO, &table);
    assert_eq!(cause.expect("a diagnosis"), "pressure-coulomb");
    assert!(states.len() > 5, "{states:?}");
    // A third of the stages, with both delays; `--all` stops in each.
    let step = if std::env::var_os("LONG_TESTS").is_some() { 1 } else { 3 };
    let tried: Vec<usize> = (1..=states.len()).step_by(step).collect();
    let mut cancelled = 0;
    for &count in &tried {
        // The start of a stage, and work inside of it.
        let delay = Duration::from_millis(if count % 2 == 0 { 40 } else { 0 });
        let mut attempts = (0..ATTEMPTS).map(|_| stop_after(count, delay, &table));
        let (outcome, took, reported) = attempts
            .find(|(_, took, _)| *took < LIMIT)
            .unwrap_or_else(|| stop_after(count, delay, &table));
        assert!(took < LIMIT, "{took:?} in {reported:?}");
        match outcome {
            Err(Error::Cancelled(_)) => cancelled += 1,
            Ok(cause) => assert_eq!(cause, "pressure-coulomb"),
            Err(error) => panic!("{error}"),
        }
    }
    // The last stages may end before the question that stops them.
    assert!(2 * cancelled > tried.len(), "{cancelled} of {}", tried.len());
}

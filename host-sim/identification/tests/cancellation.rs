//! A caller stops a reading, a fit or a diagnosis at any time: within 200 ms, and no thread works on.

use friction_identification::data::{Cells, Table};
use friction_identification::diagnose::diagnose;
use friction_identification::prepare::{Error, PrepareOptions, Source, prepare};
use friction_identification::work::{Progress, report_stage, run};
use std::cell::Cell;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Longest time from a key press to the end of the work that does not feel ignored.
const LIMIT: Duration = Duration::from_millis(200);

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

/// Stops a diagnosis after `delay`. Returns its outcome, the time from the request to the end, and the stage.
fn stop_after(delay: Duration, table: &Table) -> (Result<String, Error>, Duration, String) {
    let (begin, stopped) = (Instant::now(), Cell::new(None));
    let stage = Cell::new(String::new());
    let progress = |state: &Progress| {
        stage.set(format!("{state:?}"));
        if begin.elapsed() < delay {
            return ControlFlow::Continue(());
        }
        stopped.set(Some(Instant::now()));
        ControlFlow::Break(())
    };
    let outcome = run(2, &progress, || diagnose_table(table));
    // A signal arrives up to an interval earlier than the question that stops the work.
    let took = stopped.get().map_or(Duration::ZERO, |at| at.elapsed());
    (outcome, took, stage.take())
}

#[test]
fn diagnosis_stopped_at_any_time_ends_in_time() {
    let table = log(6, 4000);
    let begin = Instant::now();
    let cause = run(2, &|_| ControlFlow::Continue(()), || diagnose_table(&table));
    let whole = begin.elapsed();
    assert_eq!(cause.expect("a diagnosis"), "pressure-coulomb");
    let mut cancelled = 0;
    for step in 0..24 {
        let (outcome, took, stage) = stop_after(whole * step / 24, &table);
        eprintln!("{step}: {took:?} in {stage}");
        match outcome {
            Err(Error::Cancelled(_)) => cancelled += 1,
            other => assert!(step > 12, "{other:?}"),
        }
        assert!(took < LIMIT, "{took:?} after step {step}, in {stage}");
    }
    assert!(cancelled > 12, "{cancelled}");
}

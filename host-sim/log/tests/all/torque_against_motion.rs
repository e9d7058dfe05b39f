//! Torque and motion against each other: drawn joints with one fault each, and the same joints without it.

use joint_log::Dataset;
use joint_log::log_check::{CheckedLog, Corrections, LogFindingKind as Kind, check};
use joint_log::setting::{self, Message};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// Returns the number of joints of each fault, in the short and in the long form.
fn joints() -> u64 {
    if std::env::var_os("LONG_TESTS").is_some() { 30 } else { 10 }
}

/// Least share of the joints whose fault is found.
const LEAST_FOUND: f64 = 0.9;

/// Most joints without a fault in which one is found.
const MOST_FALSE: usize = 1;

/// A row: time, position, velocity, torque, mode of the drive.
type Row = [f64; 5];

/// A drawn joint: its friction, load and sensors.
struct Joint {
    random: Pcg64,
    step_s: f64,
    inertia: f64,
    coulomb: f64,
    viscous: f64,
    gravity: f64,
    /// Fall of the Stribeck curve, as a share of the Coulomb torque, and its velocity.
    fall: f64,
    stribeck: f64,
    noise: f64,
    velocity_noise: f64,
    /// Amplitude, frequency in Hz and phase of the parts of its motion.
    waves: [[f64; 3]; 3],
    /// Time of motion, and of the rest after it, s.
    moves_s: f64,
    rests_s: f64,
}

impl Joint {
    fn draw(seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let coulomb = 10f64.powf(random.random_range(-1.0..1.0));
        let mut wave = || {
            let amplitude = random.random_range(0.1..0.7);
            [amplitude, random.random_range(0.1..0.6), random.random_range(0.0..TAU)]
        };
        let waves = [wave(), wave(), wave()];
        let speed: f64 = waves.iter().map(|[amplitude, hz, _]| amplitude * TAU * hz).sum();
        Self {
            step_s: [0.002, 0.005, 0.01, 0.02][random.random_range(0..4)],
            inertia: coulomb * random.random_range(0.01..0.15),
            coulomb,
            viscous: coulomb / speed * random.random_range(0.1..1.5),
            gravity: [0.0, coulomb * random.random_range(0.2..1.5)][random.random_range(0..2)],
            fall: random.random_range(0.0..0.6),
            stribeck: speed * random.random_range(0.02..0.2),
            noise: coulomb * random.random_range(0.01..0.05),
            velocity_noise: speed * random.random_range(1e-4..3e-3),
            moves_s: random.random_range(4.0..12.0),
            rests_s: random.random_range(0.3..1.5),
            waves,
            random,
        }
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.random)
    }

    /// Returns position, velocity and acceleration. The joint rests from time to time, and speeds up and slows down smoothly.
    fn motion(&self, time: f64) -> [f64; 3] {
        let period = self.moves_s + self.rests_s;
        let (count, within) = ((time / period).floor(), time % period);
        // Time of the motion, which stands still in a rest and changes its pace within a tenth of a move.
        let ramp = 0.1 * self.moves_s;
        let pace = |at: f64| {
            let up = (at / ramp).clamp(0.0, 1.0);
            let down = ((self.moves_s - at) / ramp).clamp(0.0, 1.0);
            let smooth = |x: f64| x * x * (3.0 - 2.0 * x);
            smooth(up) * smooth(down)
        };
        let ramped = |at: f64| {
            let x = (at / ramp).clamp(0.0, 1.0);
            ramp * (x * x * x - 0.5 * x * x * x * x)
        };
        let whole = self.moves_s - ramp;
        let passed = if within < self.moves_s - ramp {
            ramped(within) + (within - ramp).max(0.0)
        } else {
            whole - ramped((self.moves_s - within).max(0.0))
        };
        let clock = count * whole + passed;
        let slope = (pace(within + 1e-4) - pace(within - 1e-4)) / 2e-4;
        let mut found = [0.0; 3];
        for [amplitude, hz, phase] in self.waves {
            let (w, at) = (TAU * hz, TAU * hz * clock + phase);
            found[0] += amplitude * at.sin();
            found[1] += amplitude * w * at.cos() * pace(within);
            found[2] -= amplitude * w * w * at.sin() * pace(within).powi(2);
            found[2] += amplitude * w * at.cos() * slope;
        }
        found
    }

    /// Returns the rows of a recording.
    fn rows(&mut self, seconds: f64) -> Vec<Row> {
        let count = (seconds / self.step_s) as usize;
        let row = |row: usize| {
            let time = self.step_s * row as f64;
            let [position, velocity, acceleration] = self.motion(time);
            let direction = (velocity / 1e-3).tanh();
            // A Stribeck curve and a loaded gear, which the law of the checks does not have.
            let curve = 1.0 + self.fall * (-(velocity / self.stribeck).powi(2)).exp();
            let load = 0.1 * (self.gravity * position.sin()).abs();
            let friction = (self.coulomb * curve + load) * direction + self.viscous * velocity;
            let torque = self.inertia * acceleration + friction + self.gravity * position.sin();
            let torque = torque + self.noise * self.normal();
            [time, position, velocity + self.velocity_noise * self.normal(), torque, 10.0]
        };
        (0..count).map(row).collect()
    }
}

fn dataset(runs: &[Vec<Row>], has_mode: bool) -> Dataset {
    let names = ["time_s", "position_rad", "velocity_rad_s", "torque_nm", "mode"];
    let count = if has_mode { 5 } else { 4 };
    let names: Vec<String> = names[..count].iter().map(|name| (*name).to_owned()).collect();
    let run = |(number, rows): (usize, &Vec<Row>)| {
        let column = |at: usize| rows.iter().map(|row| row[at]).collect();
        (number.to_string(), (0..count).map(column).collect())
    };
    Dataset::from_columns(&names, runs.iter().enumerate().map(run)).expect("columns")
}

fn without_position(runs: &[Vec<Row>]) -> Dataset {
    let names = ["time_s", "velocity_rad_s", "torque_nm"].map(str::to_owned);
    let run = |(number, rows): (usize, &Vec<Row>)| {
        let columns = [0, 2, 3].map(|at| rows.iter().map(|row| row[at]).collect());
        (number.to_string(), columns.to_vec())
    };
    Dataset::from_columns(&names, runs.iter().enumerate().map(run)).expect("columns")
}

fn checked(runs: &[Vec<Row>]) -> CheckedLog {
    check(dataset(runs, false), Corrections::default())
}

fn has(log: &CheckedLog, kind: Kind) -> bool {
    let is_refused = log.suspicion.as_ref().is_some_and(|suspicion| suspicion.kind == kind);
    is_refused || log.findings.iter().any(|finding| finding.kind == kind)
}

/// Kinds of faults that contradict the motion.
const KINDS: [Kind; 8] = [
    Kind::MagnitudeOnly,
    Kind::SignBit,
    Kind::DriveOff,
    Kind::PositionJump,
    Kind::EndStop,
    Kind::OffsetPerRun,
    Kind::TwoSources,
    Kind::Saturated,
];

/// Spoils joints, and requires that the fault is found in most of them.
fn found_in_most(kind: Kind, spoil: impl Fn(&mut Joint) -> Vec<Vec<Row>>) {
    let missed: Vec<u64> = (0..joints())
        .filter(|seed| !has(&checked(&spoil(&mut Joint::draw(1000 * kind as u64 + seed))), kind))
        .collect();
    let (found, all) = (joints() as usize - missed.len(), joints());
    println!("measured: {} found in {found} of {all}", kind.name());
    assert!(
        found as f64 >= LEAST_FOUND * all as f64,
        "{}: missed in joints {missed:?}",
        kind.name()
    );
}

/// Requires that no fault is found in most joints.
fn clean_in_most(what: &str, make: impl Fn(&mut Joint) -> Vec<Vec<Row>>) {
    let mut wrong = Vec::new();
    for seed in 0..joints() {
        let log = checked(&make(&mut Joint::draw(90_000 + seed)));
        wrong.extend(KINDS.iter().filter(|kind| has(&log, **kind)).map(|kind| (seed, kind.name())));
    }
    println!("measured: {} false of {} with {what}", wrong.len(), joints());
    assert!(wrong.len() <= MOST_FALSE, "{what}: {wrong:?}");
}

#[test]
fn check_with_sound_logs_reports_no_contradiction() {
    clean_in_most("nothing hidden", |joint| vec![joint.rows(40.0)]);
    clean_in_most("three runs", |joint| (0..3).map(|_| joint.rows(20.0)).collect());
    clean_in_most("a held load", |joint| {
        let hold = 3.0 * (joint.coulomb + joint.gravity);
        let mut rows = joint.rows(40.0);
        rows.iter_mut().for_each(|row| row[3] += hold);
        vec![rows]
    });
    clean_in_most("a payload for each run", |joint| {
        let loads = [0.0, 1.0, 2.0, 3.0].map(|share| share * joint.coulomb);
        let run = |load: f64| {
            let mut rows = joint.rows(20.0);
            rows.iter_mut().for_each(|row| row[3] += load * row[1].sin());
            rows
        };
        loads.map(run).to_vec()
    });
    clean_in_most("a run below a breakaway that pressure raises", |joint| {
        let rows = joint.rows(40.0);
        let end = rows.iter().map(|row| row[1]).fold(f64::INFINITY, f64::min);
        let held = rows.iter().take(1000).enumerate().map(|(row, moving)| {
            let push = -4.0 * joint.coulomb * (row as f64 / 500.0).sin().powi(2);
            [moving[0], end, 0.0, push, 10.0]
        });
        let held = held.collect();
        vec![rows, held]
    });
    clean_in_most("a torque with few digits", |joint| {
        let (step, mut rows) = (0.3 * joint.coulomb, joint.rows(40.0));
        rows.iter_mut().for_each(|row| row[3] = (row[3] / step).round() * step);
        vec![rows]
    });
}

#[test]
fn check_with_coasting_joint_reports_no_drive_off() {
    clean_in_most("a joint that coasts", |joint| {
        // Friction alone decelerates it.
        let mut rows = joint.rows(30.0);
        let fastest = rows.iter().map(|row| row[2]).fold(0.0, f64::max);
        let (mut velocity, mut position) = (fastest, 0.0);
        let start = rows.len() as f64 * joint.step_s;
        let gravity = std::mem::replace(&mut joint.gravity, 0.0);
        rows.iter_mut().for_each(|row| row[3] -= gravity * row[1].sin());
        let mut time = start;
        while velocity > 0.0 {
            rows.push([time, position, velocity, 0.0, 10.0]);
            let before = velocity;
            velocity -= joint.step_s * (joint.coulomb + joint.viscous * velocity) / joint.inertia;
            position += joint.step_s * 0.5 * (velocity + before);
            time += joint.step_s;
        }
        let second = rows.split_off((start / joint.step_s) as usize);
        vec![rows, second]
    });
}

#[test]
fn check_with_torque_without_sign_refuses_log() {
    found_in_most(Kind::MagnitudeOnly, |joint| {
        let mut rows = joint.rows(40.0);
        rows.iter_mut().for_each(|row| row[3] = row[3].abs());
        vec![rows]
    });
    found_in_most(Kind::SignBit, |joint| {
        let mut rows = joint.rows(40.0);
        let largest = rows.iter().map(|row| row[3].abs()).fold(0.0, f64::max);
        rows.iter_mut().for_each(|row| {
            let count = (600.0 * row[3] / largest).round();
            row[3] = if count < 0.0 { 1024.0 - count } else { count };
        });
        vec![rows]
    });
}

#[test]
fn check_with_drive_off_leaves_rows_out_and_names_column() {
    let spoil = |joint: &mut Joint| {
        let mut rows = joint.rows(40.0);
        let off = rows.len() * joint.random.random_range(20..60) / 100;
        rows[..off].iter_mut().for_each(|row| (row[3], row[4]) = (0.0, 3.0));
        vec![rows]
    };
    found_in_most(Kind::DriveOff, spoil);
    let log = check(dataset(&spoil(&mut Joint::draw(1)), true), Corrections::default());
    let found = log.findings.iter().find(|finding| finding.kind == Kind::DriveOff).expect("found");
    assert!(found.in_words.contains("--where mode=10"), "{}", found.in_words);
    assert!(log.data.runs[0].torque.iter().filter(|torque| **torque == 0.0).count() < 10);
}

#[test]
fn check_with_lost_blocks_of_rows_begins_pieces() {
    found_in_most(Kind::PositionJump, |joint| {
        let rows = joint.rows(60.0);
        let lost = (0.4 / joint.step_s) as usize;
        let blocks: Vec<usize> =
            (0..12).map(|_| joint.random.random_range(0..rows.len() - lost)).collect();
        let is_kept = |row: &usize| !blocks.iter().any(|from| (*from..from + lost).contains(row));
        let mut kept: Vec<Row> = (0..rows.len()).filter(is_kept).map(|row| rows[row]).collect();
        // The clock runs on.
        kept.iter_mut().zip(&rows).for_each(|(row, clock)| row[0] = clock[0]);
        vec![kept]
    });
}

#[test]
fn check_with_end_stop_leaves_rows_out() {
    found_in_most(Kind::EndStop, |joint| {
        let mut rows = joint.rows(40.0);
        let most = rows.iter().map(|row| row[3].abs()).fold(0.0, f64::max);
        let end = rows.iter().map(|row| row[1]).fold(f64::INFINITY, f64::min);
        let count = (0.8 / joint.step_s) as usize;
        let (start, mut stop) = (rows.len() as f64 * joint.step_s, Vec::new());
        for row in 0..count {
            let push = -2.0 * most * (row as f64 / count as f64);
            let (time, noise) = (joint.step_s * row as f64, joint.noise * joint.normal());
            stop.push([
                start + time,
                end,
                joint.velocity_noise * joint.normal(),
                push + noise,
                10.0,
            ]);
        }
        rows.extend(stop);
        vec![rows]
    });
}

#[test]
fn check_without_position_finds_end_stop_and_none_in_a_sound_log() {
    let is_found = |rows: &[Row]| {
        let log = without_position(&[rows.to_vec()]);
        has(&check(log, Corrections::default()), Kind::EndStop)
    };
    let (mut found, mut wrong) = (0, 0);
    for seed in 0..joints() {
        let mut joint = Joint::draw(7_000 + seed);
        let rows = joint.rows(40.0);
        wrong += usize::from(is_found(&rows));
        let most = rows.iter().map(|row| row[3].abs()).fold(0.0, f64::max);
        let least = |row: &usize| rows[*row][1];
        let end = (0..rows.len()).min_by(|a, b| least(a).total_cmp(&least(b))).expect("rows");
        // The joint pushes where its travel ends, and then goes on.
        let push = (0..(0.8 / joint.step_s) as usize).map(|row| {
            let time = rows[end][0] + joint.step_s * (row + 1) as f64;
            let velocity = joint.velocity_noise * joint.normal();
            [time, rows[end][1], velocity, -2.0 * most + joint.noise * joint.normal(), 10.0]
        });
        let push: Vec<Row> = push.collect();
        let later =
            |row: &Row| [row[0] + joint.step_s * push.len() as f64, row[1], row[2], row[3], row[4]];
        let rest: Vec<Row> = rows[end + 1..].iter().map(later).collect();
        found += usize::from(is_found(&[&rows[..=end], &push, &rest].concat()));
    }
    println!(
        "measured: end stops without a position: {found} found, {wrong} false of {}",
        joints()
    );
    assert!(
        found as f64 >= LEAST_FOUND * joints() as f64 && wrong <= MOST_FALSE,
        "{found}, {wrong}"
    );
}

#[test]
fn check_with_slow_reversals_at_the_ends_keeps_their_rows() {
    // One run is fast, the other turns slowly where the travel ends. Its friction towards rest is greater than in any row that
    // counts as moving, and no stop is there.
    let found = (0..joints()).filter(|seed| {
        let mut joint = Joint::draw(1000 + seed);
        (joint.rests_s, joint.gravity, joint.inertia) = (0.0, 0.0, 0.0);
        let fast = joint.rows(20.0);
        let extreme = |column: usize| fast.iter().map(|row| row[column]).fold(0.0, f64::max);
        let (most, speed) = (extreme(1), 0.1 * extreme(2));
        joint.fall = joint.random.random_range(0.5..1.0);
        joint.stribeck = 0.2 * speed;
        let turn_rad_s = TAU * 0.2;
        let mut slow = joint.rows(20.0);
        for row in &mut slow {
            let (sin, cos) = (turn_rad_s * row[0]).sin_cos();
            let velocity = -speed * sin;
            let curve = 1.0 + joint.fall * (-(velocity / joint.stribeck).powi(2)).exp();
            let friction = joint.coulomb * curve * (velocity / (0.01 * speed)).tanh();
            row[1] = most + speed / turn_rad_s * (cos - 1.0);
            row[2] = velocity + joint.velocity_noise * joint.normal();
            row[3] = friction + joint.noise * joint.normal();
        }
        let runs = [fast, slow];
        let blind = check(without_position(&runs), Corrections::default());
        has(&checked(&runs), Kind::EndStop) || has(&blind, Kind::EndStop)
    });
    assert_eq!(found.collect::<Vec<_>>(), [0; 0], "seeds");
}

#[test]
fn check_with_offset_for_each_run_subtracts_it() {
    found_in_most(Kind::OffsetPerRun, |joint| {
        let run = |_| {
            let (offset, mut rows) = (joint.coulomb * joint.normal(), joint.rows(15.0));
            rows.iter_mut().for_each(|row| row[3] += offset);
            rows
        };
        (0..5).map(run).collect()
    });
}

#[test]
fn check_with_rows_of_two_sources_refuses_log() {
    found_in_most(Kind::TwoSources, |joint| {
        let mut other = Joint::draw(joint.random.random_range(0..1000));
        other.step_s = joint.step_s;
        let (one, two) = (joint.rows(20.0), other.rows(20.0));
        let pair = |(one, mut two): (Row, Row)| {
            two[1] += 5.0;
            two[0] += 0.4 * joint.step_s;
            [one, two]
        };
        vec![one.into_iter().zip(two).flat_map(pair).collect()]
    });
}

#[test]
fn check_with_clipped_torque_reports_saturation_and_none_at_rest() {
    found_in_most(Kind::Saturated, |joint| {
        let mut rows = joint.rows(40.0);
        let mut sizes: Vec<f64> = rows.iter().map(|row| row[3].abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let limit = sizes[sizes.len() * 7 / 10];
        rows.iter_mut().for_each(|row| row[3] = row[3].clamp(-limit, limit));
        vec![rows]
    });
}

#[test]
fn check_with_gear_between_motions_proposes_readings_of_one_side() {
    for seed in 0..joints() {
        let mut joint = Joint::draw(70_000 + seed);
        let ratio = joint.random.random_range(1.2..40.0);
        let mut rows = joint.rows(40.0);
        rows.iter_mut().for_each(|row| row[2] *= ratio);
        let log = checked(&[rows]);
        let suspicion = log.suspicion.unwrap_or_else(|| panic!("joint {seed}, ratio {ratio}"));
        assert_eq!(suspicion.kind, Kind::UnitSuspect);
        let error = suspicion.error(&log.data).marked();
        let text = setting::plain(&error);
        let factor =
            text.split(":").find_map(|part| part.split("rad/s").next()?.parse::<f64>().ok());
        // A ratio near that of a unit is read as this unit.
        let of_unit = ["rpm", "deg", "mrad", "rev"].iter().any(|unit| text.contains(unit));
        let is_right = factor.is_some_and(|factor| (factor * ratio - 1.0).abs() < 0.02);
        assert!(is_right || of_unit, "joint {seed}, ratio {ratio}: {text}");
    }
}

//! Scenario 27: the current loop at its highest bandwidth, under limits of voltage, with a changing bus, and with an open
//! bridge.
//!
//! A stand holds or turns the joint. All currents are the plant's own, recorded after each period.

use super::rig::{Joint, Master, set};
use super::table::{ScenarioRow, check, row};
use compensator_core::can::NodeId;
use firmware::node::dictionary::index;
use std::f64::consts::TAU;
use std::sync::LazyLock;

const SCENARIO: u8 = 27;

/// A tenth of the loop rate, Hz.
const BANDWIDTH_HZ: f32 = 2000.0;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = steps();
        rows.extend(changing_bus());
        rows.extend(weakened_field());
        rows.extend(moved_by_hand());
        rows
    });
    &ROWS
}

/// A joint at this bandwidth that accepts a low bus voltage.
fn joint() -> Joint {
    let mut set = set(0.0);
    set.motor.current_bandwidth_hz = BANDWIDTH_HZ;
    set.motor.velocity_max_rad_s = 18.0;
    let thresholds = &mut set.thresholds;
    (thresholds.bus_undervoltage_v, thresholds.bus_undervoltage_clear_v) = (16.0, 17.0);
    (thresholds.overspeed_rad_s, thresholds.stall_current_a) = (20.0, 26.0);
    Joint::with(set)
}

/// Response to a step of the set-point.
struct Response {
    /// Torque-producing current of each period, relative to the step: 0 before, 1 at the set-point.
    shares: Vec<f64>,
}

impl Response {
    /// Largest value beyond the step, as a share of it, over means of two periods: the noise of a sample is not overshoot.
    fn overshoot(&self) -> f64 {
        self.shares.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).fold(f64::MIN, f64::max) - 1.0
    }

    /// Time from 10 to 90 %, ms.
    fn rise_ms(&self) -> f64 {
        let first = |share: f64| self.shares.iter().position(|y| *y > share).unwrap_or(usize::MAX);
        0.05 * (first(0.9) as f64 - first(0.1) as f64)
    }

    /// Frequency at which the response has lost 3 dB, Hz: the impulse response is the difference of two periods.
    fn bandwidth_hz(&self) -> f64 {
        let gain = |hz: f64| {
            let (mut real, mut imaginary, mut before) = (0.0, 0.0, 0.0);
            for (k, y) in self.shares.iter().enumerate() {
                let (sine, cosine) = (TAU * hz * 50e-6 * k as f64).sin_cos();
                (real, imaginary) = (real + (y - before) * cosine, imaginary + (y - before) * sine);
                before = *y;
            }
            real.hypot(imaginary)
        };
        let found = (10..1000).map(|k| 10.0 * f64::from(k)).find(|hz| gain(*hz) < 0.5f64.sqrt());
        found.unwrap_or(1e4)
    }

    /// RMS deviation from the set-point in the last half, as a share of the step.
    fn left(&self) -> f64 {
        let end = &self.shares[self.shares.len() / 2..];
        (end.iter().map(|y| (y - 1.0).powi(2)).sum::<f64>() / end.len() as f64).sqrt()
    }
}

/// Holds one current, steps to another for 8 ms, and returns the response.
fn step(master: &mut Master, from_a: f64, to_a: f64) -> Response {
    master.current(10, from_a);
    master.rig.plant_mut().record_currents();
    master.current(8, to_a);
    let recorded = master.rig.plant_mut().record_currents();
    let shares = recorded.iter().map(|[_, _, q]| (q - from_a) / (to_a - from_a));
    Response { shares: shares.collect() }
}

fn steps() -> Vec<ScenarioRow> {
    let [nominal, saturated, limited] = joint().run(|master| {
        master.arm().expect("it arms");
        master.rig.plant_mut().hold(true);
        let nominal = step(master, 2.0, 10.0);
        master.rig.plant_mut().set_inductance(0.7 * 88e-6);
        let saturated = step(master, 2.0, 10.0);
        master.rig.plant_mut().set_inductance(88e-6);
        master.rig.plant_mut().set_supply(20.0);
        let limited = step(master, -20.0, 20.0);
        assert!(master.rig.is_armed(), "{:?}", master.faults());
        [nominal, saturated, limited]
    });
    let name = "2 kHz set, joint held: step from 2 to 10 A";
    // A first-order lag of 2 kHz rises in 0.175 ms. A sample of the current is 3 to 4 mA of noise per ampere.
    let mut rows = vec![
        row(
            SCENARIO,
            name,
            "bandwidth of the response (-3 dB), Hz",
            nominal.bandwidth_hz(),
            1800.0..=2800.0,
        ),
        row(SCENARIO, name, "rise time, ms", nominal.rise_ms(), 0.1..=0.25),
        row(SCENARIO, name, "overshoot", nominal.overshoot(), -0.01..=0.06),
        row(SCENARIO, name, "RMS deviation after 4 ms, share", nominal.left(), 0.0..=0.02),
    ];
    let name = "the same with 30 % less inductance than written";
    rows.push(row(SCENARIO, name, "overshoot", saturated.overshoot(), 0.0..=0.25));
    rows.push(row(SCENARIO, name, "RMS deviation after 4 ms, share", saturated.left(), 0.0..=0.03));
    let name = "bus of 20 V: step from -20 to 20 A, which the voltage limits";
    // 11 V less 5 V of drops and the gain's own rise: 40 A take at least 0.3 ms.
    rows.push(row(SCENARIO, name, "rise time, ms", limited.rise_ms(), 0.2..=0.8));
    rows.push(row(SCENARIO, name, "overshoot", limited.overshoot(), -0.01..=0.04));
    rows.push(row(SCENARIO, name, "RMS deviation after 4 ms, share", limited.left(), 0.0..=0.01));
    rows
}

/// Turns the joint up to a speed within this time, at a current.
fn turn(master: &mut Master, speed_rad_s: f64, milliseconds: usize, current_a: f64) {
    for k in 1..=milliseconds {
        let share = k as f64 / milliseconds as f64;
        master.rig.plant_mut().turn(Some(speed_rad_s * share));
        master.current(1, current_a);
    }
}

/// Largest deviation of a recorded current from its set-point, A.
fn deviation_a(recorded: &[[f64; 3]], current_a: f64) -> f64 {
    recorded.iter().fold(0.0f64, |most, [_, _, q]| most.max((q - current_a).abs()))
}

/// The joint turns at 8 rad/s, so that 5 V of induced voltage depend on the right duties.
fn changing_bus() -> Vec<ScenarioRow> {
    const CURRENT_A: f64 = 5.0;
    let (still, down, up, wave_a) = joint().run(|master| {
        master.arm().expect("it arms");
        turn(master, 8.0, 60, CURRENT_A);
        master.current(20, CURRENT_A);
        let mut deviation = |supply_v: f64| {
            master.rig.plant_mut().set_supply(supply_v);
            master.rig.plant_mut().record_currents();
            master.current(5, CURRENT_A);
            deviation_a(&master.rig.plant_mut().record_currents(), CURRENT_A)
        };
        let (still, down, up) = (deviation(48.0), deviation(36.0), deviation(48.0));
        for k in 0..50 {
            let volts = 48.0 + 4.0 * (TAU * 0.1 * f64::from(k)).sin();
            master.rig.plant_mut().set_supply(volts);
            master.current(1, CURRENT_A);
        }
        let recorded = master.rig.plant_mut().record_currents();
        let (mut cosine, mut sine, mut seconds) = (0.0, 0.0, 0.0);
        for [t, _, q] in recorded {
            let dt = t - seconds;
            seconds = t;
            let (s, c) = (TAU * 100.0 * t).sin_cos();
            (cosine, sine) = (cosine + (q - CURRENT_A) * c * dt, sine + (q - CURRENT_A) * s * dt);
        }
        assert!(master.rig.is_armed(), "{:?}", master.faults());
        (still, down, up, 2.0 * cosine.hypot(sine) / seconds)
    });
    let name = "5 A while a stand turns the joint at 8 rad/s";
    // Until the next duties, two periods later, 12 V of 48 V change 1.7 V of 6: 1.9 A at 88 uH.
    vec![
        row(SCENARIO, name, "largest current error, constant bus, A", still, 0.0..=0.5),
        row(
            SCENARIO,
            name,
            "largest current error, bus from 48 to 36 V in one step, A",
            down,
            0.1..=2.2,
        ),
        row(
            SCENARIO,
            name,
            "largest current error, bus from 36 to 48 V in one step, A",
            up,
            0.1..=2.5,
        ),
        row(
            SCENARIO,
            name,
            "100 Hz current of a bus ripple of 4 V at 100 Hz, A",
            wave_a,
            0.0..=0.06,
        ),
    ]
}

/// A bus too low for the speed: the induced voltage exceeds the circle.
fn weakened_field() -> Vec<ScenarioRow> {
    let name =
        "bus of 18.5 V, a stand turns the joint at 17 rad/s: 11.3 V induced, 10.1 V available; 5 A";
    let (armed, d_a, q_a, most_a, limited) = joint().run(|master| {
        master.arm().expect("it arms");
        master.rig.plant_mut().set_supply(18.5);
        turn(master, 17.0, 100, 5.0);
        master.rig.plant_mut().record_currents();
        master.current(50, 5.0);
        let recorded = master.rig.plant_mut().record_currents();
        let mean =
            |axis: usize| recorded.iter().map(|row| row[axis]).sum::<f64>() / recorded.len() as f64;
        let most = recorded.iter().fold(0.0f64, |most, [_, d, q]| most.max(d.hypot(*q)));
        let limits = master.rig.active_limits();
        let limited = limits.iter().any(|code| code.info().name == "voltage-limited");
        (master.rig.is_armed(), mean(1), mean(2), most, limited)
    });
    let flag = |is: bool| f64::from(u8::from(is));
    vec![
        row(SCENARIO, name, "stays armed", flag(armed), 1.0..=1.0),
        row(SCENARIO, name, "reported as limited", flag(limited), 1.0..=1.0),
        row(SCENARIO, name, "mean current along the magnet, A", d_a, -8.0..=-2.0),
        row(SCENARIO, name, "mean torque-producing current, A", q_a, -1.0..=5.2),
        row(SCENARIO, name, "largest current vector, A", most_a, 1.0..=26.0),
    ]
}

/// The bridge is open, and a hand moves the joint.
fn moved_by_hand() -> Vec<ScenarioRow> {
    let name = "bridge open, a hand moves the joint by ±0.12 rad at 2 Hz for 0.5 s";
    let (error, repeated) = joint().run(|master| {
        // Telemetry of every sample, as the master of an armed joint has it.
        for at_index in [index::TRANSMIT_ANSWER, index::TRANSMIT_TELEMETRY] {
            master.rig.write_object_byte(at_index, 2, 1);
            master.rig.step_idle();
        }
        master.rig.send_immediately(0, &[1, NodeId::FIRST.number()]);
        let (mut error, mut repeated, mut before) = (0.0f64, 0, f64::NAN);
        for k in 0..600 {
            let velocity = 1.5 * (TAU * 2.0 * f64::from(k) * 1e-3).sin();
            master.rig.plant_mut().turn(Some(velocity));
            master.rig.step_idle();
            let reported = f64::from(master.rig.master_view().velocity_rad_s);
            if k >= 100 {
                error = error.max((reported - velocity).abs());
                repeated += u32::from(reported == before);
            }
            before = reported;
        }
        assert!(!master.rig.is_armed());
        (error, f64::from(repeated) / 500.0)
    });
    // A frame is up to 2 ms old, in which the velocity changes by 0.04 rad/s; the noise of the observer adds as much.
    vec![
        row(SCENARIO, name, "largest error of the reported velocity, rad/s", error, 0.0..=0.1),
        row(SCENARIO, name, "share of reports that repeat the one before", repeated, 0.0..=0.05),
    ]
}

#[test]
fn current_loop_at_highest_bandwidth_keeps_its_limits() {
    check(rows());
}

//! Scenario 17: reactions to a stop (CiA 402, 605Ah to 605Eh, 6007h) at 3 rad/s in CSV.

use super::rig::{Joint, Master, set};
use super::table::{ScenarioRow, check, row};
use super::velocity::{drive, enable};
use firmware::node::dictionary::index;
use firmware::supervisor::CanState;
use joint_rig::{EncoderFault, WATCHDOG_TIMEOUT_MS};
use simulated_machines::joint_plant::JointPlant;
use std::sync::LazyLock;

/// Speed before a stop, rad/s.
const SPEED_RAD_S: f64 = 3.0;
/// Decelerations of 6084h and 6085h, rad/s^2.
pub const SLOW: f64 = 10.0;
const QUICK: f64 = 50.0;
/// Speed at which the joint counts as standing, rad/s.
pub const REST_RAD_S: f64 = 0.05;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        let mut rows = Vec::new();
        for stop in commands() {
            rows.extend(stop.rows());
        }
        for stop in losses() {
            rows.extend(stop.rows());
        }
        for stop in network_stops() {
            rows.extend(stop.rows());
        }
        rows.extend(moving_start());
        rows.extend(holds());
        rows.extend(halt());
        rows
    });
    &ROWS
}

pub fn flag(yes: bool) -> f64 {
    f64::from(u8::from(yes))
}

/// Writes an object of two bytes.
pub fn write_short(master: &mut Master, at_index: u16, sub_index: u8, value: i16) {
    let [low, high] = at_index.to_le_bytes();
    let [a, b] = value.to_le_bytes();
    master.rig.send_immediately(0x601, &[0x2B, low, high, sub_index, a, b, 0, 0]);
    (0..3).for_each(|_| master.rig.step_idle());
}

/// How the joint comes to rest.
#[derive(Clone, Copy, PartialEq)]
enum Way {
    /// A ramp with this deceleration, rad/s^2.
    Ramp(f64),
    /// Shorted low sides.
    Short,
    /// Open switches.
    Coast,
}

/// A stop and its settings.
struct Stop {
    name: &'static str,
    settings: &'static [(u16, i16)],
    act: fn(&mut Master),
    /// The master goes on to send this controlword; `None` if it is silent.
    controlword: Option<u16>,
    way: Way,
    /// Time from the event to the begin of the reaction, ms.
    delay_ms: f64,
    /// The processor restarts once the joint has stopped.
    restarts: bool,
}

fn nothing(_: &mut Master) {}

const QUICK_STOP: Option<u16> = Some(0x0B);

/// Stops by a command of the master.
fn commands() -> [Stop; 6] {
    use Way::{Coast, Ramp, Short};
    let stop = |name, settings, controlword, way| Stop {
        name,
        settings,
        act: nothing,
        controlword,
        way,
        delay_ms: 0.0,
        restarts: false,
    };
    [
        stop("quick stop, 605Ah = 0", &[(index::QUICK_STOP_OPTION, 0)], QUICK_STOP, Coast),
        stop("quick stop, 605Ah = -1", &[(index::QUICK_STOP_OPTION, -1)], QUICK_STOP, Short),
        stop("quick stop, 605Ah = 1", &[(index::QUICK_STOP_OPTION, 1)], QUICK_STOP, Ramp(SLOW)),
        stop("quick stop, 605Ah = 2", &[(index::QUICK_STOP_OPTION, 2)], QUICK_STOP, Ramp(QUICK)),
        stop("shutdown, 605Bh = 1", &[(index::SHUTDOWN_OPTION, 1)], Some(0x06), Ramp(SLOW)),
        stop("disable operation, 605Ch = 1", &[(index::DISABLE_OPTION, 1)], Some(0x07), Ramp(SLOW)),
    ]
}

/// Stops without a command: the master is silent, or the encoder fails.
fn losses() -> [Stop; 6] {
    use Way::{Coast, Ramp, Short};
    // The last target is 1 ms old when the master falls silent.
    let silent = |name, settings, way| Stop {
        name,
        settings,
        act: nothing,
        controlword: None,
        way,
        delay_ms: 99.0,
        restarts: false,
    };
    fn cut_encoder(master: &mut Master) {
        let board = master.rig.stage_mut().board.as_mut().expect("a board");
        board.set_encoder(EncoderFault::Low);
    }
    let cut = |name, settings, way| Stop {
        name,
        settings,
        act: cut_encoder,
        controlword: Some(0x0F),
        way,
        delay_ms: 10.0,
        restarts: false,
    };
    [
        silent("the master stops sending, 605Eh = 0", &[(index::FAULT_OPTION, 0)], Coast),
        silent("the master stops sending, 605Eh = -1", &[(index::FAULT_OPTION, -1)], Short),
        silent("the master stops sending, 605Eh = 2", &[(index::FAULT_OPTION, 2)], Ramp(QUICK)),
        silent(
            "the master stops sending, 6007h = 3, 605Ah = 1",
            &[(index::ABORT_CONNECTION, 3), (index::QUICK_STOP_OPTION, 1)],
            Ramp(SLOW),
        ),
        cut("encoder's line low, 605Eh = 2: no ramp", &[(index::FAULT_OPTION, 2)], Coast),
        cut("encoder's line low, 605Eh = -1", &[(index::FAULT_OPTION, -1)], Short),
    ]
}

/// Stops by the network, and by a processor that hangs. The master goes on to send targets.
fn network_stops() -> [Stop; 10] {
    use Way::{Coast, Ramp, Short};
    const FAULT_RAMP: &[(u16, i16)] = &[(index::FAULT_OPTION, 2)];
    fn reset(master: &mut Master) {
        master.rig.send_immediately(0, &[0x81, 1]);
    }
    fn reset_communication(master: &mut Master) {
        master.rig.send_immediately(0, &[0x82, 1]);
    }
    fn stop_node(master: &mut Master) {
        master.rig.send_immediately(0, &[2, 1]);
    }
    fn leave_bus(master: &mut Master) {
        master.rig.board_state_mut().can = CanState::Off;
    }
    fn hang(master: &mut Master) {
        master.rig.stall_background(100);
    }
    let stop = |name, settings, act, way| Stop {
        name,
        settings,
        act,
        controlword: Some(0x0F),
        way,
        delay_ms: 0.0,
        restarts: false,
    };
    let restart = |name, settings, way| Stop { restarts: true, ..stop(name, settings, reset, way) };
    [
        restart("NMT reset node, 605Eh = 0", &[(index::FAULT_OPTION, 0)], Coast),
        restart("NMT reset node, 605Eh = -1", &[(index::FAULT_OPTION, -1)], Short),
        restart("NMT reset node, 605Eh = 2", FAULT_RAMP, Ramp(QUICK)),
        restart(
            "NMT reset node, 6007h = 3, 605Ah = 1",
            &[(index::ABORT_CONNECTION, 3), (index::QUICK_STOP_OPTION, 1)],
            Ramp(SLOW),
        ),
        restart("NMT reset node, 6007h = 2", &[(index::ABORT_CONNECTION, 2)], Coast),
        stop("NMT reset communication, 605Eh = 2", FAULT_RAMP, reset_communication, Ramp(QUICK)),
        stop("NMT stop, 605Eh = 2", FAULT_RAMP, stop_node, Ramp(QUICK)),
        stop("bus off, 605Eh = 2", FAULT_RAMP, leave_bus, Ramp(QUICK)),
        stop("bus off, 605Eh = -1", &[(index::FAULT_OPTION, -1)], leave_bus, Short),
        Stop {
            delay_ms: f64::from(WATCHDOG_TIMEOUT_MS),
            restarts: true,
            ..stop("the background hangs, 605Eh = 2: watchdog, no ramp", FAULT_RAMP, hang, Coast)
        },
    ]
}

impl Stop {
    fn rows(&self) -> Vec<ScenarioRow> {
        let name = format!("CSV at 3 rad/s: {}", self.name);
        Joint::with(set(0.9)).run(|master| {
            for (at_index, value) in self.settings {
                write_short(master, *at_index, 0, *value);
            }
            enable(master);
            (0..1000).for_each(|_| drive(master, 0x0F, SPEED_RAD_S));
            let from = master.rig.plant().position_rad();
            (self.act)(master);
            master.rig.stage_mut().take_extremes();
            let (mut rest_ms, mut open_ms, mut restart_ms) = (f64::INFINITY, f64::INFINITY, 0.0);
            for ms in 0..1500 {
                match self.controlword {
                    Some(word) => drive(master, word, SPEED_RAD_S),
                    None => master.rig.step_idle(),
                }
                let stands = master.rig.plant().velocity_rad_s().abs() < REST_RAD_S;
                rest_ms = if stands { f64::min(rest_ms, f64::from(ms + 1)) } else { f64::INFINITY };
                if master.rig.stage_mut().applied_duty().is_none() {
                    open_ms = f64::min(open_ms, f64::from(ms + 1));
                }
                if !master.rig.is_reset() {
                    restart_ms = f64::from(ms + 2);
                }
            }
            let travel = master.rig.plant().position_rad() - from;
            let most_a = master.rig.stage_mut().take_extremes().current_a;
            let armed = flag(master.rig.is_armed());
            let mut rows = self.checked(&name, [rest_ms, open_ms, travel, most_a, armed]);
            if self.restarts {
                // Open low sides are reported within 3 ms, and the last frames take up to 20 ms.
                let figure = "from open bridge to restart, ms";
                rows.push(row(17, &name, figure, restart_ms - open_ms, 0.0..=25.0));
            }
            rows
        })
    }

    /// Limits: the ramp in time and travel, with the delay of the loop; without a ramp, what friction and the shorted
    /// motor take.
    fn checked(&self, name: &str, results: [f64; 5]) -> Vec<ScenarioRow> {
        let [rest_ms, open_ms, travel, most_a, armed] = results;
        let before = SPEED_RAD_S * self.delay_ms * 1e-3;
        let (rest, open, turned) = match self.way {
            Way::Ramp(deceleration) => {
                let ms = 1e3 * SPEED_RAD_S / deceleration;
                let way = 0.5 * SPEED_RAD_S * SPEED_RAD_S / deceleration;
                // The velocity loop lags by up to 30 ms, and the drive waits 20 ms at rest.
                (0.8 * ms..=ms + 80.0, 0.9 * ms + 15.0..=ms + 120.0, 0.8 * way..=way + 0.1)
            }
            // A short dissipates 0.54 J in half a turn of the motor and the friction; 1 s is the time of a joint that coasts.
            Way::Short => (5.0..=200.0, 0.0..=1500.0, 0.01..=0.25),
            Way::Coast => (50.0..=1500.0, 0.0..=3.0, 0.1..=1.5),
        };
        let later = |limits: std::ops::RangeInclusive<f64>, by: f64| {
            limits.start() + by * f64::from(u8::from(self.controlword.is_none()))
                ..=limits.end() + by
        };
        vec![
            row(17, name, "to rest, ms", rest_ms, later(rest, self.delay_ms)),
            row(17, name, "to open bridge, ms", open_ms, later(open, self.delay_ms)),
            row(17, name, "travel, rad", travel, later(turned, before)),
            row(17, name, "largest phase current, A", most_a, 0.5..=26.5),
            row(17, name, "stays armed", armed, 0.0..=0.0),
        ]
    }
}

/// The driver starts while the joint turns: the bridge stays open.
fn moving_start() -> Vec<ScenarioRow> {
    let name = "start of the driver while the joint turns at 8 rad/s";
    let turn = |plant: &mut JointPlant| {
        while plant.velocity_rad_s() < 8.0 {
            plant.period_at_current(50e-6, 20.0);
        }
    };
    Joint::with(set(0.9)).run_plant(turn, |master| {
        let speed = master.rig.plant().velocity_rad_s();
        (0..1500).for_each(|_| master.rig.step_idle());
        let extremes = master.rig.stage_mut().take_extremes();
        vec![
            // Friction takes 2 to 3 rad/s until the observer has settled.
            row(17, name, "speed after the start, rad/s", speed, 1.0..=8.0),
            row(17, name, "driven periods", extremes.driven_periods.into(), 0.0..=0.0),
            row(
                17,
                name,
                "speed at the end, rad/s",
                master.rig.plant().velocity_rad_s().abs(),
                0.0..=REST_RAD_S,
            ),
            row(17, name, "stays armed", flag(master.rig.is_armed()), 0.0..=0.0),
        ]
    })
}

/// *Quick stop active* holds the joint until "enable operation".
fn holds() -> Vec<ScenarioRow> {
    let name = "CSV at 3 rad/s: quick stop, 605Ah = 6, then enabled again";
    Joint::with(set(0.9)).run(|master| {
        write_short(master, index::QUICK_STOP_OPTION, 0, 6);
        enable(master);
        (0..1000).for_each(|_| drive(master, 0x0F, SPEED_RAD_S));
        (0..500).for_each(|_| drive(master, 0x0B, SPEED_RAD_S));
        let held = master.rig.plant().velocity_rad_s().abs();
        let status = master.rig.read_object(index::STATUSWORD, 0).unwrap_or_default();
        (0..500).for_each(|_| drive(master, 0x0F, SPEED_RAD_S));
        vec![
            row(17, name, "speed while held, rad/s", held, 0.0..=REST_RAD_S),
            row(17, name, "quick stop active is reported", flag(status & 0x6F == 0x07), 1.0..=1.0),
            row(
                17,
                name,
                "speed afterwards, rad/s",
                master.rig.plant().velocity_rad_s(),
                2.9..=3.1,
            ),
            row(17, name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
        ]
    })
}

/// Bit 8 of the controlword stops the joint and releases it again.
fn halt() -> Vec<ScenarioRow> {
    let name = "CSV at 3 rad/s: halt, 605Dh = 1, then released";
    Joint::with(set(0.9)).run(|master| {
        enable(master);
        (0..1000).for_each(|_| drive(master, 0x0F, SPEED_RAD_S));
        let from = master.rig.plant().position_rad();
        (0..600).for_each(|_| drive(master, 0x10F, SPEED_RAD_S));
        let travel = master.rig.plant().position_rad() - from;
        let held = master.rig.plant().velocity_rad_s().abs();
        let status = master.rig.read_object(index::STATUSWORD, 0).unwrap_or_default();
        (0..500).for_each(|_| drive(master, 0x0F, SPEED_RAD_S));
        let way = 0.5 * SPEED_RAD_S * SPEED_RAD_S / SLOW;
        vec![
            row(17, name, "travel, rad", travel, 0.8 * way..=way + 0.1),
            row(17, name, "speed while held, rad/s", held, 0.0..=REST_RAD_S),
            row(17, name, "target reached is reported", flag(status & 1 << 10 != 0), 1.0..=1.0),
            row(
                17,
                name,
                "speed afterwards, rad/s",
                master.rig.plant().velocity_rad_s(),
                2.9..=3.1,
            ),
            row(17, name, "stays armed", flag(master.rig.is_armed()), 1.0..=1.0),
        ]
    })
}

#[test]
fn stops_follow_their_option_codes() {
    check(rows());
}

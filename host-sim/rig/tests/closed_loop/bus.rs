//! Scenarios 6 to 8: limits of the bus voltage. Modulation at its limit, braking into a capacitor, and a supply dip.

use super::rig::{Joint, set};
use super::table::{ScenarioRow, check, row};
use firmware::parameter_set::ParameterSet;
use std::sync::LazyLock;

pub fn rows() -> &'static [ScenarioRow] {
    static ROWS: LazyLock<Vec<ScenarioRow>> = LazyLock::new(|| {
        [modulation(), braking(26.0), braking(8.0), dip(36.0), dip(19.0)].concat()
    });
    &ROWS
}

/// A parameter set that operates down to this bus voltage, V.
fn down_to(volts: f32) -> ParameterSet {
    let mut set = set(0.9);
    set.thresholds.bus_undervoltage_v = volts;
    set.thresholds.bus_undervoltage_clear_v = volts + 0.5;
    set
}

/// A commanded speed above what a low bus allows: accuracy of the measured current with low-side shunts.
fn modulation() -> Vec<ScenarioRow> {
    let name = "bus of 20 V, ±16 rad/s commanded: modulation at the stage's bound";
    let mut set = down_to(19.0);
    // 16 rad/s induces 10.7 V; a bus of 20 V provides 9.7 V at 84 %.
    (set.motor.velocity_max_rad_s, set.thresholds.overspeed_rad_s) = (20.0, 20.0);
    let joint = Joint::with(set);
    let (widest, apart, most, limited, armed) = joint.run_plant(
        |plant| plant.set_supply(20.0),
        |master| {
            master.arm().expect("it arms");
            let (mut widest, mut apart) = (0.0f64, 0.0f64);
            let mut limited = false;
            master.rig.stage_mut().take_extremes();
            for k in 0..4000 {
                let way = if k < 2000 { 1.0 } else { -1.0 };
                let share = (f64::from(k % 2000) / 400.0).min(1.0);
                master.follow(16.0 * way * share, 0.0);
                let duty = master.rig.stage_mut().applied_duty().unwrap_or_default();
                widest = duty.into_iter().fold(widest, f64::max);
                let limits = master.rig.active_limits();
                limited |= limits.iter().any(|code| code.info().name == "voltage-limited");
                if k % 2000 > 1000 {
                    let believed = f64::from(master.rig.master_view().current_a);
                    apart = apart.max((believed - master.rig.plant().torque_current_a()).abs());
                }
            }
            let most = master.rig.stage_mut().take_extremes();
            (widest, apart, most, limited, master.rig.is_armed())
        },
    );
    let flag = |yes: bool| f64::from(u8::from(yes));
    vec![
        row(6, name, "voltage-limited is reported", flag(limited), 1.0..=1.0),
        // (1 + 0.84) / 2: half the period less 0.5 us of dead time and 1.5 us of settling.
        row(6, name, "widest duty", widest, 0.88..=0.921),
        row(6, name, "measured minus true current, A", apart, 0.0..=1.0),
        // A step of the current loop with voltage reserve overshoots the limit by a tenth.
        row(6, name, "largest phase current, A", most.current_a, 3.0..=29.0),
        row(6, name, "stays armed", flag(armed), 1.0..=1.0),
    ]
}

/// Braking from 8 rad/s with this current, on a supply that takes no energy back.
fn braking(current_a: f64) -> Vec<ScenarioRow> {
    let name = format!("braking from 8 rad/s with {current_a} A into 1 mF at 48 V");
    let (most, overvoltage, left) = Joint::with(set(0.0)).run_plant(
        |plant| plant.charge_bus(),
        |master| {
            master.arm().expect("it arms");
            master.spin(8.0, 300);
            master.rig.stage_mut().take_extremes();
            for _ in 0..1000 {
                if master.rig.plant().velocity_rad_s() < 0.0 || !master.rig.is_armed() {
                    break;
                }
                master.current(1, -current_a);
            }
            let left = master.rig.plant().velocity_rad_s();
            master.current(20, 0.0);
            (master.rig.stage_mut().take_extremes(), master.has("bus-overvoltage"), left)
        },
    );
    // The copper absorbs the energy of hard braking. Gentle braking returns energy, and the capacitor can store 0.4 J more until
    // 56 V, so that the driver reduces the braking current before.
    vec![
        // Rating of the bridge; the loop opens it at 56 V.
        row(7, &name, "highest bus, V", most.bus_v, 48.0..=60.0),
        row(7, &name, "bus-overvoltage stops it", overvoltage, 0.0..=0.0),
        row(
            7,
            &name,
            "speed where the bridge opens or the joint turns back, rad/s",
            left,
            -0.5..=0.5,
        ),
        row(7, &name, "largest phase current, A", most.current_a, 1.0..=29.0),
    ]
}

/// 48 to 20 V and back in 20 ms each way, at 5 rad/s.
fn dip(undervoltage: f32) -> Vec<ScenarioRow> {
    let name = format!("bus 48, 20, 48 V at 5 rad/s, undervoltage at {undervoltage} V");
    let (below_ms, most, stopped, driven_after, back, again) = Joint::with(down_to(undervoltage))
        .run(|master| {
            master.arm().expect("it arms");
            master.spin(5.0, 500);
            master.rig.stage_mut().take_extremes();
            let (mut below_ms, mut last) = (0.0, 0);
            for k in 0..140 {
                let share =
                    if k < 20 { f64::from(k) / 20.0 } else { (f64::from(140 - k) / 20.0).min(1.0) };
                let bus_v = 48.0 - 28.0 * share;
                master.rig.stage_mut().plant.set_supply(bus_v);
                master.follow(5.0, 0.0);
                let open = master.rig.stage_mut().applied_duty().is_none();
                if bus_v < f64::from(undervoltage) && !open && last == 0 {
                    below_ms += 1.0;
                }
                last += usize::from(open);
            }
            master.rig.stage_mut().plant.set_supply(48.0);
            let most = master.rig.stage_mut().take_extremes();
            let stopped = !master.rig.is_armed();
            (0..500).for_each(|_| master.follow(5.0, 0.0));
            let driven = master.rig.stage_mut().take_extremes().driven_periods;
            let back = (master.rig.plant().velocity_rad_s() - 5.0).abs();
            master.rig.request_state(2);
            (below_ms, most, stopped, driven, back, master.arm().is_ok())
        });
    let flag = |yes: bool| f64::from(u8::from(yes));
    let mut rows = vec![
        row(8, &name, "largest phase current, A", most.current_a, 1.0..=29.0),
        row(8, &name, "arms again, faults cleared", flag(again), 1.0..=1.0),
    ];
    if undervoltage > 20.0 {
        rows.push(row(8, &name, "stopped", flag(stopped), 1.0..=1.0));
        // Undervoltage must last 2 ms and is checked once per millisecond.
        rows.push(row(8, &name, "below it with the bridge closed, ms", below_ms, 1.0..=5.0));
        rows.push(row(
            8,
            &name,
            "periods driven afterwards without a command",
            f64::from(driven_after),
            0.0..=0.0,
        ));
    } else {
        rows.push(row(8, &name, "stopped", flag(stopped), 0.0..=0.0));
        rows.push(row(8, &name, "velocity error 0.5 s later, rad/s", back, 0.0..=0.3));
    }
    rows
}

#[test]
fn current_and_bus_at_voltage_limits_stay_in_bounds() {
    check(rows());
}

//! Cycles of the current loop's interrupt and of the background, in closed loop.
//!
//! The joint is armed, follows a sine of velocity with compensation, and gets new parameters' orders, commands, sensor
//! frames and objects over the bus; the worst period counts. A run writes its figures to `target/figures/interrupt-cycles.tsv`.

use super::course::set;
use crate::common::{image, write_figures};
use compensator_core::LawKind;
use compensator_core::term::{MAX_TERMS, TermKind};
use emulated_board::BoardDriver;
use emulated_board::costs::Costs;
use emulated_board::cycles::Cost;
use firmware::reference_joint::configuration;
use joint_rig::{JointRig, PERIOD_CYCLES, PowerUp, RigFaults, stage_at_power_up};
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::ops::RangeInclusive;

/// The terms with the highest individual cost, the costliest first: as many as a model holds.
pub const COSTLIEST_TERMS: [TermKind; MAX_TERMS] = [
    TermKind::TorqueRipple,
    TermKind::DwellTimeStatic,
    TermKind::TimeDrift,
    TermKind::PositionRipple,
    TermKind::LookupTable,
    TermKind::GravityImbalance,
    TermKind::WarmUp,
    TermKind::Backlash,
];

/// A model whose costs are measured.
struct CostCase {
    name: &'static str,
    terms: &'static [TermKind],
    /// Limits of the share of the period that the interrupt takes, by the upper estimate: a tenth below, and 7 % above, as
    /// sensors that a user adds need what is left.
    shares: RangeInclusive<f64>,
}

const CASES: [CostCase; 3] = [
    CostCase { name: "improved LuGre", terms: &[], shares: 0.28..=0.34 },
    CostCase {
        name: "improved LuGre + the three most expensive terms",
        terms: COSTLIEST_TERMS.split_at(3).0,
        shares: 0.42..=0.50,
    },
    CostCase {
        name: "improved LuGre + the eight most expensive terms",
        terms: &COSTLIEST_TERMS,
        shares: 0.51..=0.60,
    },
];

/// Limits of the share of a millisecond that the background takes without the interrupts, by the upper estimate.
const BACKGROUND_SHARES: RangeInclusive<f64> = 0.25..=0.40;

/// Cycles of a millisecond.
const MILLISECOND_CYCLES: f64 = 170_000.0;

/// Cycles after the trigger of the currents from which `loop-late` is reported.
const LATE_CYCLES: u64 = 7650;

/// Functions of the file's second table.
const PARTS: usize = 16;

const HEAD: &str = "# Worst period\n\
model\tinstructions\tlower\tupper\t% of the period, upper\tend\tbackground, lower\tbackground, upper\n";

/// Runs the course with a model and this kind of encoder (`encoder_kind`), and returns its costs.
fn measure(terms: &[TermKind], encoder_kind: f32) -> Costs {
    let mut set = set();
    set.sensors.encoder_kind = encoder_kind;
    set.sensors.biss_turn_bits = 12.0;
    set.friction = configuration(LawKind::ImprovedLugre, terms);
    // The voltage of the dead time is compensated.
    set.motor.dead_time_s = 0.5e-6;
    let start = PowerUp { set: Some(&set), commissioned: true, board: true, ..PowerUp::default() };
    let faults = RigFaults::default();
    let plant = JointPlant::with_phase(&Parameters::default(), Load::Free, [0.7, 2.1], 5);
    let stage = stage_at_power_up(&start, plant, &faults);
    let mut driver = BoardDriver::start(image(), &start, stage).expect("the image starts");
    let costs = driver.record_costs();
    let mut rig = JointRig::new(Box::new(driver), faults);
    let at = rig.plant().position_rad();
    rig.arm(at).expect("it arms");
    let mut integral_a = 0.0;
    for k in 0..500 {
        let (sine, cosine) = (TAU * 2.0 * f64::from(k) * 1e-3).sin_cos();
        let error = 2.0 * sine - f64::from(rig.master_view().velocity_rad_s);
        integral_a += 1.5e-3 * error;
        let wanted = 0.12 * 4.0 * TAU * cosine + 1.5 * error + integral_a;
        rig.step_with_command(wanted as f32, (2.0 * sine) as f32);
    }
    assert!(rig.is_armed(), "{:?}", rig.latched_faults());
    drop(rig);
    costs.take()
}

/// A function in the worst period.
struct Part {
    function: String,
    cost: Cost,
}

/// Returns the parts of the worst period; the largest first.
fn parts(costs: &Costs) -> Vec<Part> {
    let mut sums: BTreeMap<String, Cost> = BTreeMap::new();
    for (address, cost) in &costs.blocks {
        let name = image()
            .function_at(*address)
            .map_or("?".into(), |symbol| format!("{:#}", rustc_demangle::demangle(&symbol.name)));
        let sum = sums.entry(name).or_default();
        sum.lower += cost.lower;
        sum.upper += cost.upper;
    }
    let mut parts: Vec<Part> =
        sums.into_iter().map(|(function, cost)| Part { function, cost }).collect();
    parts.sort_by_key(|part| std::cmp::Reverse(part.cost.upper));
    parts
}

fn emit(rows: &[(&str, Costs)]) -> String {
    let mut text = HEAD.to_owned();
    for (name, costs) in rows {
        let share = 100.0 * f64::from(costs.worst.upper) / f64::from(PERIOD_CYCLES);
        let _ = writeln!(
            text,
            "{name}\t{}\t{}\t{}\t{share:.0}\t{}\t{}\t{}",
            costs.instructions,
            costs.worst.lower,
            costs.worst.upper,
            costs.latest_end,
            costs.background.lower,
            costs.background.upper,
        );
    }
    text.push_str("\n# Parts\nfunction\tlower\tupper\n");
    let costs = &rows[1].1;
    let mut rest = costs.worst;
    for Part { function, cost } in parts(costs).iter().take(PARTS) {
        let _ = writeln!(text, "`{function}`\t{}\t{}", cost.lower, cost.upper);
        rest.lower = rest.lower.saturating_sub(cost.lower);
        rest.upper -= cost.upper;
    }
    let Cost { lower, upper } = rest;
    let _ = writeln!(text, "entry, return, registers, all others\t{lower}\t{upper}");
    text
}

#[test]
fn interrupt_in_closed_loop_stays_within_its_share_of_the_period() {
    let rows = CASES.map(|case| (case.name, measure(case.terms, 0.0)));
    let written = emit(&rows);
    print!("{written}");
    for ((name, costs), case) in rows.iter().zip(CASES) {
        let share = f64::from(costs.worst.upper) / f64::from(PERIOD_CYCLES);
        assert!(case.shares.contains(&share), "{name}: {share:.3} of a period");
        assert!(costs.runs > 10_000, "{name}: {} runs", costs.runs);
        assert!(costs.latest_end < LATE_CYCLES, "{name}: ends after {}", costs.latest_end);
        let share = f64::from(costs.background.upper) / MILLISECOND_CYCLES;
        let is_within = BACKGROUND_SHARES.contains(&share);
        assert!(is_within, "{name}: background {share:.3} of a millisecond");
    }
    write_figures("interrupt-cycles.tsv", &written);
}

/// The encoder of the board is the reference of the other kinds that know their angle at the start.
#[test]
fn interrupt_with_encoder_of_another_kind_takes_at_most_300_cycles_more() {
    let reference = measure(&[], 0.0).worst.upper;
    for (kind, name) in [(3.0, "ABZ and Hall sensors"), (4.0, "Hall sensors"), (5.0, "BiSS C")] {
        let worst = measure(&[], kind).worst.upper;
        println!("measured: {name}: {worst} cycles at most, AS5047P {reference}");
        assert!(worst <= reference + 300, "{name}: {worst} cycles, AS5047P {reference}");
    }
}

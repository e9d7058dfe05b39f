//! Every code of the table, raised and cleared by what it is about.

use super::bench::{Bench, STEP_US, boot_with};
use super::set;
use firmware::supervisor::codes::{DROPS_COMPENSATION, STOPPING, register};
use firmware::supervisor::{CODES, Code, CodeSet, Effect, Event, State, Watched};
use std::collections::HashSet;

/// A set-point that is late is late on a clock of its own.
fn raise_after_us(code: Code) -> u64 {
    let delay = u64::from(code.info().raise_after_us);
    if code == Code::CommandTimeout { delay + 100_000 } else { delay }
}

/// Codes that a cause brings along: a trip level lies beyond the derating level, a row of overruns
/// begins with one.
fn brought_along(code: Code) -> CodeSet {
    match code {
        Code::BridgeOvertemperature | Code::MotorOvertemperature => set(&[Code::Derated]),
        Code::LoopOverrun => set(&[Code::LoopLate]),
        _ => CodeSet::EMPTY,
    }
}

/// An offset can only be seen with the bridge off; everything else is tried with it on.
fn ready_for(code: Code) -> Bench {
    let mut bench = Bench::armed();
    if code == Code::CurrentOffset {
        bench.supervisor.disarm();
    }
    bench.events.clear();
    bench
}

#[test]
fn every_fault_is_raised_held_and_cleared() {
    let mut tried = 0;
    for code in Code::ALL.iter().copied().filter(|code| STOPPING.contains(*code)) {
        let mut bench = ready_for(code);
        if bench.spoil(code, true).is_none() {
            continue;
        }
        tried += 1;
        // Not before its time, and then at once. The first observation that sees it starts the time;
        // a set-point's runs from the last one.
        let delay_us = raise_after_us(code);
        let first = if code == Code::CommandTimeout { 0 } else { STEP_US };
        if delay_us > 0 {
            bench.run(first + delay_us - STEP_US);
            assert!(bench.supervisor.faults().is_empty(), "{code:?}");
        }
        let armed = bench.supervisor.is_armed();
        assert_eq!(bench.supervisor.bridge_allowed(), armed);
        bench.step();
        let supervisor = &mut bench.supervisor;
        assert_eq!(supervisor.faults(), set(&[code]), "{code:?}");
        assert_eq!(supervisor.state(), State::Fault);
        assert!(!supervisor.bridge_allowed() && !supervisor.compensation_allowed());
        assert!(supervisor.limits().without(brought_along(code)).is_empty());
        assert_eq!(supervisor.count_of(code), 1);
        assert!(bench.events.contains(&Event { code, raised: true }));

        // It cannot be cleared while its cause is there, nor armed over. (A current that flows on with
        // the bridge off is an offset too, but not this soon.)
        bench.run(40 * STEP_US);
        if matches!(code, Code::PhaseLost | Code::MotorAgainst | Code::MotorStands) {
            // With the bridge off nobody can tell: the cause counts as gone.
            assert!(!bench.supervisor.causes().contains(code));
        } else {
            assert_eq!(bench.supervisor.clear_faults(), Err(set(&[code])), "{code:?}");
            let refusal = bench.supervisor.arm(bench.now_us).unwrap_err();
            assert_eq!(refusal.causes, set(&[code]), "{code:?}");
            assert_eq!(refusal.to_string(), format!("not armed: {}", code.info().name));
            // Gone is gone after its delay, and not before.
            bench.spoil(code, false);
            let told =
                matches!(code, Code::StoreDamaged | Code::SelfTestFailed | Code::NotCommissioned);
            let delay_us = u64::from(code.info().clear_after_us);
            if delay_us > 0 {
                bench.run(delay_us);
                assert!(bench.supervisor.causes().contains(code), "{code:?}");
                assert_eq!(bench.supervisor.clear_faults(), Err(set(&[code])));
            }
            if !told {
                bench.step();
            }
        }
        // The cause is gone and the fault is held, until somebody asks.
        bench.spoil(code, false);
        assert!(!bench.supervisor.causes().contains(code), "{code:?}");
        bench.run(3_000 * STEP_US);
        assert_eq!(bench.supervisor.faults(), set(&[code]), "{code:?}");
        assert!(bench.supervisor.arm(bench.now_us).is_err());
        assert_eq!(bench.supervisor.clear_faults(), Ok(()));
        assert_eq!(bench.supervisor.take_event(), Some(Event { code, raised: false }));
        assert_eq!(bench.supervisor.state(), State::Safe, "cleared is not armed");
        assert_eq!(bench.supervisor.arm(bench.now_us), Ok(()), "{code:?}");
    }
    // The rest is what a last life ended with.
    let booted = [Code::WatchdogReset, Code::PanicBeforeReset];
    assert_eq!(tried + booted.len(), STOPPING.iter().count());
}

#[test]
fn every_limit_is_raised_stops_nothing_and_goes_by_itself() {
    for code in Code::ALL.iter().copied().filter(|code| !STOPPING.contains(*code)) {
        let mut bench = ready_for(code);
        let before = bench.supervisor.compensation_allowed();
        assert!(before);
        bench.spoil(code, true).expect("a limit has a cause");
        let delay_us = raise_after_us(code);
        if delay_us > 0 {
            bench.run(delay_us);
            assert!(bench.supervisor.limits().is_empty(), "{code:?}");
        }
        bench.step();
        assert_eq!(bench.supervisor.limits(), set(&[code]), "{code:?}");
        assert!(bench.events.contains(&Event { code, raised: true }));
        assert!(bench.supervisor.faults().is_empty());
        assert!(bench.supervisor.bridge_allowed(), "{code:?}");
        let drops = code.info().effect == Effect::DropsCompensation;
        assert_eq!(bench.supervisor.compensation_allowed(), !drops, "{code:?}");
        bench.run(200 * STEP_US);
        assert_eq!(bench.supervisor.count_of(code), 1, "{code:?}");

        bench.spoil(code, false);
        let delay_us = u64::from(code.info().clear_after_us);
        if delay_us > 0 {
            bench.run(delay_us);
            assert!(bench.supervisor.limits().contains(code), "{code:?}");
        }
        bench.step();
        assert!(bench.supervisor.limits().is_empty(), "{code:?}");
        assert!(bench.events.contains(&Event { code, raised: false }), "{code:?}");
        assert!(bench.supervisor.compensation_allowed() && bench.supervisor.is_armed());
    }
}

#[test]
fn what_the_last_life_ended_with_is_held_until_cleared() {
    let mut tried = CodeSet::EMPTY;
    for code in Code::ALL.iter().copied() {
        let Some(boot) = boot_with(code) else { continue };
        tried.insert(code);
        let mut bench = Bench::boot(&boot);
        bench.run(10 * STEP_US);
        assert_eq!(bench.events, [Event { code, raised: true }]);
        assert_eq!(bench.supervisor.count_of(code), 1);
        if STOPPING.contains(code) {
            assert_eq!(bench.supervisor.state(), State::Fault);
            assert_eq!(bench.supervisor.faults(), set(&[code]));
            if bench.supervisor.causes().contains(code) {
                assert_eq!(bench.supervisor.clear_faults(), Err(set(&[code])));
                bench.spoil(code, false);
            }
            assert_eq!(bench.supervisor.clear_faults(), Ok(()));
            assert_eq!(bench.supervisor.arm(bench.now_us), Ok(()));
        } else {
            assert_eq!(bench.supervisor.limits(), set(&[code]));
            assert_eq!(bench.supervisor.arm(bench.now_us), Ok(()));
        }
    }
    assert_eq!(tried.iter().count(), 8);
}

#[test]
fn the_table_is_in_order() {
    let mut numbers = HashSet::new();
    let mut names = HashSet::new();
    let mut emergencies = HashSet::new();
    for code in Code::ALL.iter().copied() {
        let info = code.info();
        assert_eq!(info.number, code.number());
        assert_eq!(Code::from_number(info.number), Some(code));
        let stops = info.effect == Effect::Stops;
        assert_eq!(info.number <= 32, stops, "{code:?}");
        assert!((1..=64).contains(&info.number));
        assert!(numbers.insert(info.number) && names.insert(info.name), "{code:?}");
        assert!(emergencies.insert(info.emergency) && info.emergency != 0, "{code:?}");
        assert_eq!(info.register & register::GENERIC, register::GENERIC);
        // CiA 301: the class of an emergency code and the bits of the register go together.
        let bit = match info.emergency >> 12 {
            2 => register::CURRENT,
            3 => register::VOLTAGE,
            4 => register::TEMPERATURE,
            _ if matches!(info.emergency >> 8, 0x81 | 0x82) => register::COMMUNICATION,
            _ => register::GENERIC,
        };
        assert_eq!(info.register & bit, bit, "{code:?}");
        assert!(info.name.chars().all(|c| c.is_ascii_lowercase() || c == '-'), "{}", info.name);
        let words = code.words();
        assert!(!words.raised_by.is_empty() && !words.cleared_by.is_empty());
        assert!(stops || info.watched == Watched::Always, "{code:?}");
    }
    assert_eq!((Code::from_number(0), Code::from_number(32)), (None, None));
    assert_eq!(numbers.len(), CODES);
    let drops = DROPS_COMPENSATION.iter().count();
    println!("{CODES} codes: {} faults, {drops} drop compensation", STOPPING.iter().count());
    assert!(CODES >= 26 && drops > 0);
}

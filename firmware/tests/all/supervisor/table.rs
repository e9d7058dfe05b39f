//! Raises and clears every code of the table by its own cause.

use super::bench::{Bench, STEP_US, boot_with};
use super::set;
use firmware::supervisor::codes::{COMPENSATION_DROPPING_CODES, FAULT_CODES, register};
use firmware::supervisor::{
    CODE_COUNT, Code, CodeSet, Effect, Event, JointState, SelfTest, Watched,
};
use std::collections::HashSet;

/// Returns the time until the code is raised. The set-point timeout runs from the last set-point.
fn raise_after_us(code: Code) -> u64 {
    let delay = u64::from(code.info().raise_after_us);
    if code == Code::CommandTimeout { delay + 100_000 } else { delay }
}

/// Returns other codes that the cause also raises: a trip level lies above the derating level, and a row of
/// overruns begins with one.
fn implied_codes(code: Code) -> CodeSet {
    match code {
        Code::BridgeOvertemperature | Code::MotorOvertemperature => set(&[Code::Derated]),
        Code::LoopOverrun => set(&[Code::LoopLate]),
        _ => CodeSet::EMPTY,
    }
}

/// Returns a bench on which the code can be raised: a current offset needs the bridge off, all others are
/// tested while armed.
fn bench_for(code: Code) -> Bench {
    let mut bench = Bench::armed();
    if code == Code::CurrentOffset {
        bench.supervisor.disarm();
    }
    bench.events.clear();
    bench
}

/// Checks that a fault with its cause is raised after its delay and not before. The delay starts with the first observation of
/// the cause; that of the set-point starts with the last set-point.
fn check_raised(bench: &mut Bench, code: Code) {
    let delay_us = raise_after_us(code);
    let first = if code == Code::CommandTimeout { 0 } else { STEP_US };
    if delay_us > 0 {
        bench.run(first + delay_us - STEP_US);
        assert!(bench.supervisor.faults().is_empty(), "{code:?}");
    }
    let armed = bench.supervisor.is_armed();
    assert_eq!(bench.supervisor.is_bridge_allowed(), armed);
    bench.step();
    let supervisor = &mut bench.supervisor;
    assert_eq!(supervisor.faults(), set(&[code]), "{code:?}");
    assert_eq!(supervisor.state(), JointState::Fault);
    assert!(!supervisor.is_bridge_allowed() && !supervisor.is_compensation_allowed());
    assert!(supervisor.limits().without(implied_codes(code)).is_empty());
    assert_eq!(supervisor.count_of(code), 1);
    assert!(bench.events.contains(&Event { code, raised: true }));
}

/// Checks that a fault refuses to be cleared and to arm until its cause counts as gone: after its delay and not before.
fn check_refused(bench: &mut Bench, code: Code) {
    assert_eq!(bench.supervisor.clear_faults(), Err(set(&[code])), "{code:?}");
    let refusal = bench.supervisor.arm(bench.now_us).unwrap_err();
    assert_eq!(refusal.causes, set(&[code]), "{code:?}");
    let test = match code {
        Code::SelfTestFailed => format!(" (test {})", SelfTest::OffsetA),
        _ => String::new(),
    };
    assert_eq!(refusal.to_string(), format!("not armed: {}{test}", code.info().name));
    bench.set_cause(code, false);
    let is_reported =
        matches!(code, Code::StoreDamaged | Code::SelfTestFailed | Code::NotCommissioned);
    let delay_us = u64::from(code.info().clear_after_us);
    if delay_us > 0 {
        bench.run(delay_us);
        assert!(bench.supervisor.causes().contains(code), "{code:?}");
        assert_eq!(bench.supervisor.clear_faults(), Err(set(&[code])));
    }
    if !is_reported {
        bench.step();
    }
}

#[test]
fn every_fault_is_raised_latched_and_cleared() {
    let mut tried = 0;
    for code in Code::ALL.iter().copied().filter(|code| FAULT_CODES.contains(*code)) {
        let mut bench = bench_for(code);
        if bench.set_cause(code, true).is_none() {
            continue;
        }
        tried += 1;
        check_raised(&mut bench, code);
        // It can neither be cleared nor armed while its cause is present. (A current that flows with the
        // bridge off is also an offset, but only after a longer delay.)
        bench.run(40 * STEP_US);
        if matches!(code, Code::PhaseLost | Code::MotorAgainst | Code::MotorStands) {
            // With the bridge off the cause cannot be observed, so it counts as gone.
            assert!(!bench.supervisor.causes().contains(code));
        } else {
            check_refused(&mut bench, code);
        }
        // The cause is gone, and the fault stays latched until it is cleared.
        bench.set_cause(code, false);
        assert!(!bench.supervisor.causes().contains(code), "{code:?}");
        bench.run(3_000 * STEP_US);
        assert_eq!(bench.supervisor.faults(), set(&[code]), "{code:?}");
        assert!(bench.supervisor.arm(bench.now_us).is_err());
        assert_eq!(bench.supervisor.clear_faults(), Ok(()));
        assert_eq!(bench.supervisor.take_event(), Some(Event { code, raised: false }));
        assert_eq!(bench.supervisor.state(), JointState::Safe, "cleared is not armed");
        assert_eq!(bench.supervisor.arm(bench.now_us), Ok(()), "{code:?}");
    }
    // The other faults come from the boot report.
    let from_boot_report = [Code::WatchdogReset, Code::PanicBeforeReset];
    assert_eq!(tried + from_boot_report.len(), FAULT_CODES.iter().count());
}

#[test]
fn every_limit_is_raised_and_clears_by_itself() {
    for code in Code::ALL.iter().copied().filter(|code| !FAULT_CODES.contains(*code)) {
        let mut bench = bench_for(code);
        let before = bench.supervisor.is_compensation_allowed();
        assert!(before);
        bench.set_cause(code, true).expect("the bench has a cause for each limit");
        let delay_us = raise_after_us(code);
        if delay_us > 0 {
            bench.run(delay_us);
            assert!(bench.supervisor.limits().is_empty(), "{code:?}");
        }
        bench.step();
        assert_eq!(bench.supervisor.limits(), set(&[code]), "{code:?}");
        assert!(bench.events.contains(&Event { code, raised: true }));
        assert!(bench.supervisor.faults().is_empty());
        assert!(bench.supervisor.is_bridge_allowed(), "{code:?}");
        let drops = code.info().effect == Effect::DropsCompensation;
        assert_eq!(bench.supervisor.is_compensation_allowed(), !drops, "{code:?}");
        bench.run(200 * STEP_US);
        assert_eq!(bench.supervisor.count_of(code), 1, "{code:?}");

        bench.set_cause(code, false);
        let delay_us = u64::from(code.info().clear_after_us);
        if delay_us > 0 {
            bench.run(delay_us);
            assert!(bench.supervisor.limits().contains(code), "{code:?}");
        }
        bench.step();
        assert!(bench.supervisor.limits().is_empty(), "{code:?}");
        assert!(bench.events.contains(&Event { code, raised: false }), "{code:?}");
        assert!(bench.supervisor.is_compensation_allowed() && bench.supervisor.is_armed());
    }
}

#[test]
fn code_of_the_boot_report_is_latched_until_cleared() {
    let mut tried = CodeSet::EMPTY;
    for code in Code::ALL.iter().copied() {
        let Some(boot) = boot_with(code) else { continue };
        tried.insert(code);
        let mut bench = Bench::boot(&boot);
        bench.run(10 * STEP_US);
        assert_eq!(bench.events, [Event { code, raised: true }]);
        assert_eq!(bench.supervisor.count_of(code), 1);
        if FAULT_CODES.contains(code) {
            assert_eq!(bench.supervisor.state(), JointState::Fault);
            assert_eq!(bench.supervisor.faults(), set(&[code]));
            if bench.supervisor.causes().contains(code) {
                assert_eq!(bench.supervisor.clear_faults(), Err(set(&[code])));
                bench.set_cause(code, false);
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
fn table_rows_are_unique_and_consistent() {
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
        // CiA 301: the class of an emergency code determines the bits of the error register.
        let bit = match info.emergency >> 12 {
            2 => register::CURRENT,
            3 => register::VOLTAGE,
            4 => register::TEMPERATURE,
            _ if matches!(info.emergency >> 8, 0x81 | 0x82) => register::COMMUNICATION,
            _ => register::GENERIC,
        };
        assert_eq!(info.register & bit, bit, "{code:?}");
        assert!(info.name.chars().all(|c| c.is_ascii_lowercase() || c == '-'), "{}", info.name);
        let words = code.description();
        assert!(!words.raised_by.is_empty() && !words.cleared_by.is_empty());
        assert!(stops || info.watched == Watched::Always, "{code:?}");
    }
    assert_eq!((Code::from_number(0), Code::from_number(65)), (None, None));
    assert_eq!(numbers.len(), CODE_COUNT);
    let drops = COMPENSATION_DROPPING_CODES.iter().count();
    println!(
        "{CODE_COUNT} codes: {} faults, {drops} drop compensation",
        FAULT_CODES.iter().count()
    );
    assert!(CODE_COUNT >= 26 && drops > 0);
}

//! Measures the whole interrupt: a real exception of the emulated processor that runs the shipped
//! `LoopTask` with its queues.
//!
//! A function of four instructions makes the timer's interrupt pending. Everything until it returns is
//! counted: the handler clears the flag of the timer as the board's handler clears that of its converter,
//! takes orders (or, in some rows, new parameters) from the queues, runs a period, and sends a report if
//! one is due and nothing was taken. The register accesses of a real board are counted in its own image (`tests/image`).
//!
//! Afterwards the timer triggers the same handler at 20 kHz while the processor computes the fingerprints
//! below it. Their bits must equal those of an undisturbed run, and no period may be missing.
#![allow(unsafe_code)] // A vector table, the handler's state, and registers of timer and interrupt controller.

#[cfg(feature = "terms")]
use super::TWO_TERMS;
use super::current_loop::{Inputs, SETTLING_CYCLES, healthy, sequence};
use super::{Arguments, Clock, address, print_line};
use compensator_core::{LawKind, TermKind};
use core::arch::global_asm;
use core::sync::atomic::{AtomicPtr, AtomicU32, Ordering};
use firmware::control::{BridgeFault, PERIOD_S, PowerStage, StageSample};
use firmware::deadline::DeadlineLimits;
use firmware::driver::{Home, LoopCommands};
use firmware::loop_link::{LoopLink, LoopPort, LoopQueues};
use firmware::loop_parts::{LoopParts, StageTraits};
use firmware::loop_task::LoopTask;
use firmware::parameter_set::ParameterSet;
#[cfg(feature = "terms")]
use firmware::reference_joint::COSTLIEST_TERMS;
use firmware::reference_joint::configuration;
use heapless::Vec;
use test_boards::fingerprint;

/// Cycles of a period on the joint driver's board, 170 MHz and 20 kHz, and cycles from trigger to handler.
const PERIOD_CYCLES: u32 = 8500;
const HANDLER_LATENCY: u32 = 200;

/// CMSDK timer 0 of mps2-an386: base address, interrupt line, and ticks per period.
const TIMER: usize = 0x4000_0000;
const TIMER_LINE: usize = 8;
const TIMER_TICKS: u32 = 25_000_000 / 20_000;
/// Periods in which the observer settles, the gate driver wakes and the shunt offsets are measured.
const WAKE_PERIODS: usize = 2000;
/// Periods measured from the start, with three reports; the same number as in `tests/image`.
const START_PERIODS: u32 = 60;
/// Maximum number of fingerprint runs.
const MAX_FINGERPRINTS: usize = 16;
const PERIOD_US: u32 = 50;
/// Microsecond counter of the FPGA, and its divider.
const COUNTER: usize = 0x4002_8018;
const DIVIDER: usize = 0x4002_801C;
/// Registers for the vector table, and to set an interrupt pending and enabled.
const VTOR: usize = 0xE000_ED08;
const SET_PENDING: usize = 0xE000_E200;
const SET_ENABLED: usize = 0xE000_E100;
/// Processor exceptions before the first interrupt line.
const EXCEPTIONS: usize = 16;
const VECTORS: usize = 64;

#[repr(align(1024))]
struct Table([usize; VECTORS]);

/// A power stage in memory.
struct MemoryStage {
    sample: StageSample,
    duty: [f32; 3],
    driven: bool,
    now: u32,
}

impl PowerStage for MemoryStage {
    #[inline(always)]
    fn sample(&mut self) -> StageSample {
        self.sample
    }

    #[inline(always)]
    fn bridge_fault(&mut self) -> Option<BridgeFault> {
        None
    }

    #[inline(always)]
    fn set_awake(&mut self, _awake: bool) {}

    #[inline(always)]
    fn drive(&mut self, duty: [f32; 3]) {
        (self.duty, self.driven) = (duty, true);
    }

    #[inline(always)]
    fn off(&mut self) {
        self.driven = false;
    }

    #[inline(always)]
    fn cycles(&self) -> u32 {
        self.now + HANDLER_LATENCY
    }
}

/// State of the handler.
struct Interrupt {
    task: LoopTask,
    stage: MemoryStage,
    port: LoopPort<'static>,
}

static INTERRUPT: AtomicPtr<Interrupt> = AtomicPtr::new(core::ptr::null_mut());
static INTERRUPT_COUNT: AtomicU32 = AtomicU32::new(0);

extern "C" fn handler() {
    write(TIMER + 0xC, 1);
    // SAFETY: set before the line is enabled, and no other code accesses it while the line is unmasked.
    let Some(state) = (unsafe { INTERRUPT.load(Ordering::Relaxed).as_mut() }) else { return };
    let triggered = state.stage.now;
    state.task.interrupt(&mut state.stage, &mut state.port, triggered, triggered + HANDLER_LATENCY);
}

/// Handles the timer interrupt: it also advances the cycle counter that the board reads.
extern "C" fn periodic() {
    INTERRUPT_COUNT.fetch_add(1, Ordering::Relaxed);
    // SAFETY: see above; the timer is stopped before other code accesses it.
    if let Some(state) = unsafe { INTERRUPT.load(Ordering::Relaxed).as_mut() } {
        state.stage.now = state.stage.now.wrapping_add(PERIOD_CYCLES);
    }
    handler();
}

global_asm!(
    ".thumb_func",
    "pend_timer:",
    "str r1, [r0]",
    "dsb",
    "isb",
    "bx lr",
    ".thumb_func",
    "handler_of_1: bx lr",
    ".thumb_func",
    "handler_of_30: .rept 29",
    "nop",
    ".endr",
    "bx lr",
);

unsafe extern "C" {
    fn pend_timer();
    fn handler_of_1();
    fn handler_of_30();
}

fn write(register: usize, value: u32) {
    // SAFETY: registers of this machine, which only this module uses.
    unsafe { (register as *mut u32).write_volatile(value) }
}

fn read(register: usize) -> u32 {
    // SAFETY: see above; reading has no side effect.
    unsafe { (register as *const u32).read_volatile() }
}

/// The active vector table, a copy in RAM.
struct VectorTable(&'static mut Table);

impl VectorTable {
    fn take() -> Self {
        let Some(table) = cortex_m::singleton!(: Table = Table([0; VECTORS])) else {
            panic!("the vector table is taken once")
        };
        let flash = read(VTOR) as usize;
        for (number, vector) in table.0.iter_mut().enumerate() {
            *vector = read(flash + 4 * number) as usize;
        }
        write(VTOR, address(table) as u32);
        write(SET_ENABLED, 1 << TIMER_LINE);
        Self(table)
    }

    fn bind(&mut self, function: *const ()) {
        let vector = &raw mut self.0.0[EXCEPTIONS + TIMER_LINE];
        // SAFETY: an entry of the table, which the processor also reads.
        unsafe { vector.write_volatile(function as usize | 1) };
        cortex_m::asm::dsb();
    }
}

/// Counts handlers; checks itself with two of known length.
struct Counter<'c> {
    clock: &'c mut Clock,
    overhead: u32,
}

impl<'c> Counter<'c> {
    fn start(clock: &'c mut Clock, vectors: &mut VectorTable) -> Self {
        let mut counter = Self { clock, overhead: 0 };
        vectors.bind(handler_of_1 as *const ());
        counter.overhead = counter.count(|| ()) - 1;
        vectors.bind(handler_of_30 as *const ());
        let counted = counter.count(|| ());
        assert!(counted == 30, "a handler of 30 instructions counts {counted}");
        vectors.bind(handler as *const ());
        counter
    }

    /// Returns the instructions of one interrupt, from the first of the handler to its return.
    fn count(&mut self, mut prepare: impl FnMut()) -> u32 {
        let pending = Arguments { words: [SET_PENDING, 1 << TIMER_LINE, 0], float: 0.0 };
        let counted = self.clock.count(pend_timer as *const (), || {
            prepare();
            pending
        });
        counted - self.overhead
    }
}

fn set(law: LawKind, terms: &[TermKind]) -> ParameterSet {
    ParameterSet { friction: configuration(law, terms), ..ParameterSet::default() }
}

fn commands(inputs: &Inputs) -> LoopCommands {
    LoopCommands {
        setpoint: inputs.setpoint,
        covariates: inputs.covariates,
        bridge: true,
        brake: false,
        compensation: true,
        current_share: 1.0,
        compensation_share: 1.0,
        factors: None,
        gate_resets: 0,
        set_number: 0,
        home: Home { position_rad: 0.3, number: 1 },
        probe: None,
        scope: firmware::scope::ScopeOrder::OFF,
    }
}

/// The events that coincide in a period.
#[derive(Clone, Copy)]
struct Situation {
    commands: bool,
    /// The first half of the commands was taken in the period before.
    second_half: bool,
    parts: bool,
    /// A report is due.
    report: bool,
    /// Periods since the values of a report were recorded, which are not counted.
    report_steps: u8,
}

const QUIET: Situation =
    Situation { commands: false, second_half: false, parts: false, report: false, report_steps: 0 };
const OTHER_PARAMETERS: Situation =
    Situation { commands: true, parts: true, report: true, ..QUIET };
/// Commands take two periods, and a report three.
const PERIODS: [Situation; 6] = [
    QUIET,
    Situation { commands: true, report: true, ..QUIET },
    Situation { commands: true, second_half: true, report: true, ..QUIET },
    Situation { report: true, ..QUIET },
    Situation { report: true, report_steps: 1, ..QUIET },
    Situation { report: true, report_steps: 2, ..QUIET },
];

/// The loop in the interrupt, and the background's end of its queues.
struct Joint {
    state: &'static mut Option<Interrupt>,
    link: LoopLink<'static>,
    set: ParameterSet,
    set_number: u32,
    now_us: u64,
    /// Trigger time of the last period of a settled loop, cycles. The next one must be exactly one period
    /// later.
    settled: u32,
}

impl Joint {
    /// Loads another model and runs until the loop has settled and drives.
    fn settle(&mut self, set: ParameterSet) -> Option<LoopTask> {
        let parts = LoopParts::build(&set, StageTraits::NONE, PERIOD_S).ok()?;
        self.set = set;
        let mut task = LoopTask::new(parts, DeadlineLimits::for_period(PERIOD_CYCLES, 10));
        let Some(state) = self.state.as_mut() else { panic!("there is a loop") };
        let still = healthy(0.0);
        // The shunt offsets are measured before the bridge closes, without current.
        let open = StageSample { currents_a: [0.0; 3], ..still.sample };
        state.stage.driven = false;
        let mut driving = 0;
        for period in 0..2 * WAKE_PERIODS + SETTLING_CYCLES {
            state.stage.sample = if state.stage.driven { still.sample } else { open };
            driving += usize::from(state.stage.driven);
            state.stage.now = state.stage.now.wrapping_add(PERIOD_CYCLES);
            let triggered = state.stage.now;
            // The observer's output before it has settled would trip the bridge.
            task.apply_commands(LoopCommands {
                bridge: period >= WAKE_PERIODS,
                ..commands(&still)
            });
            task.interrupt(
                &mut state.stage,
                &mut state.port,
                triggered,
                triggered + HANDLER_LATENCY,
            );
            self.now_us += 50;
            self.link.reports(self.now_us, |_| ());
        }
        assert!(driving >= SETTLING_CYCLES, "the loop drives in {driving} periods only");
        self.settled = state.stage.now;
        Some(task)
    }

    /// Prepares a period from this state, with the events of the situation.
    fn prepare(&mut self, before: &LoopTask, inputs: &Inputs, situation: Situation) {
        if situation.parts || situation.commands {
            // The last counted period left commands.
            self.drain();
        }
        // Empty the report queue, so that the handler finds room.
        self.link.reports(self.now_us, |_| ());
        self.set_number += u32::from(situation.parts);
        let mut commands_sent = commands(inputs);
        commands_sent.set_number = self.set_number;
        if situation.commands {
            self.link.send_commands(commands_sent, &self.set);
        }
        let Some(state) = self.state.as_mut() else { panic!("there is a loop") };
        state.task.clone_from(before);
        state.stage.sample = inputs.sample;
        state.stage.now = self.settled.wrapping_add(PERIOD_CYCLES);
        if !situation.commands {
            state.task.apply_commands(commands_sent);
        }
        // A report is due in the measured period, or was just sent.
        if !situation.report {
            state.task.clear_report();
        }
        for _ in 0..situation.report_steps + u8::from(situation.second_half) {
            let triggered = state.stage.now;
            state.task.interrupt(
                &mut state.stage,
                &mut state.port,
                triggered,
                triggered + HANDLER_LATENCY,
            );
            state.stage.now = triggered.wrapping_add(PERIOD_CYCLES);
        }
        INTERRUPT.store(state, Ordering::Relaxed);
    }

    /// Empties the queue of commands by running periods that are not counted.
    fn drain(&mut self) {
        let Some(state) = self.state.as_mut() else { panic!("there is a loop") };
        for _ in 0..3 {
            state.task.interrupt(&mut state.stage, &mut state.port, 0, 0);
        }
    }

    /// Prepares a period from this state, without orders.
    fn prepare_start(&mut self, before: &LoopTask, sample: StageSample) {
        self.link.reports(self.now_us, |_| ());
        let Some(state) = self.state.as_mut() else { panic!("there is a loop") };
        state.task.clone_from(before);
        state.stage.sample = sample;
        state.stage.now = self.settled;
        INTERRUPT.store(state, Ordering::Relaxed);
    }
}

/// Returns the smallest and the largest count over the sequence. Each sample starts from a settled loop
/// that drives, because a trip would keep the bridge off.
fn measure(
    counter: &mut Counter<'_>,
    joint: &mut Joint,
    task: &LoopTask,
    situations: &[Situation],
) -> (u32, u32) {
    let (mut min, mut max) = (u32::MAX, 0);
    for inputs in sequence() {
        for situation in situations {
            let count = counter.count(|| joint.prepare(task, &inputs, *situation));
            min = min.min(count);
            max = max.max(count);
        }
    }
    (min, max)
}

/// Measures from the start, without orders. `tests/image` measures the same with registers.
fn measure_start(counter: &mut Counter<'_>, joint: &mut Joint) {
    let Ok(parts) = LoopParts::build(&joint.set, StageTraits::NONE, PERIOD_S) else {
        panic!("the plain law is legal")
    };
    let mut task = LoopTask::new(parts, DeadlineLimits::for_period(PERIOD_CYCLES, 10));
    let still = healthy(0.0);
    let sample = StageSample { currents_a: [0.0; 3], ..still.sample };
    let (mut min, mut max) = (u32::MAX, 0);
    for _ in 0..START_PERIODS {
        joint.settled = joint.settled.wrapping_add(PERIOD_CYCLES);
        let count = counter.count(|| joint.prepare_start(&task, sample));
        (min, max) = (min.min(count), max.max(count));
        if let Some(state) = joint.state.as_ref() {
            task.clone_from(&state.task);
        }
    }
    print_line!("interrupt | plain LuGre, nothing ordered | {min} | {max}");
}

/// Measures all rows of the table, then runs the handler from the timer.
pub fn measure_interrupts(clock: &mut Clock) {
    let Some(queues) = cortex_m::singleton!(: LoopQueues = LoopQueues::new()) else {
        panic!("the queues are taken once")
    };
    let Some(state) = cortex_m::singleton!(: Option<Interrupt> = None) else {
        panic!("the loop is taken once")
    };
    let (port, link) = queues.split(StageTraits::NONE, 0);
    let plain = set(LawKind::Lugre, &[]);
    let Ok(parts) = LoopParts::build(&plain, StageTraits::NONE, PERIOD_S) else {
        panic!("the plain law is legal")
    };
    let task = LoopTask::new(parts, DeadlineLimits::for_period(PERIOD_CYCLES, 10));
    let stage = MemoryStage { sample: healthy(0.0).sample, duty: [0.0; 3], driven: false, now: 0 };
    *state = Some(Interrupt { task, stage, port });
    let mut joint = Joint { state, link, set: plain, set_number: 0, now_us: 0, settled: 0 };
    let mut vectors = VectorTable::take();
    let mut counter = Counter::start(clock, &mut vectors);

    measure_start(&mut counter, &mut joint);
    let rows: &[(&str, LawKind, &[TermKind])] = &[
        ("plain LuGre", LawKind::Lugre, &[]),
        ("improved LuGre", LawKind::ImprovedLugre, &[]),
        #[cfg(feature = "terms")]
        ("improved LuGre + temperature + ripple", LawKind::ImprovedLugre, TWO_TERMS),
        #[cfg(feature = "terms")]
        (
            "improved LuGre + the three dearest",
            LawKind::ImprovedLugre,
            COSTLIEST_TERMS.split_at(3).0,
        ),
        #[cfg(feature = "terms")]
        ("improved LuGre + the eight dearest", LawKind::ImprovedLugre, &COSTLIEST_TERMS),
    ];
    for (name, law, terms) in rows {
        let Some(task) = joint.settle(set(*law, terms)) else { panic!("{name}: no such model") };
        let (min, max) = measure(&mut counter, &mut joint, &task, &PERIODS);
        print_line!("interrupt | {name} | {min} | {max}");
        let (min, max) = measure(&mut counter, &mut joint, &task, &[OTHER_PARAMETERS]);
        joint.drain();
        print_line!("interrupt | {name}, other parameters come | {min} | {max}");
    }
    #[cfg(feature = "terms")]
    for term in TermKind::ALL {
        // Terms that the law already contains are refused.
        if let Some(task) = joint.settle(set(LawKind::ImprovedLugre, &[*term])) {
            let (min, max) = measure(&mut counter, &mut joint, &task, &PERIODS);
            print_line!("interrupt | improved LuGre + {} | {min} | {max}", term.name());
        }
    }
    preempt(&mut vectors, &mut joint);
}

/// Computes the fingerprints while the interrupt of the loop preempts them.
fn preempt(vectors: &mut VectorTable, joint: &mut Joint) {
    let Some(task) = joint.settle(set(LawKind::ImprovedLugre, &[])) else {
        panic!("the improved law is legal")
    };
    let still = healthy(0.0);
    joint.prepare(&task, &still, QUIET);
    // The first period from the timer is the one after this.
    if let Some(state) = joint.state.as_mut() {
        state.stage.now = joint.settled;
    }
    write(DIVIDER, 24);
    vectors.bind(periodic as *const ());
    let undisturbed: Vec<u32, MAX_FINGERPRINTS> =
        fingerprint::all().map(|(_, bits)| bits).collect();
    write(TIMER + 4, TIMER_TICKS - 1);
    write(TIMER + 8, TIMER_TICKS - 1);
    let began = read(COUNTER);
    write(TIMER, 0b1001);
    let disturbed: Vec<u32, MAX_FINGERPRINTS> = fingerprint::all().map(|(_, bits)| bits).collect();
    write(TIMER, 0);
    let periods = read(COUNTER).wrapping_sub(began) / PERIOD_US;
    let interrupts = INTERRUPT_COUNT.load(Ordering::Relaxed);
    let mut late = 0;
    joint.link.reports(joint.now_us, |report| late = late.max(report.overruns_in_a_row));
    assert!(late == 0, "the loop saw {late} late periods in a row");
    let same = undisturbed.iter().zip(&disturbed).filter(|(one, other)| one == other).count();
    print_line!("preempted | {} | {same} | {interrupts} | {periods}", undisturbed.len());
}

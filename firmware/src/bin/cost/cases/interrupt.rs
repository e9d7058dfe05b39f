//! The whole interrupt: a real exception of the emulated processor, in it the shipped `LoopTask` with its queues.
//!
//! A function of four instructions makes the timer's interrupt pending, and all that runs until it returns is
//! counted: the handler clears the timer's flag as the board's clears its converter's, takes orders (and, where a
//! row says so, other parameters) from their queues, does a period, and hands over a report where one is due. What
//! a board's registers add to it is counted in the board's own image (`tests/image`).
//!
//! Afterwards the same handler runs off the timer, 20 kHz, while the processor computes the fingerprints below it:
//! the bits have to be those of an undisturbed run, and no period may be missing.
#![allow(unsafe_code)] // A vector table, the handler's state, and registers of timer and interrupt controller.

#[cfg(feature = "terms")]
use super::TWO_TERMS;
use super::current_loop::{Inputs, SETTLE, healthy, sequence};
use super::{Arguments, Clock, address, print_line};
use compensator_core::{LawKind, TermKind};
use core::arch::global_asm;
use core::sync::atomic::{AtomicPtr, AtomicU32, Ordering};
use firmware::control::{Broke, PERIOD_S, PowerStage, StageSample};
use firmware::deadline::Limits;
use firmware::driver::{Home, LoopOrders};
use firmware::fingerprint;
use firmware::loop_link::{LoopLink, LoopPort, LoopQueues};
use firmware::loop_parts::{Parts, StageTraits};
use firmware::loop_task::LoopTask;
use firmware::parameter_set::ParameterSet;
use firmware::reference_joint::configuration;
use heapless::Vec;

/// Cycles of a period on the joint driver's board, 170 MHz and 20 kHz, and those from trigger to start and to end.
const PERIOD: u32 = 8500;
const STARTS: u32 = 200;

/// CMSDK timer 0 of mps2-an386: control, reload, interrupt; its line, and the whole machine's clock.
const TIMER: usize = 0x4000_0000;
const TIMER_LINE: usize = 8;
const TIMER_TICKS: u32 = 25_000_000 / 20_000;
/// Periods in which the observer settles, and in which a gate driver wakes and the shunts' zeros are found.
const WAKES: usize = 2000;
/// Periods from the start, in which three reports are due. As many in `tests/image`.
const START_PERIODS: u32 = 60;
/// Runs of the fingerprints, at most.
const RUNS: usize = 16;
const PERIOD_US: u32 = 50;
/// Microseconds of the FPGA's counter behind its divider.
const COUNTER: usize = 0x4002_8018;
const DIVIDER: usize = 0x4002_801C;
/// Vector table, and where an interrupt is made pending and enabled.
const VTOR: usize = 0xE000_ED08;
const SET_PENDING: usize = 0xE000_E200;
const SET_ENABLED: usize = 0xE000_E100;
/// Exceptions of the processor before the first interrupt line.
const EXCEPTIONS: usize = 16;
const VECTORS: usize = 64;

#[repr(align(1024))]
struct Table([usize; VECTORS]);

/// A power stage whose registers are memory.
struct Memory {
    sample: StageSample,
    duty: [f32; 3],
    driven: bool,
    now: u32,
}

impl PowerStage for Memory {
    #[inline(always)]
    fn sample(&mut self) -> StageSample {
        self.sample
    }

    #[inline(always)]
    fn broke(&mut self) -> Option<Broke> {
        None
    }

    #[inline(always)]
    fn wake(&mut self, _awake: bool) {}

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
        self.now + STARTS
    }
}

/// As many terms as a model takes: those that are dearest one by one, in this order.
#[cfg(feature = "terms")]
const DEAREST: &[TermKind] = &[
    TermKind::TorqueRipple,
    TermKind::DwellTimeStatic,
    TermKind::TimeDrift,
    TermKind::PositionRipple,
    TermKind::LookupTable,
    TermKind::GravityImbalance,
    TermKind::WarmUp,
    TermKind::Backlash,
];

/// What the handler works on.
struct Interrupt {
    task: LoopTask,
    stage: Memory,
    port: LoopPort<'static>,
}

static INTERRUPT: AtomicPtr<Interrupt> = AtomicPtr::new(core::ptr::null_mut());
static TAKEN: AtomicU32 = AtomicU32::new(0);

extern "C" fn handler() {
    write(TIMER + 0xC, 1);
    // SAFETY: set before the line is enabled, and nobody else looks while it is not masked.
    let Some(own) = (unsafe { INTERRUPT.load(Ordering::Relaxed).as_mut() }) else { return };
    let triggered = own.stage.now;
    own.task.interrupt(&mut own.stage, &mut own.port, triggered, triggered + STARTS);
}

/// The same off the timer: what the board reads from its cycle counter is counted here.
extern "C" fn periodic() {
    TAKEN.fetch_add(1, Ordering::Relaxed);
    // SAFETY: as above; the timer is stopped before anybody else looks.
    if let Some(own) = unsafe { INTERRUPT.load(Ordering::Relaxed).as_mut() } {
        own.stage.now = own.stage.now.wrapping_add(PERIOD);
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
    // SAFETY: registers of this machine; this module alone uses them.
    unsafe { (register as *mut u32).write_volatile(value) }
}

fn read(register: usize) -> u32 {
    // SAFETY: as above; reading changes nothing.
    unsafe { (register as *const u32).read_volatile() }
}

/// The vector table in use, a copy in RAM.
struct Lines(&'static mut Table);

impl Lines {
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
        // SAFETY: an entry of the table; the processor reads it behind the compiler's back.
        unsafe { vector.write_volatile(function as usize | 1) };
        cortex_m::asm::dsb();
    }
}

/// Counts handlers; checks itself on two of known length.
struct Counter<'c> {
    clock: &'c mut Clock,
    overhead: u32,
}

impl<'c> Counter<'c> {
    fn start(clock: &'c mut Clock, lines: &mut Lines) -> Self {
        let mut counter = Self { clock, overhead: 0 };
        lines.bind(handler_of_1 as *const ());
        counter.overhead = counter.count(|| ()) - 1;
        lines.bind(handler_of_30 as *const ());
        let counted = counter.count(|| ());
        assert!(counted == 30, "a handler of 30 instructions counts {counted}");
        lines.bind(handler as *const ());
        counter
    }

    /// Instructions of one interrupt, of the handler's first to its return.
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

fn orders(inputs: &Inputs) -> LoopOrders {
    LoopOrders {
        setpoint: inputs.setpoint,
        covariates: inputs.covariates,
        bridge: true,
        compensation: true,
        current_share: 1.0,
        compensation_share: 1.0,
        factors: None,
        gate_resets: 0,
        set_number: 0,
        home: Home { position_rad: 0.3, number: 1 },
        probe: None,
    }
}

/// What comes together in a period.
#[derive(Clone, Copy)]
struct Situation {
    orders: bool,
    parts: bool,
    report: bool,
}

const QUIET: Situation = Situation { orders: false, parts: false, report: false };
const BUSY: Situation = Situation { orders: true, parts: false, report: true };
const OTHER_PARAMETERS: Situation = Situation { orders: true, parts: true, report: true };

/// The loop in the interrupt, and the background's end of its queues.
struct Joint {
    own: &'static mut Option<Interrupt>,
    link: LoopLink<'static>,
    set: ParameterSet,
    set_number: u32,
    now_us: u64,
    /// Trigger of the last period of a settled loop, cycles: the next is a period later, or it would be late.
    settled: u32,
}

impl Joint {
    /// Gives it another model, settled and driving.
    fn settle(&mut self, set: ParameterSet) -> Option<LoopTask> {
        let parts = Parts::build(&set, StageTraits::NONE, PERIOD_S).ok()?;
        self.set = set;
        let mut task = LoopTask::new(parts, Limits::of_period(PERIOD, 10));
        let Some(own) = self.own.as_mut() else { panic!("there is a loop") };
        let still = healthy(0.0);
        // Before the bridge closes the shunts' zeros are found: no current flows.
        let open = StageSample { currents_a: [0.0; 3], ..still.sample };
        own.stage.driven = false;
        let mut driving = 0;
        for period in 0..2 * WAKES + SETTLE {
            own.stage.sample = if own.stage.driven { still.sample } else { open };
            driving += usize::from(own.stage.driven);
            own.stage.now = own.stage.now.wrapping_add(PERIOD);
            let triggered = own.stage.now;
            // What the observer says before it has settled would trip the bridge.
            task.order(LoopOrders { bridge: period >= WAKES, ..orders(&still) });
            task.interrupt(&mut own.stage, &mut own.port, triggered, triggered + STARTS);
            self.now_us += 50;
            self.link.reports(self.now_us, |_| ());
        }
        assert!(driving >= SETTLE, "the loop drives in {driving} periods only");
        self.settled = own.stage.now;
        Some(task)
    }

    /// A period from this state, everything that is to come with it on its way.
    fn prepare(&mut self, before: &LoopTask, inputs: &Inputs, situation: Situation) {
        // A handler that did not empty its queues would leave no room.
        self.link.reports(self.now_us, |_| ());
        self.set_number += u32::from(situation.parts);
        let mut told = orders(inputs);
        told.set_number = self.set_number;
        if situation.orders {
            self.link.order(told, &self.set);
        }
        let Some(own) = self.own.as_mut() else { panic!("there is a loop") };
        own.task.clone_from(before);
        own.stage.sample = inputs.sample;
        own.stage.now = self.settled.wrapping_add(PERIOD);
        if !situation.orders {
            own.task.order(told);
        }
        // A report is due with the period that is counted, or was just given.
        if !situation.report {
            own.task.reported();
        }
        INTERRUPT.store(own, Ordering::Relaxed);
    }

    /// A period from this state, without orders.
    fn prepare_start(&mut self, before: &LoopTask, sample: StageSample) {
        self.link.reports(self.now_us, |_| ());
        let Some(own) = self.own.as_mut() else { panic!("there is a loop") };
        own.task.clone_from(before);
        own.stage.sample = sample;
        own.stage.now = self.settled;
        INTERRUPT.store(own, Ordering::Relaxed);
    }
}

/// Least and largest count over every sample of the sequence, from settled loops. A trip holds the bridge off, so
/// every sample meets a loop that drives.
fn measure(
    counter: &mut Counter<'_>,
    joint: &mut Joint,
    task: &LoopTask,
    situations: &[Situation],
) -> (u32, u32) {
    let (mut least, mut most) = (u32::MAX, 0);
    for inputs in sequence() {
        for situation in situations {
            let count = counter.count(|| joint.prepare(task, &inputs, *situation));
            least = least.min(count);
            most = most.max(count);
        }
    }
    (least, most)
}

/// From the start, nothing ordered: what the board's image does as well (`tests/image`), which has registers besides.
fn measure_start(counter: &mut Counter<'_>, joint: &mut Joint) {
    let Ok(parts) = Parts::build(&joint.set, StageTraits::NONE, PERIOD_S) else {
        panic!("the plain law is legal")
    };
    let mut task = LoopTask::new(parts, Limits::of_period(PERIOD, 10));
    let still = healthy(0.0);
    let sample = StageSample { currents_a: [0.0; 3], ..still.sample };
    let (mut least, mut most) = (u32::MAX, 0);
    for _ in 0..START_PERIODS {
        joint.settled = joint.settled.wrapping_add(PERIOD);
        let count = counter.count(|| joint.prepare_start(&task, sample));
        (least, most) = (least.min(count), most.max(count));
        if let Some(own) = joint.own.as_ref() {
            task.clone_from(&own.task);
        }
    }
    print_line!("interrupt | plain LuGre, nothing ordered | {least} | {most}");
}

/// The rows of the table, and the run off the timer.
pub fn measure_interrupts(clock: &mut Clock) {
    let Some(queues) = cortex_m::singleton!(: LoopQueues = LoopQueues::new()) else {
        panic!("the queues are taken once")
    };
    let Some(own) = cortex_m::singleton!(: Option<Interrupt> = None) else {
        panic!("the loop is taken once")
    };
    let (port, link) = queues.split(StageTraits::NONE, 0);
    let plain = set(LawKind::Lugre, &[]);
    let Ok(parts) = Parts::build(&plain, StageTraits::NONE, PERIOD_S) else {
        panic!("the plain law is legal")
    };
    let task = LoopTask::new(parts, Limits::of_period(PERIOD, 10));
    let stage = Memory { sample: healthy(0.0).sample, duty: [0.0; 3], driven: false, now: 0 };
    *own = Some(Interrupt { task, stage, port });
    let mut joint = Joint { own, link, set: plain, set_number: 0, now_us: 0, settled: 0 };
    let mut lines = Lines::take();
    let mut counter = Counter::start(clock, &mut lines);

    measure_start(&mut counter, &mut joint);
    let rows: &[(&str, LawKind, &[TermKind])] = &[
        ("plain LuGre", LawKind::Lugre, &[]),
        ("improved LuGre", LawKind::ImprovedLugre, &[]),
        #[cfg(feature = "terms")]
        ("improved LuGre + temperature + ripple", LawKind::ImprovedLugre, TWO_TERMS),
        #[cfg(feature = "terms")]
        ("improved LuGre + the three dearest", LawKind::ImprovedLugre, DEAREST.split_at(3).0),
        #[cfg(feature = "terms")]
        ("improved LuGre + the eight dearest", LawKind::ImprovedLugre, DEAREST),
    ];
    for (name, law, terms) in rows {
        let Some(task) = joint.settle(set(*law, terms)) else { panic!("{name}: no such model") };
        let (least, most) = measure(&mut counter, &mut joint, &task, &[QUIET, BUSY]);
        print_line!("interrupt | {name} | {least} | {most}");
        let (least, most) = measure(&mut counter, &mut joint, &task, &[OTHER_PARAMETERS]);
        print_line!("interrupt | {name}, other parameters come | {least} | {most}");
    }
    #[cfg(feature = "terms")]
    for term in TermKind::ALL {
        // Those that the law has itself are refused beside it.
        if let Some(task) = joint.settle(set(LawKind::ImprovedLugre, &[*term])) {
            let (least, most) = measure(&mut counter, &mut joint, &task, &[QUIET, BUSY]);
            print_line!("interrupt | improved LuGre + {} | {least} | {most}", term.name());
        }
    }
    preempt(&mut lines, &mut joint);
}

/// Fingerprints with the loop's interrupt above them.
fn preempt(lines: &mut Lines, joint: &mut Joint) {
    let Some(task) = joint.settle(set(LawKind::ImprovedLugre, &[])) else {
        panic!("the improved law is legal")
    };
    let still = healthy(0.0);
    joint.prepare(&task, &still, QUIET);
    // The first period off the timer is the one after this.
    if let Some(own) = joint.own.as_mut() {
        own.stage.now = joint.settled;
    }
    write(DIVIDER, 24);
    lines.bind(periodic as *const ());
    let undisturbed: Vec<u32, RUNS> = fingerprint::all().map(|(_, bits)| bits).collect();
    write(TIMER + 4, TIMER_TICKS - 1);
    write(TIMER + 8, TIMER_TICKS - 1);
    let began = read(COUNTER);
    write(TIMER, 0b1001);
    let disturbed: Vec<u32, RUNS> = fingerprint::all().map(|(_, bits)| bits).collect();
    write(TIMER, 0);
    let periods = read(COUNTER).wrapping_sub(began) / PERIOD_US;
    let taken = TAKEN.load(Ordering::Relaxed);
    let mut late = 0;
    joint.link.reports(joint.now_us, |report| late = late.max(report.overruns_in_a_row));
    assert!(late == 0, "the loop saw {late} late periods in a row");
    let same = undisturbed.iter().zip(&disturbed).filter(|(one, other)| one == other).count();
    print_line!("preempted | {} | {same} | {taken} | {periods}", undisturbed.len());
}

//! A second chip family, STM32F4: a minimal board that shows what every board needs.
//!
//! It runs in QEMU's netduinoplus2 (an STM32F405; core, timers and serial line equal those of the
//! STM32F446). The current loop runs in the SysTick interrupt at the highest priority, the driver below it.
//! Every Cortex-M has this timer, and the emulator has no PWM timer that triggers samples. *Missing* is
//! what a real board adds: clock tree, currents and encoder, gate driver, a CAN controller (frames use
//! slcan text over USART1), non-volatile flash, a watchdog. This driver therefore answers and accepts
//! parameters but never arms. See docs/src/how-to/porting.md.
//!
//! ```text
//! priority   interrupt   does
//! 0x10       SysTick     the current loop, 20 kHz: LoopTask on the stage
//! 0x80       USART1      received bytes -> queue
//!  idle      -           the library's background loop
//! ```
#![allow(unsafe_code)] // Unmasks interrupts and passes them their state.

mod registers;
mod scales;
mod stage;

use compensator_core::can::Frame;
use core::cell::UnsafeCell;
use cortex_m::peripheral::NVIC;
use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::syst::SystClkSource;
use firmware::background::{Background, Board, BoardState, RoundOutcome};
use firmware::driver::{Boot, Driver, Identity};
use firmware::loop_link::{LoopLink, LoopPort, LoopQueues};
use firmware::loop_parts::{LoopParts, StageTraits};
use firmware::loop_task::LoopTask;
use firmware::node_settings::NodeSettings;
use firmware::panic_note::Part;
use firmware::store::memory::MemoryFlash;
use firmware::supervisor::ResetCause;
use firmware::{panic, stack_guard};
use heapless::spsc::{Consumer, Producer, Queue};
use registers::{Line, TIM5, USART1, read, timer, write};
use stage::{Stage, open_bridge};
use test_boards::serial_bus::{SerialBus, SerialLine};

/// Capacity of the receive queue, bytes. The background is away for a millisecond at most: 12 bytes at
/// 115,200 baud.
const RECEIVE_QUEUE_BYTES: usize = 256;
/// Number of flash pages: two slots of one page each, in RAM. A real board stores them in flash.
const PAGES: usize = 2;

/// State owned by an interrupt: set before it is unmasked, then accessed only by it.
struct Owned<T>(UnsafeCell<Option<T>>);

// SAFETY: `give` is called before the interrupt is unmasked, `with` only by that interrupt, which cannot
// preempt itself.
unsafe impl<T> Sync for Owned<T> {}

impl<T> Owned<T> {
    const fn empty() -> Self {
        Self(UnsafeCell::new(None))
    }

    /// # Safety
    /// The interrupt must be masked.
    unsafe fn give(&self, value: T) {
        // SAFETY: no other code accesses it.
        unsafe { *self.0.get() = Some(value) }
    }

    /// # Safety
    /// Only the interrupt that owns the state may call it.
    unsafe fn with(&self, act: impl FnOnce(&mut T)) {
        // SAFETY: no other code accesses it.
        if let Some(value) = unsafe { &mut *self.0.get() } {
            act(value);
        }
    }
}

static LOOP: Owned<(LoopTask, Stage, LoopPort<'static>)> = Owned::empty();
static SERIAL: Owned<Producer<'static, u8>> = Owned::empty();

/// Opens the bridge, stores the text and resets the processor. The bridge comes first, because storing
/// takes time and may itself fail.
fn stop(what: &[Part]) -> ! {
    open_bridge();
    panic::record_and_reset(what)
}

/// Handles a hard fault like a panic.
///
/// # Safety
/// Only the processor calls it; it never returns.
#[cortex_m_rt::exception]
unsafe fn HardFault(frame: &cortex_m_rt::ExceptionFrame) -> ! {
    open_bridge();
    if stack_guard::record_overflow() {
        cortex_m::peripheral::SCB::sys_reset();
    }
    stop(&[Part::Text("hard fault at "), Part::Hexadecimal(frame.pc())])
}

#[panic_handler]
fn handle_panic(info: &core::panic::PanicInfo) -> ! {
    open_bridge();
    panic::record_place_and_reset(info.location())
}

/// Handles all peripheral interrupts; only that of the serial line is unmasked.
///
/// # Safety
/// Only the processor calls it.
#[cortex_m_rt::exception]
unsafe fn DefaultHandler(number: i16) {
    if number == Line::Serial as i16 {
        // SAFETY: this is the owning interrupt.
        unsafe { SERIAL.with(receive) }
    } else {
        stop(&[Part::Text("unexpected interrupt "), Part::Decimal(number as u32)])
    }
}

/// Runs one period of the current loop. It also wakes the background.
///
/// # Safety
/// Only the processor calls it.
#[cortex_m_rt::exception]
unsafe fn SysTick() {
    let now = read(TIM5 + timer::COUNTER);
    // A real board uses the time since the trigger from its PWM timer. SysTick would show the emulator's
    // interrupt latency (up to 20 us), which is not time that the driver uses.
    let triggered = now;
    // SAFETY: this is the owning interrupt.
    unsafe { LOOP.with(|(task, stage, port)| task.interrupt(stage, port, triggered, now)) }
}

const SERIAL_STATUS: usize = USART1;
const SERIAL_DATA: usize = USART1 + 0x04;
const SERIAL_DIVIDER: usize = USART1 + 0x08;
const SERIAL_CONTROL: usize = USART1 + 0x0C;
const RECEIVER_FULL: u32 = 1 << 5;
const TRANSMITTER_EMPTY: u32 = 1 << 7;

fn receive(bytes: &mut Producer<'static, u8>) {
    while read(SERIAL_STATUS) & RECEIVER_FULL != 0 {
        // If the queue is full, the sender did not wait for answers. The truncated frame is then rejected.
        let _ = bytes.enqueue(read(SERIAL_DATA) as u8);
    }
}

/// The background's side of USART1.
struct Serial {
    received: Consumer<'static, u8>,
}

impl Serial {
    fn start(received: Consumer<'static, u8>) -> Self {
        const ON: u32 = 1 << 13 | 1 << 5 | 1 << 3 | 1 << 2;
        /// 115,200 baud from 84 MHz.
        const DIVIDER: u32 = 84_000_000 / 115_200;
        write(SERIAL_DIVIDER, DIVIDER);
        write(SERIAL_CONTROL, ON);
        Self { received }
    }
}

impl SerialLine for Serial {
    fn receive(&mut self) -> Option<u8> {
        self.received.dequeue()
    }

    fn send(&mut self, byte: u8) -> bool {
        let free = read(SERIAL_STATUS) & TRANSMITTER_EMPTY != 0;
        if free {
            write(SERIAL_DATA, u32::from(byte));
        }
        free
    }
}

/// State of the background. It is static, because on the stack of `main` each move would leave a copy.
type BackgroundState = (Option<Background<Driver<Flash>>>, Option<SkeletonBoard>);

/// A reference, so that the flash is not moved with the driver.
type Flash = &'static mut MemoryFlash<PAGES>;

#[cortex_m_rt::entry]
fn main() -> ! {
    // `entry` turns these into references, each handed out once.
    static mut RECEIVE_QUEUE: Queue<u8, RECEIVE_QUEUE_BYTES> = Queue::new();
    static mut LOOP_QUEUES: LoopQueues = LoopQueues::new();
    static mut FLASH: MemoryFlash<PAGES> = MemoryFlash::new();
    static mut BACKGROUND_STATE: BackgroundState = (None, None);

    let stack_overflowed = stack_guard::take_overflow();
    stack_guard::paint();
    let (background, board) =
        start(BACKGROUND_STATE, FLASH, RECEIVE_QUEUE, LOOP_QUEUES, stack_overflowed);
    loop {
        let outcome = background.round(board);
        if outcome == RoundOutcome::Restart {
            cortex_m::peripheral::SCB::sys_reset();
        }
        board.bus.send_waiting();
        if outcome == RoundOutcome::Sleep {
            cortex_m::asm::wfi();
        }
    }
}

/// Starts clocks, driver and interrupts.
#[inline(never)]
fn start<'state>(
    state: &'state mut BackgroundState,
    flash: Flash,
    bytes: &'static mut Queue<u8, RECEIVE_QUEUE_BYTES>,
    queues: &'static mut LoopQueues,
    stack_overflowed: bool,
) -> (&'state mut Background<Driver<Flash>>, &'state mut SkeletonBoard) {
    let panicked = panic::take();
    let Some(mut core) = cortex_m::Peripherals::take() else {
        unreachable!("the entry point runs once");
    };
    registers::start_clocks();
    open_bridge();
    write(TIM5 + timer::RELOAD, u32::MAX);
    write(TIM5 + timer::CONTROL, timer::ENABLE);
    let mut clock = Clock { last: read(TIM5 + timer::COUNTER), rest: 0, now_us: 0 };

    let now_us = clock.now_us();
    let identity = Identity { hardware: "STM32F405 skeleton", serial: 0, stage: StageTraits::NONE };
    let boot = Boot {
        cause: ResetCause::Unknown,
        panic: panicked.as_deref(),
        stack_overflowed,
        // There is nothing to test on this board.
        self_test_passed: true,
        // It keeps none.
        winding_rise_k: None,
        home: None,
        program: None,
    };
    let (background, board) = state;
    let background = background.insert(driver(flash, identity, &boot, now_us));
    let task = LoopTask::new(
        LoopParts::build_or_measure_only(background.driver().set(), StageTraits::NONE),
        scales::LIMITS,
    );
    let (bytes_out, bytes_in) = bytes.split();
    let (port, link) = queues.split(StageTraits::NONE, now_us);
    let bus = SerialBus::new(Serial::start(bytes_in));
    // SAFETY: the serial interrupt is masked and SysTick is stopped until the end of this block. Each owns
    // its state afterwards.
    unsafe {
        LOOP.give((task, Stage, port));
        SERIAL.give(bytes_out);
        core.SCB.set_priority(SystemHandler::SysTick, 0x10);
        core.NVIC.set_priority(Line::Serial, 0x80);
        NVIC::unmask(Line::Serial);
    }
    let board = board.insert(SkeletonBoard { bus, clock, link });
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(scales::CORE_HZ / scales::LOOP_HZ - 1);
    core.SYST.clear_current();
    core.SYST.enable_counter();
    core.SYST.enable_interrupt();
    (background, board)
}

/// Creates the driver and its background. It is a separate function, so that the stack of its large
/// temporaries is freed.
#[inline(never)]
fn driver(
    flash: Flash,
    identity: Identity,
    boot: &Boot<'_>,
    now_us: u64,
) -> Background<Driver<Flash>> {
    Background::new(Driver::boot(NodeSettings::default(), flash, identity, boot, now_us), now_us)
}

/// Time from TIM5, which wraps every 4.3 s and is read in every period.
struct Clock {
    last: u32,
    rest: u32,
    now_us: u64,
}

impl Clock {
    fn now_us(&mut self) -> u64 {
        const PER_US: u32 = scales::TIMER_HZ / 1_000_000;
        let now = read(TIM5 + timer::COUNTER);
        let passed = now.wrapping_sub(self.last).saturating_add(self.rest);
        self.last = now;
        self.rest = passed % PER_US;
        self.now_us += u64::from(passed / PER_US);
        self.now_us
    }
}

struct SkeletonBoard {
    bus: SerialBus<Serial>,
    clock: Clock,
    link: LoopLink<'static>,
}

impl Board for SkeletonBoard {
    const RESTART_FLUSH_US: u64 = 100_000;

    fn now_us(&mut self) -> u64 {
        self.clock.now_us()
    }

    fn receive(&mut self) -> Option<Frame> {
        self.bus.receive()
    }

    fn has_room_for(&mut self, _identifier: u16) -> bool {
        self.bus.has_room()
    }

    fn send(&mut self, frame: &Frame) {
        self.bus.publish(frame);
    }

    fn is_idle(&mut self) -> bool {
        self.bus.is_idle()
    }

    fn state(&mut self, _now_us: u64) -> BoardState {
        BoardState { stack_intact: stack_guard::is_intact(), ..BoardState::default() }
    }

    fn current_loop(&mut self) -> Option<&mut LoopLink<'static>> {
        Some(&mut self.link)
    }
}

//! A second chip family, STM32F4, and the skeleton of a board: what any has to have, and no more.
//!
//! It runs in QEMU's netduinoplus2 (an STM32F405; core, timers and serial line are the STM32F446's). The loop runs in
//! SysTick's interrupt above all else, the driver below it: that timer every Cortex-M has, and the emulator has no PWM
//! timer that samples. What is *not* here is what a board brings: clock tree,
//! currents and encoder, gate driver, a CAN controller (frames come as slcan text over USART1), flash that outlives the
//! power, a watchdog. So this driver answers, takes parameters, and never arms. See docs/porting.md.
//!
//! ```text
//! priority   interrupt   does
//! 0x10       SysTick     the current loop, 20 kHz: LoopTask on the stage
//! 0x80       USART1      received bytes -> queue
//!  idle      -           the library's background loop
//! ```
#![allow(unsafe_code)] // Interrupts are unmasked, and what is theirs is handed to them.

mod registers;
mod scales;
mod stage;

pub use stage::open_bridge;

use super::serial_bus::{SerialBus, SerialLine};
use compensator_core::can::Frame;
use core::cell::UnsafeCell;
use cortex_m::peripheral::NVIC;
use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::syst::SystClkSource;
use firmware::background::{Background, Board, BoardState, Next};
use firmware::driver::{Boot, Driver, Identity};
use firmware::loop_link::{LoopLink, LoopPort, LoopQueues};
use firmware::loop_parts::{Parts, StageTraits};
use firmware::loop_task::LoopTask;
use firmware::node_settings::NodeSettings;
use firmware::store::memory::MemoryFlash;
use firmware::supervisor::ResetCause;
use firmware::{panic, stack_guard};
use heapless::spsc::{Consumer, Producer, Queue};
use registers::{Line, TIM5, USART1, read, timer, write};
use stage::Stage;

/// Bytes that wait for the background, which is away for a millisecond at most: 12 at 115,200 baud.
const BYTES: usize = 256;
/// Two slots of a page each. Forgotten with the power: a board keeps them in flash.
const PAGES: usize = 2;

/// What an interrupt owns: put there before it is unmasked, and reached by it alone.
struct Owned<T>(UnsafeCell<Option<T>>);

// SAFETY: `give` is called before the interrupt is unmasked, `with` by that interrupt alone, which does not interrupt
// itself.
unsafe impl<T> Sync for Owned<T> {}

impl<T> Owned<T> {
    const fn nothing() -> Self {
        Self(UnsafeCell::new(None))
    }

    /// # Safety
    /// The interrupt is masked.
    unsafe fn give(&self, value: T) {
        // SAFETY: nobody else reaches it.
        unsafe { *self.0.get() = Some(value) }
    }

    /// # Safety
    /// Called by the interrupt that owns it.
    unsafe fn with(&self, act: impl FnOnce(&mut T)) {
        // SAFETY: nobody else reaches it.
        if let Some(value) = unsafe { &mut *self.0.get() } {
            act(value);
        }
    }
}

static LOOP: Owned<(LoopTask, Stage, LoopPort<'static>)> = Owned::nothing();
static SERIAL: Owned<Producer<'static, u8>> = Owned::nothing();

/// Every interrupt of a peripheral: only the serial line's is unmasked.
///
/// # Safety
/// Called by the processor alone.
#[cortex_m_rt::exception]
unsafe fn DefaultHandler(number: i16) {
    if number == Line::Serial as i16 {
        // SAFETY: this is its interrupt.
        unsafe { SERIAL.with(receive) }
    } else {
        super::stop(&format_args!("interrupt {number} is nobody's"))
    }
}

/// One period of the current loop. It wakes the background as well.
///
/// # Safety
/// Called by the processor alone.
#[cortex_m_rt::exception]
unsafe fn SysTick() {
    let now = read(TIM5 + timer::COUNTER);
    // A board takes what its PWM timer says has passed since the trigger. What SysTick says here is the emulator's way to
    // deliver interrupts (up to 20 us late, measured), and no time of the driver's.
    let triggered = now;
    // SAFETY: this is its interrupt.
    unsafe { LOOP.with(|(task, stage, port)| task.interrupt(stage, port, triggered, now)) }
}

const SERIAL_STATUS: usize = USART1;
const SERIAL_DATA: usize = USART1 + 0x04;
const SERIAL_DIVIDER: usize = USART1 + 0x08;
const SERIAL_CONTROL: usize = USART1 + 0x0C;
const RECEIVED: u32 = 1 << 5;
const MAY_SEND: u32 = 1 << 7;

fn receive(bytes: &mut Producer<'static, u8>) {
    while read(SERIAL_STATUS) & RECEIVED != 0 {
        // Where there is no room the sender did not wait for answers; the frame is refused by its missing end.
        let _ = bytes.enqueue(read(SERIAL_DATA) as u8);
    }
}

/// USART1 on the background's side.
struct Serial {
    received: Consumer<'static, u8>,
}

impl Serial {
    fn start(received: Consumer<'static, u8>) -> Self {
        const ON: u32 = 1 << 13 | 1 << 5 | 1 << 3 | 1 << 2;
        /// 115,200 baud of 84 MHz.
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
        let free = read(SERIAL_STATUS) & MAY_SEND != 0;
        if free {
            write(SERIAL_DATA, u32::from(byte));
        }
        free
    }
}

/// What the background has, in a static: on the stack of `main` it would be as often as it was moved on its way there, and
/// those frames stay.
type Life = (Option<Background<Flash>>, Option<SkeletonBoard>);

/// By reference: it would be moved with the driver.
type Flash = &'static mut MemoryFlash<PAGES>;

#[cortex_m_rt::entry]
fn main() -> ! {
    // Each is handed out once: `entry` makes references of them.
    static mut BYTES_QUEUE: Queue<u8, BYTES> = Queue::new();
    static mut LOOP_QUEUES: LoopQueues = LoopQueues::new();
    static mut FLASH: MemoryFlash<PAGES> = MemoryFlash::new();
    static mut LIFE: Life = (None, None);

    let stack_overflowed = stack_guard::take_overflow();
    stack_guard::paint();
    let (background, board) = start(LIFE, FLASH, BYTES_QUEUE, LOOP_QUEUES, stack_overflowed);
    loop {
        if background.round(board) == Next::Restart {
            cortex_m::peripheral::SCB::sys_reset();
        }
        board.bus.send_waiting();
        cortex_m::asm::wfi();
    }
}

/// Starts clocks, driver, interrupts.
#[inline(never)]
fn start<'life>(
    life: &'life mut Life,
    flash: Flash,
    bytes: &'static mut Queue<u8, BYTES>,
    queues: &'static mut LoopQueues,
    stack_overflowed: bool,
) -> (&'life mut Background<Flash>, &'life mut SkeletonBoard) {
    let panicked = panic::take();
    let Some(mut core) = cortex_m::Peripherals::take() else {
        unreachable!("a program is entered once");
    };
    registers::start_clocks();
    open_bridge();
    write(TIM5 + timer::RELOAD, u32::MAX);
    write(TIM5 + timer::CONTROL, timer::ENABLE);
    let mut clock = Clock { last: read(TIM5 + timer::COUNTER), rest: 0, now_us: 0 };

    let now_us = clock.now_us();
    let identity = Identity { hardware: "STM32F405 skeleton", serial: 0 };
    let boot = Boot {
        cause: ResetCause::Unknown,
        panic: panicked.as_deref(),
        stack_overflowed,
        // Nothing to test is on board.
        self_test_passed: true,
    };
    let (background, board) = life;
    let background = background.insert(driver(flash, identity, &boot, now_us));
    let task =
        LoopTask::new(Parts::first(background.driver().set(), StageTraits::NONE), scales::LIMITS);
    let (bytes_out, bytes_in) = bytes.split();
    let (port, link) = queues.split(StageTraits::NONE, now_us);
    let bus = SerialBus::new(Serial::start(bytes_in));
    // SAFETY: the one is masked and the other stands still until the end of this block, and theirs from then on.
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

/// The driver in its loop. By itself, for it is large and is moved several times while it is made: stack that is free again.
#[inline(never)]
fn driver(flash: Flash, identity: Identity, boot: &Boot<'_>, now_us: u64) -> Background<Flash> {
    Background::new(Driver::boot(NodeSettings::default(), flash, identity, boot, now_us), now_us)
}

/// Time from TIM5, which wraps every 4.3 s: looked at in every period.
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
    const FAREWELL_US: u64 = 100_000;

    fn now_us(&mut self) -> u64 {
        self.clock.now_us()
    }

    fn receive(&mut self) -> Option<Frame> {
        self.bus.receive()
    }

    fn has_room(&mut self) -> bool {
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

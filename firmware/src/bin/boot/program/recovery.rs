//! The loop of the node in recovery: frames by polling, and a clock from the cycle counter.

use super::banks::PROGRAM;
use super::flash::ChipFlash;
use super::{can, clocks, pins, watchdog};
use compensator_core::can::Frame;
use cortex_m::peripheral::DWT;
use firmware::update::recovery::{Recovery, identity, stored_settings};
use heapless::Deque;

const CYCLES_PER_US: u32 = super::scales::CAN_HZ / 1_000_000;
const TICK_US: u64 = 1000;
/// Frames that arrive while one is processed, such as during an erase.
const QUEUE_FRAMES: usize = 64;
/// Longest wait for the last answer before a restart, us.
const FLUSH_US: u64 = 20_000;

/// Time since the start of the loop, us. It must be read at least every 25 s.
struct Clock {
    last: u32,
    us: u64,
}

impl Clock {
    fn now_us(&mut self) -> u64 {
        let passed = DWT::cycle_count().wrapping_sub(self.last) / CYCLES_PER_US;
        self.last = self.last.wrapping_add(passed * CYCLES_PER_US);
        self.us += u64::from(passed);
        self.us
    }
}

/// Answers on the bus until a restart is requested.
pub fn run(mut flash: ChipFlash) -> ! {
    let settings = stored_settings(&mut flash, &PROGRAM);
    let wired = pins::wiring(embassy_stm32::init(clocks::clocks(pins::CRYSTAL)));
    cortex_m::interrupt::disable();
    // SAFETY: embassy does not use these two.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    let mut clock = Clock { last: DWT::cycle_count(), us: 0 };
    let mut controller = can::Controller::start(
        wired.can,
        settings.node,
        settings.bit_rate_kbit,
        settings.data_bit_rate_kbit,
    );
    let mut node =
        Recovery::boot(settings.node, flash, PROGRAM, identity(clocks::serial()), clock.now_us());
    let mut frames = Deque::<Frame, QUEUE_FRAMES>::new();
    let mut due_us = 0;
    loop {
        // A frame that does not fit is lost, and its sender repeats it.
        can::receive(|frame| _ = frames.push_back(frame));
        let now_us = clock.now_us();
        if let Some(frame) = frames.pop_front() {
            node.receive(&frame, now_us);
        }
        if now_us >= due_us {
            due_us = now_us + TICK_US;
            watchdog::refresh();
            controller.state();
            node.tick(now_us);
        }
        send(&mut controller, &mut node);
        if node.is_reset_requested() {
            let until_us = clock.now_us() + FLUSH_US;
            while !controller.is_idle() && clock.now_us() < until_us {
                send(&mut controller, &mut node);
            }
            cortex_m::peripheral::SCB::sys_reset();
        }
    }
}

fn send(controller: &mut can::Controller, node: &mut Recovery<ChipFlash>) {
    while let Some(frame) = node.transmit_if(|identifier| controller.has_room_for(identifier)) {
        controller.send(&frame);
    }
}

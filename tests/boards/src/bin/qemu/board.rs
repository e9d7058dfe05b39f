//! The emulated board: QEMU's mps2-an386, a Cortex-M4F.
//!
//! It runs the same [`Driver`] as on the joint, but without a joint: CAN frames provide its inputs. CAN
//! uses slcan text over the UART, so the board acts as its own adapter, and any program for a USB adapter
//! can use it:
//!
//! ```text
//! qemu-system-arm -M mps2-an386 -display none -monitor none -echr 256
//!     -chardev socket,id=can,path=can.sock,server=on,wait=off,mux=on -serial chardev:can
//!     -semihosting-config enable=on,target=native,arg=joint,arg=flash=flash.bin -kernel qemu-board | defmt-print -e qemu-board
//! host-sim params status --bus slcan:can.sock
//! ```
//!
//! `flash.bin` holds the parameters; without that argument they only survive a reset. Logs are defmt frames
//! on the standard output. There is no bridge, hence no current loop. Interrupts stay masked and only wake
//! the core. `mux` adds a queue of 32 bytes before the one-byte UART, which halves the cost of a byte; 256
//! is an escape byte that does not exist.

mod clock;
mod flash;
mod kept;
mod uart;

use clock::Clock;
use compensator_core::can::Frame;
use core::ffi::CStr;
use defmt_semihosting as _;
use firmware::background::{Background, Board, BoardState, RoundOutcome};
use firmware::driver::{Boot, Driver, Identity};
use firmware::loop_parts::StageTraits;
use firmware::node_settings::{InputSource, NodeSettings};
use firmware::panic_note::Part;
use firmware::supervisor::ResetCause;
use firmware::{panic, stack_guard};
use flash::{BoardFlash, OpenError};
use heapless::Vec;
use kept::Kept;
use semihosting::experimental::env;
use test_boards::serial_bus::{SerialBus, SerialLine};
use uart::Uart;

/// Maximum length of the command line, bytes.
const MAX_COMMAND_LINE_BYTES: usize = 1024;

defmt::timestamp!("{=u64:us}", u64::from(clock::stamp_us()));

/// Handles a hard fault: the next start reports its text. There is no bridge to open.
///
/// # Safety
/// Only the processor calls it; it never returns.
#[allow(unsafe_code)]
#[cortex_m_rt::exception]
unsafe fn HardFault(frame: &cortex_m_rt::ExceptionFrame) -> ! {
    if stack_guard::record_overflow() {
        cortex_m::peripheral::SCB::sys_reset();
    }
    panic::record_and_reset(&[Part::Text("hard fault at "), Part::Hexadecimal(frame.pc())])
}

#[panic_handler]
fn handle_panic(info: &core::panic::PanicInfo) -> ! {
    panic::record_place_and_reset(info.location())
}

#[cortex_m_rt::entry]
fn main() -> ! {
    cortex_m::interrupt::disable();
    let stack_overflowed = stack_guard::take_overflow();
    stack_guard::paint();
    let panic = panic::take();
    let (Some(core), Some(kept)) = (cortex_m::Peripherals::take(), Kept::take()) else {
        unreachable!("the entry point runs once");
    };
    let warm = kept.is_warm();
    let mut clock = Clock::start(core.SYST);
    let flash = open_flash(kept);
    let settings = NodeSettings { source: InputSource::Bus, ..NodeSettings::default() };
    let identity = Identity { hardware: "QEMU mps2-an386", serial: 0, stage: StageTraits::NONE };
    let cause = if warm { ResetCause::Software } else { ResetCause::PowerOn };
    let panic = panic.as_deref();
    defmt::info!("started, {=str}", if warm { "after a reset" } else { "switched on" });
    // QEMU would not run with faulty memory or registers, so the self-test always passes.
    let boot = Boot { cause, panic, stack_overflowed, ..Boot::default() };
    let now_us = clock.now_us();
    let driver = Driver::boot(settings, flash, identity, &boot, now_us);
    let bus = SerialBus::new(Uart::start());
    run(Background::new(driver, now_us), EmulatedBoard { bus, clock })
}

/// Opens the flash that the command line selects.
fn open_flash(kept: Kept) -> BoardFlash {
    let mut path = Vec::<u8, MAX_COMMAND_LINE_BYTES>::new();
    if let Ok(arguments) = env::args::<MAX_COMMAND_LINE_BYTES>() {
        for argument in &arguments {
            if let Some(file) = argument.ok().and_then(|word| word.strip_prefix("flash=")) {
                path.clear();
                let _ = path.extend_from_slice(file.as_bytes());
                let _ = path.push(0);
            }
        }
    }
    let Ok(path) = CStr::from_bytes_with_nul(&path) else { return BoardFlash::kept(kept) };
    match BoardFlash::in_file(path) {
        Ok(flash) => flash,
        Err(error) => {
            match error {
                OpenError::Host => {
                    defmt::error!("flash: the file can be neither opened nor created")
                }
                OpenError::Length(found) => defmt::error!(
                    "flash: {=u64} bytes, expected {=usize}: not the flash of a driver",
                    found,
                    kept::LENGTH
                ),
            }
            semihosting::process::exit(1)
        }
    }
}

impl SerialLine for Uart {
    fn receive(&mut self) -> Option<u8> {
        Uart::receive(self)
    }

    fn send(&mut self, byte: u8) -> bool {
        Uart::send(self, byte)
    }
}

struct EmulatedBoard {
    bus: SerialBus<Uart>,
    clock: Clock,
}

fn run(mut background: Background<Driver<BoardFlash>>, mut board: EmulatedBoard) -> ! {
    loop {
        board.bus.line.clear();
        let outcome = background.round(&mut board);
        if outcome == RoundOutcome::Restart {
            // The emulator keeps files open across a reset, so close the file first.
            drop(background.into_flash());
            cortex_m::peripheral::SCB::sys_reset()
        }
        let sent = board.bus.is_idle();
        board.bus.line.wake_when_sent(!sent);
        if !sent {
            // The UART may have become free before its interrupt was enabled.
            board.bus.send_waiting();
        }
        if outcome == RoundOutcome::Sleep {
            board.clock.sleep();
        }
    }
}

impl Board for EmulatedBoard {
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
        BoardState {
            stack_intact: stack_guard::is_intact(),
            receiver_overrun: self.bus.line.overrun(),
            ..BoardState::default()
        }
    }
}

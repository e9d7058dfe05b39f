//! The boot program: it starts the newest good image, or answers on the bus if there is none.
//!
//! It is the first 20 KB of each bank, which no update writes: the part in the second bank is the check of a signature and
//! the node in recovery. It runs on the internal oscillator, under the watchdog, with which it hands over: an image that hangs
//! at its start is reset, too. The decision is [`firmware::update::boot`], the node in recovery
//! [`firmware::update::recovery`]; here are only registers. embassy is initialised in recovery only: it would leave
//! peripherals and interrupts behind that an image does not expect.

#![allow(unsafe_code)] // Start of an image, embassy's bindings, and one exception handler.

#[path = "../../boards/stm32g474/banks.rs"]
mod banks;
#[path = "../../boards/stm32g4/can.rs"]
#[allow(dead_code)] // Lost frames are not counted.
mod can;
#[path = "../../boards/stm32g4/clocks.rs"]
mod clocks;
#[path = "../../boards/stm32g4/flash.rs"]
mod flash;
#[path = "../../boards/stm32g474/pins.rs"]
#[allow(dead_code)] // The bridge and the sensors are not used.
mod pins;
mod recovery;
mod start;
mod watchdog;

/// What the modules of the board use of its values.
mod scales {
    pub use super::clocks::CORE_HZ as CAN_HZ;
}

use banks::{BOARD, FLASH_BASE, PROGRAM, SLOTS};
use cortex_m::peripheral::DCB;
use embassy_stm32::{pac, peripherals};
use embedded_storage::nor_flash::ReadNorFlash;
use firmware::supervisor::ResetCause;
use firmware::update::boot::{LastRun, Requirement, Selection, select};
use firmware::update::package::HEADER_BYTES;
use flash::ChipFlash;

/// Public key whose updates are accepted, at the place of `boot.x`.
// SAFETY: the linker script has a region of this length for this section alone.
#[unsafe(link_section = ".update_key")]
#[used]
static UPDATE_KEY: [u8; 32] = include!(concat!(env!("OUT_DIR"), "/update_key.rs"));

/// RAM in which a stack can begin.
const RAM: core::ops::RangeInclusive<u32> = 0x2000_0000..=0x2002_0000;

#[cortex_m_rt::entry]
fn main() -> ! {
    watchdog::start(watchdog::CHOICE);
    let flags = pac::RCC.csr().read();
    // The image reads the same flags and clears them.
    let by_watchdog = flags.iwdgrstf() || flags.wwdgrstf();
    let reset = if by_watchdog {
        ResetCause::Watchdog
    } else if flags.sftrstf() {
        ResetCause::Software
    } else {
        ResetCause::Unknown
    };
    let last_run = LastRun::of(reset, DCB::is_debugger_attached());
    // SAFETY: nothing else uses the flash controller yet; recovery does not use it through embassy's peripherals.
    let mut flash = ChipFlash::new(unsafe { peripherals::FLASH::steal() });
    let requirement = Requirement { board: BOARD, public_key: UPDATE_KEY };
    match select(&mut flash, &SLOTS, &requirement, last_run, is_plausible) {
        Selection::Start { slot, .. } => match SLOTS.get(slot) {
            Some(slot) => start::image(PROGRAM.image_address(slot)),
            None => recovery::run(flash),
        },
        Selection::Recover => recovery::run(flash),
    }
}

/// Returns true if the image begins with a stack in RAM and a reset handler in its slot.
fn is_plausible(flash: &mut ChipFlash, slot: usize) -> bool {
    let Some(place) = SLOTS.get(slot) else { return false };
    let mut vectors = [0; 8];
    if flash.read(place.start + HEADER_BYTES as u32, &mut vectors).is_err() {
        return false;
    }
    let [a, b, c, d, e, f, g, h] = vectors;
    let (stack, reset) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
    let code = PROGRAM.image_address(place)..FLASH_BASE + place.marks;
    RAM.contains(&stack) && code.contains(&reset)
}

/// Handles an error of the check bits: a torn double word, which a read returns as an error.
///
/// # Safety
/// Only the processor calls it.
#[cortex_m_rt::exception]
unsafe fn NonMaskableInt() {
    if !flash::ecc_error() {
        cortex_m::peripheral::SCB::sys_reset();
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}

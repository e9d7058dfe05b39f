//! Bytes that a reset leaves alone: the flash, where no file keeps it, and whether this start is one after a reset.
//!
//! They lie in `.uninit`, which start-up neither clears nor fills. A machine that is switched on has zeros
//! there, so a mark tells the two apart.
#![allow(unsafe_code)] // A static that start-up does not make.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};
use firmware::store::memory::PAGE;

/// Pages of the flash: two slots of two pages each.
pub const PAGES: usize = 4;

/// Bytes of the flash.
pub const LENGTH: usize = PAGES * PAGE;

/// "kept", "over": unlike anything memory holds by itself.
const MARK: [u32; 2] = [0x6B65_7074, 0x6F76_6572];

#[repr(C)]
struct Area {
    mark: [u32; 2],
    bytes: [u8; LENGTH],
}

struct Place(UnsafeCell<MaybeUninit<Area>>);

// SAFETY: `Kept` is the only way to it, and `TAKEN` lets there be one.
unsafe impl Sync for Place {}

#[unsafe(link_section = ".uninit.qemu.kept")]
static PLACE: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));
static TAKEN: AtomicBool = AtomicBool::new(false);

/// What was kept.
pub struct Kept {
    area: &'static mut Area,
    warm: bool,
}

impl Kept {
    /// Takes it; `None` if it was taken before.
    pub fn take() -> Option<Self> {
        if TAKEN.swap(true, Ordering::Relaxed) {
            return None;
        }
        // SAFETY: nobody else has it, and RAM holds some value, which is a legal `Area` whatever its bits.
        // The volatile read keeps the compiler from knowing that nothing was ever written there.
        unsafe {
            let place = PLACE.0.get().cast::<Area>();
            let mark = (&raw const (*place).mark).read_volatile();
            let warm = mark == MARK;
            if !warm {
                place.write_bytes(0xFF, 1);
                (&raw mut (*place).mark).write_volatile(MARK);
            }
            Some(Self { area: &mut *place, warm })
        }
    }

    /// Whether this start followed a reset, and not power.
    pub const fn is_warm(&self) -> bool {
        self.warm
    }

    /// The bytes kept.
    pub const fn bytes(&self) -> &[u8; LENGTH] {
        &self.area.bytes
    }

    /// The bytes kept, to change.
    pub const fn bytes_mut(&mut self) -> &mut [u8; LENGTH] {
        &mut self.area.bytes
    }
}

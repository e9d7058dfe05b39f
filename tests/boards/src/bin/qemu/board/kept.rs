//! RAM that survives a reset: the flash if no file holds it, and whether this start follows a reset.
//!
//! It is in `.uninit`, which start-up code neither clears nor initialises. After power-up that memory holds
//! zeros, so a marker distinguishes the two cases.
#![allow(unsafe_code)] // Accesses a static that start-up code does not initialise.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};
use firmware::store::memory::PAGE_BYTES;

/// Number of pages: two slots of two pages each.
pub const PAGES: usize = 4;

/// Length of the flash, bytes.
pub const LENGTH: usize = PAGES * PAGE_BYTES;

/// Marker of valid content ("kept", "over").
const MARK: [u32; 2] = [0x6B65_7074, 0x6F76_6572];

#[repr(C)]
struct Area {
    mark: [u32; 2],
    bytes: [u8; LENGTH],
}

struct AreaCell(UnsafeCell<MaybeUninit<Area>>);

// SAFETY: only `Kept` accesses it, and `TAKEN` allows one `Kept`.
unsafe impl Sync for AreaCell {}

#[unsafe(link_section = ".uninit.qemu.kept")]
static AREA: AreaCell = AreaCell(UnsafeCell::new(MaybeUninit::uninit()));
static TAKEN: AtomicBool = AtomicBool::new(false);

/// The memory that survives a reset.
pub struct Kept {
    area: &'static mut Area,
    warm: bool,
}

impl Kept {
    /// Takes the memory; `None` if it is already taken.
    pub fn take() -> Option<Self> {
        if TAKEN.swap(true, Ordering::Relaxed) {
            return None;
        }
        // SAFETY: no other reference exists, and any bit pattern is a valid `Area`. The volatile read
        // prevents the compiler from assuming that the memory was never written.
        unsafe {
            let place = AREA.0.get().cast::<Area>();
            let mark = (&raw const (*place).mark).read_volatile();
            let warm = mark == MARK;
            if !warm {
                place.write_bytes(0xFF, 1);
                (&raw mut (*place).mark).write_volatile(MARK);
            }
            Some(Self { area: &mut *place, warm })
        }
    }

    /// Returns true if this start follows a reset, not power-up.
    pub const fn is_warm(&self) -> bool {
        self.warm
    }

    /// Returns the bytes.
    pub const fn bytes(&self) -> &[u8; LENGTH] {
        &self.area.bytes
    }

    /// Returns the bytes for writing.
    pub const fn bytes_mut(&mut self) -> &mut [u8; LENGTH] {
        &mut self.area.bytes
    }
}

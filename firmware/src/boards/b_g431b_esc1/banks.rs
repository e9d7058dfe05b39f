//! Layout of the flash: the image, and the store of the parameters in the last pages. See `memory.x`.
//!
//! The chip has one bank. The processor waits while a page is erased (25 ms), and so does the interrupt of the current loop.
//! The parameters are therefore saved only while the bridge is off.

/// Area that the firmware uses as its flash: two pages, a slot of the store each.
pub const AREA_OFFSET: u32 = 0x1_F000;
pub const AREA_BYTES: usize = 0x1000;

/// Returns true: no option byte changes the layout.
pub const fn is_usable() -> bool {
    true
}

/// Returns true: the area has no part that must not be written.
pub const fn is_writable(_offset: u32) -> bool {
    true
}

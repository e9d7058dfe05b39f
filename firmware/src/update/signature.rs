//! Who signed a package: Ed25519 (RFC 8032) over the signed bytes of its header, which contain the hash of the image.
//!
//! Only the boot program checks it, once, before the first start of an image. It is the one part that no update replaces,
//! and its check does not rely on the image that received the package. `ed25519-dalek` verifies. The strict variant refuses
//! keys and signatures of small order, which would be valid for many messages.

use super::Slot;
use super::marks::ImageState;
use super::package::{HEADER_BYTES, Header};
use super::receiver::read_chunks;
use ed25519_dalek::{Signature, VerifyingKey};
use embedded_storage::nor_flash::NorFlash;
use sha2::{Digest, Sha512};

/// Returns true if the holder of the private key signed this header.
pub fn is_signed(header: &Header, public_key: &[u8; 32]) -> bool {
    let signature = Signature::from_bytes(&header.signature);
    VerifyingKey::from_bytes(public_key)
        .is_ok_and(|key| key.verify_strict(&header.signed(), &signature).is_ok())
}

/// Returns true if the image in a slot is what the holder of the private key signed.
pub fn is_authentic<F: NorFlash>(
    flash: &mut F,
    slot: &Slot,
    image: &ImageState,
    public_key: &[u8; 32],
) -> bool {
    let header = &image.header;
    let mut hash = Sha512::new();
    let part = slot.start + HEADER_BYTES as u32..slot.start + header.package_bytes();
    read_chunks(flash, part, |chunk| hash.update(chunk))
        && hash.finalize().as_slice() == header.hash
        && is_signed(header, public_key)
}

//! Who signed a package: Ed25519 (RFC 8032) over the signed bytes of its header, which contain the hash of the image.
//!
//! Only the boot program checks it, once, before the first start of an image. It is the one part that no update replaces,
//! and its check does not rely on the image that received the package. `ed25519-dalek` verifies. The strict variant refuses
//! keys and signatures of small order, which would be valid for many messages.

use super::Slot;
use super::flash::read_chunks;
use super::marks::ImageState;
use super::package::{HASH_AT, HEADER_BYTES, Header, SIGNED_BYTES, USED_BYTES};
use ed25519_dalek::{Signature, VerifyingKey};
use embedded_storage::nor_flash::NorFlash;
use sha2::{Digest, Sha512};

/// Returns true if the image in a slot is what the holder of the private key signed.
pub fn is_authentic<F: NorFlash>(
    flash: &mut F,
    slot: &Slot,
    image: &ImageState,
    public_key: &[u8; 32],
) -> bool {
    let mut bytes = [0; USED_BYTES];
    if flash.read(slot.start, &mut bytes).is_err() || Header::parse(&bytes) != Ok(image.header) {
        return false;
    }
    let Some((signed, signature)) = bytes.split_first_chunk::<SIGNED_BYTES>() else { return false };
    let Ok(signature) = Signature::from_slice(signature) else { return false };
    let mut hash = Sha512::new();
    let part = slot.start + HEADER_BYTES as u32..slot.start + image.header.package_bytes();
    read_chunks(flash, part, |chunk| hash.update(chunk))
        && signed.get(HASH_AT..) == Some(hash.finalize().as_slice())
        && VerifyingKey::from_bytes(public_key)
            .is_ok_and(|key| key.verify_strict(signed, &signature).is_ok())
}

//! Who signed a package: Ed25519 (RFC 8032) over the signed bytes of its header.
//!
//! `ed25519-dalek` verifies. The strict variant refuses keys and signatures of small order, which would be valid for many
//! messages.

use super::package::Header;
use ed25519_dalek::{Signature, VerifyingKey};

/// Returns true if the holder of the private key signed this header. Its duration is about 20 ms on the board.
// Not inlined: its stack is free again afterwards.
#[inline(never)]
pub fn is_signed(header: &Header, public_key: &[u8; 32]) -> bool {
    let signature = Signature::from_bytes(&header.signature);
    VerifyingKey::from_bytes(public_key)
        .is_ok_and(|key| key.verify_strict(&header.signed(), &signature).is_ok())
}

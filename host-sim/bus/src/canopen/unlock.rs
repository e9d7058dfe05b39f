//! Access at service level: unlocking a node when it refuses a write, locking it, changing its key.
//!
//! A node that is locked refuses some writes. The client then reads a challenge, answers it with its key, and
//! writes again. [`firmware::access`] has the rules. An unlock is valid for every node of the bus, so that a tool
//! locks the node when it is done ([`Client::lock`]), or the node locks itself after ten minutes.

use super::{Client, SdoError, name};
use crate::bus::Bus;
use canopen_rs::Address;
use firmware::access::Key;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::AccessObject;
use std::io;
use std::path::{Path, PathBuf};

/// Abort code of a write that needs the service level.
pub(super) const LOCKED: u32 = 0x0601_0000;

/// Abort code of a response during the wait after a wrong one.
const WAIT: u32 = 0x0800_0022;

/// Environment variable with the file of the key, for tools.
pub const KEY_VARIABLE: &str = "FRICTION_JOINT_KEY";

/// Error of the file of a joint's key; its message is one line.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum KeyFileError {
    /// It cannot be read.
    #[error("key {path}: {source}")]
    Read { path: PathBuf, source: io::Error },
    /// It holds a key of another kind.
    #[error(
        "key {0}: a key that signs programs; expected the key of the joint, 32 hexadecimal digits"
    )]
    SigningKey(PathBuf),
    /// It holds no key.
    #[error(
        "key {path}: {found} bytes that are no key; expected 32 hexadecimal digits, as of `head -c 16 /dev/urandom | xxd -p`"
    )]
    NoKey { path: PathBuf, found: usize },
}

/// Reads the key of a joint from a file.
///
/// # Errors
/// See [`KeyFileError`].
pub fn read_key(path: &Path) -> Result<Key, KeyFileError> {
    let failed = |source| KeyFileError::Read { path: path.into(), source };
    let bytes = std::fs::read(path).map_err(failed)?;
    let text = str::from_utf8(&bytes).unwrap_or_default().trim();
    let is_key = text.len() == 2 * Key::LENGTH && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    let number = u128::from_str_radix(text, 16).ok().filter(|_| is_key);
    match number {
        Some(number) => Ok(Key::new(number.to_be_bytes())),
        None if text.starts_with("ed25519-") => Err(KeyFileError::SigningKey(path.into())),
        None => Err(KeyFileError::NoKey { path: path.into(), found: bytes.len() }),
    }
}

/// Returns the key of a file; without one, that of the file that [`KEY_VARIABLE`] names, or the public default key.
///
/// # Errors
/// See [`KeyFileError`].
pub fn key_of(file: Option<&Path>) -> Result<Key, KeyFileError> {
    let named = std::env::var_os(KEY_VARIABLE).filter(|path| !path.is_empty()).map(PathBuf::from);
    file.or(named.as_deref()).map_or(Ok(Key::DEFAULT), read_key)
}

const fn at(sub_index: u8) -> Address {
    Address::new(index::ACCESS, sub_index)
}

impl<B: Bus> Client<B> {
    /// Runs a write; unlocks the node and repeats it if it needs the service level.
    pub(super) fn unlocked(
        &mut self,
        object: Address,
        mut write: impl FnMut(&mut Self) -> Result<(), SdoError>,
    ) -> Result<(), SdoError> {
        match write(self) {
            Err(SdoError::Refused { code: LOCKED, .. }) => {}
            done => return done,
        }
        self.unlock_for(object)?;
        write(self)
    }

    /// Unlocks the node for a write of an object, which the error names.
    fn unlock_for(&mut self, object: Address) -> Result<(), SdoError> {
        let unlocked = self.unlock();
        let (object, node) = (name(object), self.node.number());
        unlocked.map_err(|error| match error {
            SdoError::Refused { code: WAIT, .. } => SdoError::UnlockDelayed { object, node },
            SdoError::Refused { why, .. } => SdoError::WrongKey { object, node, why },
            other => other,
        })
    }

    /// Answers a challenge of the node, which then accepts writes of the service level for ten minutes.
    ///
    /// # Errors
    /// See [`SdoError`]. A refusal means a wrong key, or a wait after one.
    pub fn unlock(&mut self) -> Result<(), SdoError> {
        let response = self.proof(&[])?;
        let written = self.download(at(AccessObject::RESPONSE), &response);
        self.with_reason(written)
    }

    /// Reads a challenge, and returns the proof of a change with the present key.
    fn proof(&mut self, change: &[u8]) -> Result<[u8; Key::RESPONSE_LENGTH], SdoError> {
        let serial = self.read_number(Address::new(index::IDENTITY, 4))?;
        let challenge_at = at(AccessObject::CHALLENGE);
        let challenge = self.read(challenge_at)?;
        let challenge = challenge.try_into().map_err(|challenge: Vec<u8>| SdoError::Length {
            object: name(challenge_at),
            found: challenge.len(),
            expected: Key::RESPONSE_LENGTH,
        })?;
        Ok(self.key.proof(challenge, serial, self.node.number(), change))
    }

    /// Writes a new key or policy with its proof. The node is unlocked before, so that a refusal is that of the proof.
    fn write_proven(&mut self, object: Address, change: &[u8]) -> Result<(), SdoError> {
        self.unlock_for(object)?;
        let proof = self.proof(change)?;
        self.write(object, &[change, &proof].concat())
    }

    /// Ends the service level of the node.
    ///
    /// # Errors
    /// See [`SdoError`].
    pub fn lock(&mut self) -> Result<(), SdoError> {
        self.write(at(AccessObject::LOCK), &[1])
    }

    /// Gives the node another key, which this client uses from now on. It is stored with the next save (1010h:1).
    /// It travels in clear text: no other node may listen. The present key of this client proves the change.
    ///
    /// # Errors
    /// See [`SdoError`]. With a wrong key, nothing is changed.
    pub fn set_key(&mut self, key: Key) -> Result<(), SdoError> {
        self.write_proven(at(AccessObject::NEW_KEY), &key.bytes())?;
        self.key = key;
        Ok(())
    }

    /// Sets whether the node starts locked. It is stored with the next save (1010h:1). The key of this client proves the
    /// change.
    ///
    /// # Errors
    /// See [`SdoError`]. With a wrong key, nothing is changed.
    pub fn set_locked_by_default(&mut self, is_locked: bool) -> Result<(), SdoError> {
        self.write_proven(at(AccessObject::NEW_POLICY), &[is_locked.into()])
    }
}

//! Files of Ed25519 keys: one line of text each, `ed25519-private HEX` or `ed25519-public HEX`.
//!
//! The private key signs packages. The public one is built into the boot program (`JOINT_UPDATE_KEY`).

use ed25519_dalek::SigningKey;
use std::fs::OpenOptions;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

const PRIVATE: &str = "ed25519-private ";
const PUBLIC: &str = "ed25519-public ";

/// Error of a key file; its message is one line.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// It cannot be read or written.
    #[error("key {path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The error.
        source: io::Error,
    },
    /// It holds no private key.
    #[error("key {0}: no private key; host-sim sign --new-key makes one")]
    Format(PathBuf),
}

/// Reads a private key.
///
/// # Errors
/// The file cannot be read, or holds no private key.
pub fn read(path: &Path) -> Result<SigningKey, KeyError> {
    let failed = |source| KeyError::Io { path: path.to_owned(), source };
    let text = std::fs::read_to_string(path).map_err(failed)?;
    let digits = text.trim().strip_prefix(PRIVATE).unwrap_or_default();
    let bytes = bytes_of(digits).ok_or_else(|| KeyError::Format(path.to_owned()))?;
    Ok(SigningKey::from_bytes(&bytes))
}

/// Makes a key pair: the private key in `path`, readable by its owner only, and the public one in `path.pub`. Returns the
/// path of the public key.
///
/// # Errors
/// A file exists already or cannot be written, or the system has no random numbers.
pub fn create(path: &Path) -> Result<PathBuf, KeyError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| KeyError::Io { path, source }
    };
    let random = Path::new("/dev/urandom");
    let mut seed = [0; 32];
    let read = std::fs::File::open(random).and_then(|mut file| file.read_exact(&mut seed));
    read.map_err(failed(random))?;
    let public_path = PathBuf::from(format!("{}.pub", path.display()));
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    let public = SigningKey::from_bytes(&seed).verifying_key().to_bytes();
    let public_line = format!("{PUBLIC}{}\n", hex(&public));
    let written =
        options.open(&public_path).and_then(|mut file| file.write_all(public_line.as_bytes()));
    written.map_err(failed(&public_path))?;
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let line = format!("{PRIVATE}{}\n", hex(&seed));
    let written = options.open(path).and_then(|mut file| file.write_all(line.as_bytes()));
    written.map_err(failed(path))?;
    Ok(public_path)
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn bytes_of(digits: &str) -> Option<[u8; 32]> {
    if digits.len() != 64 || !digits.is_ascii() {
        return None;
    }
    let mut bytes = [0; 32];
    for (at, byte) in bytes.iter_mut().enumerate() {
        *byte = u8::from_str_radix(digits.get(2 * at..2 * at + 2)?, 16).ok()?;
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn key_create_then_read_signs_with_the_public_key() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("joint.key");
        let public_path = create(&path).unwrap();
        let key = read(&path).unwrap();
        let public = std::fs::read_to_string(public_path).unwrap();
        assert_eq!(public.trim(), format!("{PUBLIC}{}", hex(&key.verifying_key().to_bytes())));
        // An existing key is never replaced.
        assert!(create(&path).is_err());
    }

    #[test]
    fn key_read_of_other_text_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("joint.key");
        for text in ["", "ed25519-public 00", "ed25519-private 0x", "ed25519-private zz"] {
            std::fs::write(&path, text).unwrap();
            assert!(matches!(read(&path), Err(KeyError::Format(_))), "{text}");
        }
    }
}

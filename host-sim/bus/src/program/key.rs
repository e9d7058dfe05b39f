//! Files of Ed25519 keys: one line of text each, `ed25519-private HEX` or `ed25519-public HEX`.
//!
//! The private key signs packages. The public one is built into the boot program (`JOINT_UPDATE_KEY`), and a joint reports
//! its first four bytes (2040h:12).

use ed25519_dalek::SigningKey;
use std::fs::OpenOptions;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

const PRIVATE: &str = "ed25519-private ";
const PUBLIC: &str = "ed25519-public ";

/// Error of a key file; its message is one line.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum KeyError {
    /// It cannot be read or written.
    #[error("key {path}: {source}")]
    Io { path: PathBuf, source: io::Error },
    /// The file exists, and a key is never replaced.
    #[error("key {0}: exists already, and no key is replaced; choose another name")]
    Exists(PathBuf),
    /// It holds no private key.
    #[error("key {0}: no private key; host-sim sign --new-key makes one")]
    Format(PathBuf),
}

/// Public key of `firmware/keys/test.key`, which is published. A boot program that was built with `JOINT_UPDATE_KEY=test`
/// accepts it.
const PUBLISHED: &str = "ea4a6c63e29c520abef5507b132ec5f9954776aebebe7b92421eea691446d22c";

/// Returns true if the key is the published test key, so that its signature protects nothing.
#[must_use]
pub fn is_published(key: &SigningKey) -> bool {
    hex(&key.verifying_key().to_bytes()) == PUBLISHED
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
        move |source: io::Error| match source.kind() {
            io::ErrorKind::AlreadyExists => KeyError::Exists(path),
            _ => KeyError::Io { path, source },
        }
    };
    let random = Path::new("/dev/urandom");
    let mut seed = [0; 32];
    let read = std::fs::File::open(random).and_then(|mut file| file.read_exact(&mut seed));
    read.map_err(failed(random))?;
    let public_path = PathBuf::from(format!("{}.pub", path.display()));
    let line = format!("{PRIVATE}{}\n", hex(&seed));
    write_new(path, &line, true).map_err(failed(path))?;
    let public = SigningKey::from_bytes(&seed).verifying_key().to_bytes();
    let line = format!("{PUBLIC}{}\n", hex(&public));
    if let Err(error) = write_new(&public_path, &line, false) {
        // Half a pair would be taken for the whole one.
        let _ = std::fs::remove_file(path);
        return Err(failed(&public_path)(error));
    }
    Ok(public_path)
}

/// Writes a file that must not exist; a private one can be read by its owner only.
fn write_new(path: &Path, line: &str, is_private: bool) -> io::Result<()> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    if is_private {
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    }
    options.open(path)?.write_all(line.as_bytes())
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
    }

    #[test]
    fn key_create_beside_an_existing_half_replaces_nothing_and_leaves_no_half() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("joint.key");
        let public_path = folder.path().join("joint.key.pub");
        for (taken, absent) in [(&path, &public_path), (&public_path, &path)] {
            std::fs::write(taken, "kept").unwrap();
            let error = create(&path).unwrap_err();
            assert!(matches!(error, KeyError::Exists(_)), "{error}");
            assert!(error.to_string().contains("choose another name"), "{error}");
            assert_eq!(std::fs::read_to_string(taken).unwrap(), "kept");
            assert!(!absent.exists());
            std::fs::remove_file(taken).unwrap();
        }
    }

    #[test]
    fn key_of_the_tests_is_the_published_one_and_a_new_key_is_not() {
        let keys = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/keys");
        let published = read(&keys.join("test.key")).unwrap();
        assert!(is_published(&published));
        let start = firmware::update::PUBLISHED_KEY.to_be_bytes();
        assert_eq!(published.verifying_key().to_bytes()[..4], start);
        let folder = tempfile::tempdir().unwrap();
        create(&folder.path().join("joint.key")).unwrap();
        assert!(!is_published(&read(&folder.path().join("joint.key")).unwrap()));
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

//! Fuzzes what reads packages and images on the PC, and the header of a package as joint and boot program read it.
//!
//! Any bytes give an error of one line or a value. A file that is accepted is written again with the same bytes, and so is
//! each header. An image that is accepted can be signed, and the file of it is read as the same image.

use crate::bytes::Bytes;
use ed25519_dalek::SigningKey;
use firmware::update::Board;
use firmware::update::package::{
    CRC, HASH_AT, HEADER_BYTES, Header, SIGNED_BYTES, USED_BYTES, Version, emit,
};
use joint_bus::program::package::{Code, FILE_MAGIC, Package, PackageError, Release, parse_image};
use sha2::{Digest, Sha512};
use std::path::Path;

/// Bytes that describe an image in the third form of the input.
const LONGEST_IMAGE: usize = 600;

fn check_error(error: &PackageError) {
    let text = error.to_string();
    assert!(!text.is_empty() && !text.contains('\n'), "{text:?}");
}

/// Checks that a header, if it is accepted, is written again with the same bytes.
fn check_header(bytes: &[u8]) {
    let Some(used) = bytes.first_chunk::<USED_BYTES>() else { return };
    let Ok(header) = Header::parse(used) else { return };
    let hash = used[HASH_AT..SIGNED_BYTES].try_into().expect("64 bytes");
    let signature = used[SIGNED_BYTES..].try_into().expect("64 bytes");
    let emitted = emit(&header.signed(hash), signature);
    assert_eq!(emitted[..USED_BYTES], *used);
    assert_eq!(header.identity, CRC.checksum(used));
    assert!(header.package_bytes() as usize > HEADER_BYTES);
}

fn check_file(file: &[u8]) {
    let release = match Release::parse(Path::new("joint.package"), file) {
        Ok(release) => release,
        Err(error) => return check_error(&error),
    };
    assert_eq!(release.to_bytes(), file);
    for package in release.packages() {
        let Header { address, identity, .. } = package.header;
        let found = release.for_address(address).expect("an address of it");
        assert_eq!(found.header, package.header);
        assert!(release.contains(identity));
        check_header(&package.bytes);
        assert!(package.bytes[USED_BYTES..HEADER_BYTES].iter().all(|byte| *byte == 0));
    }
}

/// Signs these images and checks that the file is read as the same.
fn check_signed(codes: &[Code]) {
    let version = Version(0x0102_0003);
    let key = SigningKey::from_bytes(&[7; 32]);
    let packages = codes.iter().map(|code| Package::sign(code, version, &key)).collect();
    let Some(release) = Release::new(packages) else {
        return assert!(codes.iter().skip(1).any(|code| code.address == codes[0].address));
    };
    let file = release.to_bytes();
    check_file(&file);
    let read = Release::parse(Path::new("joint.package"), &file).expect("a file of it");
    assert_eq!(read.packages().len(), codes.len());
    for (package, code) in read.packages().iter().zip(codes) {
        let image = &package.bytes[HEADER_BYTES..];
        assert!(image.starts_with(&code.bytes));
        assert_eq!(package.header.address, code.address);
        assert!(code.board.fits(&package.header));
    }
}

/// Sets length, CRC and hash of each package in a file to what the rest has, so that a file may be accepted.
fn repair(file: &mut [u8]) {
    let mut rest = &mut file[FILE_MAGIC.len()..];
    while rest.len() > HEADER_BYTES {
        let Some(Ok(header)) = rest.first_chunk().map(Header::parse) else { return };
        let end = (header.package_bytes() as usize).min(rest.len());
        let (package, left) = rest.split_at_mut(end);
        let (head, image) = package.split_at_mut(HEADER_BYTES);
        head[20..24].copy_from_slice(&(image.len() as u32).to_le_bytes());
        head[24..28].copy_from_slice(&CRC.checksum(image).to_le_bytes());
        head[HASH_AT..SIGNED_BYTES].copy_from_slice(&Sha512::digest(&*image));
        rest = left;
    }
}

/// Executes the target on an input.
pub fn run(data: &[u8]) {
    let Some((&selector, rest)) = data.split_first() else { return };
    check_header(rest);
    match selector % 4 {
        0 => check_file(rest),
        1 => {
            let mut file = [&FILE_MAGIC, rest].concat();
            repair(&mut file);
            check_file(&file);
        }
        2 => match parse_image(Path::new("firmware"), rest) {
            Ok(code) => check_signed(&[code]),
            Err(error) => check_error(&error),
        },
        _ => {
            let mut bytes = Bytes(rest);
            let mut code = || {
                let address = u32::from(bytes.byte()) << 24 | u32::from(bytes.byte());
                let length = usize::from(bytes.byte()) * usize::from(bytes.byte() % 4);
                let seed = bytes.byte();
                let content = (0..length.min(LONGEST_IMAGE)).map(|at| at as u8 ^ seed);
                Code { address, bytes: content.collect(), board: Board { number: 7, wiring: 8 } }
            };
            check_signed(&[code(), code()]);
        }
    }
}

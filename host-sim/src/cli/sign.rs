//! `sign`: makes a key pair, or a file of signed packages for `update` from the images of a release.

use super::error::{Result, in_file};
use super::output::print_text;
use super::values::{Expected, expected};
use firmware::update::package::{Header, Version};
use joint_bus::program::key;
use joint_bus::program::package::{Package, Release, read_image};
use joint_bus::program::update::board_name;
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `sign`.
#[derive(clap::Args)]
pub struct SignArguments {
    /// Images for slot A and slot B: the ELF files that cargo builds
    #[arg(value_name = "IMAGE", required_unless_present = "new_key", num_args = 1..=2)]
    images: Vec<PathBuf>,
    /// Make a key pair: the private key in FILE, the public one in FILE.pub
    #[arg(long, value_name = "FILE", conflicts_with_all = ["images", "key", "version", "out"])]
    new_key: Option<PathBuf>,
    /// File of the private key
    #[arg(long, value_name = "FILE", required_unless_present = "new_key")]
    key: Option<PathBuf>,
    /// Version of the images, MAJOR.MINOR.PATCH. Joints that confirmed this package refuse all older ones
    #[arg(long, value_name = "X.Y.Z", default_value = env!("CARGO_PKG_VERSION"), value_parser = version)]
    version: Version,
    /// File of the packages [default: joint.package, or joint-test-key.package with the published test key]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

fn version(text: &str) -> Result<Version, Expected> {
    Version::parse(text).ok_or_else(|| expected("MAJOR.MINOR.PATCH, such as 1.2.0"))
}

/// The images are not those of one release.
#[derive(Debug, thiserror::Error)]
#[error(
    "the images are linked for the same slot or for other boards; expected one of `cargo firmware` and one of `cargo firmware-b`"
)]
struct MixedImages;

/// Runs the command.
pub fn run(arguments: &SignArguments) -> Result {
    if let Some(path) = &arguments.new_key {
        let public = key::create(path)?;
        let (private, public) = (path.display().to_string(), public.display().to_string());
        if arguments.json {
            return print_text(
                &(json!({ "private_key": private, "public_key": public }).to_string() + "\n"),
            );
        }
        return print_text(&format!(
            "written: {private}, {public}\nnote: keep the private key offline; its holder can install any program\n"
        ));
    }
    let key = key::read(arguments.key.as_ref().expect("an argument without --new-key"))?;
    let mut packages = Vec::new();
    for image in &arguments.images {
        let code = read_image(image)?;
        packages.push(Package::sign(&code, arguments.version, &key));
    }
    let release = Release::new(packages).ok_or(MixedImages)?;
    let is_published = key::is_published(&key);
    let default = if is_published { "joint-test-key.package" } else { "joint.package" };
    let out = arguments.out.clone().unwrap_or_else(|| default.into());
    let bytes = release.to_bytes();
    std::fs::write(&out, &bytes).map_err(in_file(&out))?;
    let out = out.display().to_string();
    print_text(&(described(arguments, &out, &release, is_published) + "\n"))
}

fn described(
    arguments: &SignArguments,
    out: &str,
    release: &Release,
    is_published: bool,
) -> String {
    let Header { board, version, wiring, .. } = *release.header();
    let (board, wiring) = (board_name(board), format!("{wiring:08x}"));
    let parts = release.packages().iter();
    if arguments.json {
        let packages: Vec<_> = parts
            .map(|part| {
                json!({
                    "address": format!("{:#010x}", part.header.address),
                    "bytes": part.bytes.len(),
                    "crc": format!("{:08x}", part.header.crc),
                })
            })
            .collect();
        return json!({
            "file": out,
            "board": board,
            "version": version.to_string(),
            "wiring": wiring,
            "is_test_key": is_published,
            "packages": packages,
        })
        .to_string();
    }
    let listed: Vec<String> = parts
        .map(|part| format!("{} bytes for {:#010x}", part.bytes.len(), part.header.address))
        .collect();
    let mut text = format!(
        "written: {out}: board {board}, wiring {wiring}, version {version}, {}",
        listed.join(", ")
    );
    if release.packages().len() == 1 {
        text += "\nnote: joints that run from this slot cannot install it; sign the images of both slots";
    }
    if is_published {
        text += "\nnote: this is the published test key, so anyone can sign a program that such joints accept";
    }
    text
}

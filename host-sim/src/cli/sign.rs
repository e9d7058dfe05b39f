//! `sign`: makes a key pair, or a signed package for `update` from an image.

use super::output::print_text;
use firmware::update::package::Version;
use joint_bus::program::key;
use joint_bus::program::package::{Package, Statement, read_image};
use joint_bus::program::update::board_name;
use serde_json::json;
use std::path::PathBuf;

/// Arguments of `sign`.
#[derive(clap::Args)]
pub struct SignArguments {
    /// Image: the ELF file that cargo builds, or its code as a binary file
    #[arg(value_name = "IMAGE", required_unless_present = "new_key")]
    image: Option<PathBuf>,
    /// Make a key pair: the private key in FILE, the public one in FILE.pub
    #[arg(long, value_name = "FILE", exclusive = true)]
    new_key: Option<PathBuf>,
    /// File of the private key
    #[arg(long, value_name = "FILE", required_unless_present = "new_key")]
    key: Option<PathBuf>,
    /// Version of the image, MAJOR.MINOR.PATCH
    #[arg(long, value_name = "X.Y.Z", default_value = env!("CARGO_PKG_VERSION"), value_parser = version)]
    version: Version,
    /// Anti-rollback counter: joints that confirmed this package refuse all with a smaller one
    #[arg(long, value_name = "N", default_value_t = 0)]
    counter: u32,
    /// Board of the image, four letters
    #[arg(long, value_name = "BOARD", default_value = "G474", value_parser = board)]
    board: u32,
    /// File of the package
    #[arg(long, value_name = "FILE", default_value = "joint.package")]
    out: PathBuf,
    /// Print the result as JSON
    #[arg(long, exclusive = false)]
    json: bool,
}

fn version(text: &str) -> Result<Version, String> {
    Version::parse(text).ok_or_else(|| "expected MAJOR.MINOR.PATCH, such as 1.2.0".to_owned())
}

fn board(text: &str) -> Result<u32, String> {
    let bytes = text.as_bytes().try_into().map(u32::from_be_bytes);
    bytes.map_err(|_| "expected four letters, such as G474".to_owned())
}

/// Runs the command.
pub fn run(arguments: &SignArguments) -> Result<(), String> {
    if let Some(path) = &arguments.new_key {
        let public = key::create(path).map_err(|error| error.to_string())?;
        return print_text(&format!(
            "written: {}, {}\nnote: keep the private key offline; whoever has it can install any program\n",
            path.display(),
            public.display()
        ));
    }
    let (Some(image), Some(key)) = (&arguments.image, &arguments.key) else {
        return Err("sign needs an image and --key".to_owned());
    };
    let key = key::read(key).map_err(|error| error.to_string())?;
    let code = read_image(image).map_err(|error| error.to_string())?;
    let SignArguments { board, version, counter, .. } = *arguments;
    let package = Package::sign(&code, Statement { board, version, counter }, &key);
    let out = &arguments.out;
    std::fs::write(out, &package.bytes).map_err(|error| format!("{}: {error}", out.display()))?;
    let text = if arguments.json {
        json!({
            "package": out.display().to_string(),
            "board": board_name(board),
            "version": version.to_string(),
            "counter": counter,
            "bytes": package.bytes.len(),
            "crc": format!("{:08x}", package.header.crc),
        })
        .to_string()
    } else {
        format!(
            "written: {}: board {}, version {version}, counter {counter}, {} bytes",
            out.display(),
            board_name(board),
            package.bytes.len()
        )
    };
    print_text(&(text + "\n"))
}

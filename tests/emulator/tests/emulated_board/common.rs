//! The images of the tests, and the files of what they measure.

use emulated_board::Image;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Returns the path of an image that `tests/image/build` made for the board. `FIRMWARE_IMAGE` names another one for slot A, with the
/// images for slot B and the boot program beside it.
pub fn image_path(name: &str) -> PathBuf {
    let built = [env!("CARGO_MANIFEST_DIR"), "../../target/images/stm32g474/firmware"];
    let path =
        std::env::var_os("FIRMWARE_IMAGE").map_or_else(|| built.iter().collect(), PathBuf::from);
    path.with_file_name(name)
}

/// Writes what a test measured to a file of `target/figures/`, from which the book is built.
pub fn write_figures(file: &str, text: &str) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("figures");
    std::fs::create_dir_all(&folder).expect("a folder for the figures");
    std::fs::write(folder.join(file), text).expect("the file can be written");
}

/// Returns the image for slot A.
pub fn image() -> &'static Image {
    static IMAGE: LazyLock<Image> = LazyLock::new(|| {
        Image::read(&image_path("firmware")).expect("an image; tests/emulator/run builds it")
    });
    &IMAGE
}

/// Reads the image that a variable names; by default that which `tests/image/build` made at this path.
fn read_image(variable: &str, built: &str) -> Image {
    let path = std::env::var_os(variable).map_or_else(
        || [env!("CARGO_MANIFEST_DIR"), "../../target/images", built].iter().collect(),
        PathBuf::from,
    );
    Image::read(&path).expect("an image; tests/emulator/run builds it")
}

/// Returns the image for slot A of a board with the second wiring.
pub fn second_image() -> &'static Image {
    static IMAGE: LazyLock<Image> =
        LazyLock::new(|| read_image("FIRMWARE_SECOND", "stm32g474-second/firmware"));
    &IMAGE
}

/// Returns the image of the compact node, for the B-G431B-ESC1.
pub fn compact_image() -> &'static Image {
    static IMAGE: LazyLock<Image> =
        LazyLock::new(|| read_image("FIRMWARE_COMPACT", "esc1/firmware-esc1"));
    &IMAGE
}

/// Returns the boot program.
pub fn boot_program() -> &'static Image {
    static IMAGE: LazyLock<Image> = LazyLock::new(|| {
        Image::read(&image_path("boot")).expect("a boot program; tests/emulator/run builds it")
    });
    &IMAGE
}

/// Returns the image of the core alone.
pub fn core_image() -> &'static Image {
    static IMAGE: LazyLock<Image> =
        LazyLock::new(|| read_image("FIRMWARE_CORE", "core/core-image"));
    &IMAGE
}

//! The image of the tests.

use emulated_board::Image;
use std::path::PathBuf;
use std::sync::LazyLock;

/// Returns the image: that of `FIRMWARE_IMAGE`, or the one that cargo builds for the board.
pub fn image() -> &'static Image {
    static IMAGE: LazyLock<Image> = LazyLock::new(|| {
        let built =
            [env!("CARGO_MANIFEST_DIR"), "../../target/thumbv7em-none-eabihf/firmware/firmware"];
        let path = std::env::var_os("FIRMWARE_IMAGE")
            .map_or_else(|| built.iter().collect(), PathBuf::from);
        Image::read(&path).expect("an image; tests/emulator/run builds it")
    });
    &IMAGE
}

//! Measures the cost of the core on a Cortex-M4F: instructions, RAM, and fingerprints of its output bits.
//!
//! In QEMU (`cargo cost`) it prints all three; on a PC only the fingerprints, for comparison.
//! `tests/cost/run` runs both and compares the result with the table in git. Lines have the form `kind |
//! name | numbers`. `clock` explains how instructions are counted; `cases` lists the measured updates and
//! their inputs.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod cases;
#[cfg(target_os = "none")]
mod clock;

macro_rules! print_line {
    ($($arguments:tt)*) => {{
        #[cfg(target_os = "none")]
        cortex_m_semihosting::hprintln!($($arguments)*);
        #[cfg(not(target_os = "none"))]
        println!($($arguments)*);
    }};
}
#[cfg(target_os = "none")]
use print_line;

#[cfg(target_os = "none")]
#[panic_handler]
fn panic(info: &core::panic::PanicInfo) -> ! {
    use cortex_m_semihosting::debug;

    // The emulator ends with exit code 1, so that the test fails.
    print_line!("{}", info);
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}

fn print_fingerprints() {
    for (name, fingerprint) in test_boards::fingerprint::all() {
        print_line!("fingerprint | {name} | {fingerprint:08x}");
    }
}

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    use cortex_m_semihosting::debug;

    match cortex_m::Peripherals::take() {
        Some(peripherals) => cases::print_all(&mut clock::Clock::start(peripherals.SYST)),
        None => panic!("the peripherals are taken once"),
    }
    print_fingerprints();
    loop {
        debug::exit(debug::EXIT_SUCCESS);
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    print_fingerprints();
}

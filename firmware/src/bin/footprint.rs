//! Images that differ by the core alone: the difference of their sizes is the core's flash.
//!
//! Feature `footprint` makes the yardstick, which passes words from a source to a sink.
//! `footprint-loop` adds what runs in the current loop: step and sum of a compensator that stands
//! ready in memory. `footprint-core` adds the rest as well: parsing a record, validating and building.
//! Everything that goes in comes from where the compiler cannot see and everything that comes out
//! goes there, so nothing is computed at build time and nothing is left out. What both images need
//! (start-up, panic) is in neither difference; what only the core needs (soft-float `f64` for
//! validation, `libm` for terms) is the core's. `tests/cost/run` builds the images and subtracts.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {}

#[cfg(target_os = "none")]
mod image {
    #![allow(unsafe_code)] // One pointer, to a compensator that is never there: the image is not run.

    use core::hint::black_box;

    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo) -> ! {
        cortex_m::interrupt::disable();
        loop {
            cortex_m::asm::nop();
        }
    }

    #[cfg_attr(not(any(feature = "footprint-loop", feature = "footprint-core")), allow(dead_code))]
    fn source() -> u32 {
        black_box(0)
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        loop {
            black_box(run());
        }
    }

    #[cfg(not(any(feature = "footprint-loop", feature = "footprint-core")))]
    fn run() -> u32 {
        source()
    }

    #[cfg(any(feature = "footprint-loop", feature = "footprint-core"))]
    fn run() -> u32 {
        use compensator_core::Inputs;
        use compensator_core::compensator::Reading;

        let Some(compensator) = compensator() else {
            return 0;
        };
        compensator.set_enabled(source() != 0);
        let number = || f32::from_bits(source());
        let reading = || Reading { value: number(), age_s: number() };
        loop {
            let inputs = Inputs {
                velocity_rad_s: reading(),
                velocity_reference_rad_s: reading(),
                position_rad: reading(),
                acceleration_rad_s2: reading(),
                radial_force_n: reading(),
                pressure_diff_mpa: reading(),
                temperature_c: reading(),
                load_torque_nm: reading(),
                auxiliary: reading(),
                campaign_time_h: number(),
            };
            let output = compensator.step(&inputs);
            black_box(compensator.sum(number(), &output));
        }
    }

    /// Where a compensator stands.
    #[cfg(any(feature = "footprint-loop", feature = "footprint-core"))]
    fn place() -> *mut compensator_core::Compensator<f32> {
        black_box(0x2000_1000 as *mut _)
    }

    #[cfg(all(feature = "footprint-loop", not(feature = "footprint-core")))]
    fn compensator() -> Option<&'static mut compensator_core::Compensator<f32>> {
        // SAFETY: the image is measured, not run.
        Some(unsafe { &mut *place() })
    }

    #[cfg(feature = "footprint-core")]
    fn compensator() -> Option<&'static mut compensator_core::Compensator<f32>> {
        use compensator_core::{Compensator, record};
        let record = [source() as u8; record::LENGTH];
        let configuration = record::parse(black_box(&record)).ok()?;
        let built = Compensator::build(&configuration, firmware::control::PERIOD_S).ok()?;
        // SAFETY: the image is measured, not run.
        let place = unsafe { &mut *place() };
        *place = built;
        Some(place)
    }
}

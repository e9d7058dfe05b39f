//! The measured image: a loop from a source of words to a sink.

#![allow(unsafe_code)] // One pointer to a compensator that does not exist: the image is not run.

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

/// Returns the address of the compensator.
#[cfg(any(feature = "footprint-loop", feature = "footprint-core"))]
fn place() -> *mut compensator_core::Compensator<f32> {
    black_box(0x2000_1000 as *mut _)
}

#[cfg(all(feature = "footprint-loop", not(feature = "footprint-core")))]
fn compensator() -> Option<&'static mut compensator_core::Compensator<f32>> {
    // SAFETY: the image is only measured, never run.
    Some(unsafe { &mut *place() })
}

#[cfg(feature = "footprint-core")]
fn compensator() -> Option<&'static mut compensator_core::Compensator<f32>> {
    use compensator_core::{Compensator, record};
    let record = [source() as u8; record::LENGTH];
    let configuration = record::parse(black_box(&record)).ok()?;
    let built = Compensator::build(&configuration, firmware::control::PERIOD_S).ok()?;
    // SAFETY: the image is only measured, never run.
    let place = unsafe { &mut *place() };
    *place = built;
    Some(place)
}

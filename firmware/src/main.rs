//! The joint driver's image: for now it starts, builds a compensator and waits.
//!
//! Current loop, CAN node, parameter store and supervisor are not here yet; nothing drives a
//! bridge. On a PC this is a stub, so that the workspace builds and tests as a whole.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    use compensator_core::{Compensator, LawKind};
    use firmware::joint::{PERIOD_S, configuration};

    let configuration = configuration(LawKind::ImprovedLugre, &[]);
    // Refused parameters leave the joint without compensation, not without a drive.
    let mut compensator = Compensator::<f32>::build(&configuration, PERIOD_S).ok();
    if let Some(compensator) = &mut compensator {
        compensator.set_enabled(true);
    }
    core::hint::black_box(&mut compensator);
    loop {
        cortex_m::asm::wfi();
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    println!("This is the stub of the joint driver's firmware; `cargo firmware` builds the image.");
}

//! The power stage: only the timer of the bridge. **Nothing is measured**, so the joint cannot be armed.

use super::registers::{TIM1, TIM5, read, timer, write};
use super::scales;
use firmware::control::{BridgeFault, PowerStage, StageSample, ValidChannels};

/// Opens the bridge: the timer outputs go to their idle levels.
pub fn open_bridge() {
    write(TIM1 + timer::BREAK, 0);
}

/// The bridge, driven by TIM1.
pub struct Stage;

impl PowerStage for Stage {
    /// A real board returns currents in A, bus voltage in V and the encoder's angle.
    fn sample(&mut self) -> StageSample {
        StageSample { currents_a: [0.0; 3], bus_v: 0.0, encoder: 0, valid: ValidChannels::empty() }
    }

    fn bridge_fault(&mut self) -> Option<BridgeFault> {
        (read(TIM1 + timer::STATUS) & timer::BREAK_FLAG != 0).then_some(BridgeFault::GateDriver)
    }

    /// A real board drives the enable pin of its gate driver.
    fn set_awake(&mut self, _awake: bool) {}

    fn drive(&mut self, duty: [f32; 3]) {
        for (place, duty) in duty.into_iter().enumerate() {
            let counts = (duty * f32::from(scales::PWM_TOP)) as u32;
            write(TIM1 + timer::COMPARE_1 + 4 * place, counts);
        }
        write(TIM1 + timer::BREAK, read(TIM1 + timer::BREAK) | timer::MAIN_OUTPUT_ENABLE);
    }

    fn off(&mut self) {
        open_bridge();
    }

    fn cycles(&self) -> u32 {
        read(TIM5 + timer::COUNTER)
    }
}

//! The power stage, as far as this board has one: the bridge's timer. **Nothing is measured**, so nothing arms.

use super::registers::{TIM1, TIM5, read, timer, write};
use super::scales;
use firmware::control::{Broke, PowerStage, StageSample, Valid};

/// Opens the bridge: the timer's outputs fall to their idle levels.
pub fn open_bridge() {
    write(TIM1 + timer::BREAK, 0);
}

/// The bridge on TIM1.
pub struct Stage;

impl PowerStage for Stage {
    /// To be written for a board: counts of the converters, in A and V, and the encoder's angle.
    fn sample(&mut self) -> StageSample {
        StageSample { currents_a: [0.0; 3], bus_v: 0.0, encoder: 0, valid: Valid::empty() }
    }

    fn broke(&mut self) -> Option<Broke> {
        (read(TIM1 + timer::STATUS) & timer::BROKE != 0).then_some(Broke::GateDriver)
    }

    /// To be written for a board: its gate driver's pin.
    fn wake(&mut self, _awake: bool) {}

    fn drive(&mut self, duty: [f32; 3]) {
        for (place, duty) in duty.into_iter().enumerate() {
            let counts = (duty * f32::from(scales::PWM_TOP)) as u32;
            write(TIM1 + timer::COMPARE_1 + 4 * place, counts);
        }
        write(TIM1 + timer::BREAK, read(TIM1 + timer::BREAK) | timer::OUTPUTS_ON);
    }

    fn off(&mut self) {
        open_bridge();
    }

    fn cycles(&self) -> u32 {
        read(TIM5 + timer::COUNTER)
    }
}

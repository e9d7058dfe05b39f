//! Hidden worlds: simulated joints in which one physical effect, or two, or none, is hidden.
//!
//! A diagnosis is worth what it says about joints it knows nothing of. Each world here is a campaign
//! of runs on a seal drawn at random, with its own rate, sensors, motions and covariates; the data
//! are as they would be read from a log, and [`WorldTruth`] holds what was hidden.
//!
//! ```text
//! kind ─► recipe ─► setting (seal, motions, covariates) ─► joint (physics) ─► torques ─► log
//!                        effect, drawn and sized until it shows ──┘                └─► truth
//! ```
//!
//! Nothing here knows `compensator-core`: the state is the bristles' deflection in rad, and the
//! integrator (`dynamics`) counts travel. A covariate that does nothing is in most logs, and moves.

mod arrange;
mod dice;
mod draw;
mod dynamics;
mod effect;
mod excite;
mod hidden;
mod joint;
mod kind;
mod motion;
mod outside;
mod sensors;
mod setting;
mod surroundings;
mod truth;

pub use effect::Effect;
pub use kind::{Kind, PAIRS, bank};
pub use setting::Options;
pub use truth::{Decoy, Hidden, WorldTruth};

use crate::data::{Dataset, Run};
use std::fmt::Write;

/// A log and the truth behind it.
#[derive(Clone, Debug)]
pub struct World {
    /// As if read from `data.csv`.
    pub data: Dataset,
    /// What was hidden.
    pub truth: WorldTruth,
}

/// Draws a world of a kind; the same seed gives the same bits.
pub fn draw(kind: Kind, seed: u64) -> World {
    draw_with(kind, &[], seed, &Options::default())
}

/// Draws a world with some things given. `sizes` are those of the kind's effects in their order, as
/// far as they are given; without one a size is drawn so that the effect shows.
pub fn draw_with(kind: Kind, sizes: &[Option<f64>], seed: u64, options: &Options) -> World {
    draw::draw(kind, sizes, seed, options)
}

impl World {
    /// `data.csv` by the contract; what is read from it is [`World::data`] again.
    pub fn csv(&self) -> String {
        let Some(first) = self.data.runs.first() else { return String::new() };
        let named = |run: &Run| -> Vec<(&str, bool)> {
            vec![
                ("position_rad", run.position.is_some()),
                ("acceleration_rad_s2", run.acceleration.is_some()),
                ("radial_force_n", run.radial_force_n.is_some()),
                ("pressure_diff_pa", run.pressure_diff_pa.is_some()),
                ("temperature_c", run.temperature_c.is_some()),
                ("load_torque_nm", run.load_torque_nm.is_some()),
            ]
        };
        let present = named(first).into_iter().filter(|(_, is)| *is).map(|(name, _)| name);
        let required = ["time_s", "velocity_rad_s", "torque_nm"].into_iter();
        let extras = self.data.covariates.iter().map(String::as_str);
        let columns: Vec<&str> = required.chain(present).chain(extras).collect();
        let mut text = format!("run,{}\n", columns.join(","));
        for run in &self.data.runs {
            let values: Vec<&[f64]> =
                columns.iter().filter_map(|name| self.data.column(run, name)).collect();
            for row in 0..run.len() {
                text += &run.name;
                for column in &values {
                    // Writing to a string does not fail. The shortest digits that read back as
                    // the same number: sensors have rounded it already.
                    let _ = write!(text, ",{}", column[row]);
                }
                text.push('\n');
            }
        }
        text
    }
}

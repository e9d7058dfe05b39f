//! Description of the filter between the shaft's torque and the logged torque.
//!
//! A current or a load cell is filtered before it is logged. The description is part of a [`super::Track`];
//! [`super::channel`] applies it to simulated torques.

/// Number of stages of [`LowPassShape::SecondOrder`], the most of any shape.
pub(super) const MAX_STAGES: usize = 2;

/// Impulse response of a low-pass filter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LowPassShape {
    /// One first-order stage.
    #[default]
    FirstOrder,
    /// Two first-order stages in series, each with half of the delay.
    SecondOrder,
    /// Moving average over twice the delay.
    RunningMean,
}

impl LowPassShape {
    /// All shapes.
    pub const ALL: [Self; 3] = [Self::FirstOrder, Self::SecondOrder, Self::RunningMean];

    /// Returns the name in `params.toml`.
    pub fn name(self) -> &'static str {
        match self {
            Self::FirstOrder => "first-order",
            Self::SecondOrder => "second-order",
            Self::RunningMean => "running-mean",
        }
    }

    /// Returns the shape with a name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|shape| shape.name() == name)
    }

    /// Returns the number of first-order stages; 0 for the moving average.
    pub(super) fn stages(self) -> usize {
        match self {
            Self::FirstOrder => 1,
            Self::SecondOrder => MAX_STAGES,
            Self::RunningMean => 0,
        }
    }
}

/// Low-pass filter that a torque passed before it was logged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TorqueLowPass {
    /// Delay of a slow signal, s; 0 for no filter.
    pub time_s: f64,
    /// Impulse response.
    pub shape: LowPassShape,
}

impl TorqueLowPass {
    /// Returns the share of the distance to its input that a stage covers in a period.
    pub(super) fn stage_gain(self, period_s: f64) -> f64 {
        let stage_time_s = self.time_s / self.shape.stages().max(1) as f64;
        -(-period_s / stage_time_s).exp_m1()
    }
}

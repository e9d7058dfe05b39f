//! The joint in HIL whose answers a driver must match: the model of the core, and the adaptation of its levels.

use compensator_core::adaptation::Frozen;
use compensator_core::can::{Message, SyncFrame};
use firmware::drive_settings::DriveSettings;
use firmware::hil::{HilJoint, HilSetup, HilStep};
use firmware::level_learner::{LevelLearner, ON};
use firmware::parameter_set::ParameterSet;

/// What the driver learns with.
#[derive(Debug)]
struct Learning {
    set: ParameterSet,
    settings: DriveSettings,
    learner: LevelLearner,
}

/// A joint in HIL as the driver computes it.
#[derive(Debug)]
pub struct CoreJoint {
    joint: HilJoint,
    /// `None` if the driver does not adapt.
    learning: Option<Box<Learning>>,
}

impl From<HilJoint> for CoreJoint {
    fn from(joint: HilJoint) -> Self {
        Self { joint, learning: None }
    }
}

impl CoreJoint {
    /// Creates a joint that learns gains on the sizes of its set, as these settings of the drive select.
    pub fn with_adaptation(joint: HilJoint, set: ParameterSet, settings: DriveSettings) -> Self {
        let mut learner = LevelLearner::default();
        learner.restart(&set, &settings, joint.setup().period_s);
        Self { joint, learning: Some(Box::new(Learning { set, settings, learner })) }
    }

    /// Enables the compensator, at rest, or disables it.
    pub fn set_enabled(&mut self, enabled: bool) {
        self.joint.set_enabled(enabled);
    }

    /// Returns the settings of the joint in HIL.
    pub const fn setup(&self) -> HilSetup {
        self.joint.setup()
    }

    /// Processes a message other than SYNC.
    pub fn take(&mut self, message: &Message) {
        if self.joint.take(message)
            && let Some(learning) = &mut self.learning
        {
            let Learning { set, settings, learner } = &mut **learning;
            learner.restart(set, settings, self.joint.setup().period_s);
        }
    }

    /// Processes a SYNC.
    pub fn sync(&mut self, sync: SyncFrame) -> HilStep {
        let Some(learning) = &mut self.learning else { return self.joint.sync(sync) };
        let blocked = (learning.settings.adapt != ON).then_some(Frozen::Hold);
        self.joint.sync_learning(sync, &mut learning.learner, blocked)
    }
}

//! An effect that a world hides: one of the joint's friction law, or one of its surroundings and sensors.

use super::campaign::{AddedColumn, Campaign};
use super::effect;
use super::family::Family;
use super::mechanism::{Along, Coupling, Mechanism, Payload, TravelShape};
use simulated_machines::effects::Wave;
use simulated_machines::scenarios::drawn_cause::DrawnCause;
use simulated_machines::scenarios::{Hidden, HiddenCause};

/// An effect with its size.
#[derive(Clone, Debug)]
pub(super) enum HiddenEffect {
    /// An effect of the friction law.
    Joint(DrawnCause),
    /// An error of the encoder over the angle.
    Encoder(Wave),
    /// Torque by another joint.
    Coupling(Coupling),
    /// Torque by a payload.
    Payload(Payload),
    /// Friction along the travel.
    Along(Along),
}

impl HiddenEffect {
    /// Returns the name of the cause.
    pub fn cause(&self) -> &'static str {
        match self {
            Self::Joint(drawn) => drawn.effect.name(),
            Self::Encoder(_) => "encoder-error",
            Self::Coupling(_) => "joint-coupling",
            Self::Payload(_) => "payload",
            Self::Along(_) => "unknown",
        }
    }

    /// Adds the effect to a mechanism.
    pub fn apply_to(&self, mechanism: &mut Mechanism) {
        match self {
            Self::Joint(drawn) => drawn.apply_to(&mut mechanism.joint),
            Self::Encoder(error) => mechanism.encoder = Some(*error),
            Self::Coupling(coupling) => mechanism.coupling = Some(*coupling),
            Self::Payload(payload) => mechanism.payload = Some(*payload),
            Self::Along(along) => mechanism.along = Some(*along),
        }
    }

    /// Returns the size.
    pub fn size(&self) -> f64 {
        match self {
            Self::Joint(drawn) => drawn.size,
            Self::Encoder(error) => error.size,
            Self::Coupling(coupling) => coupling.size,
            Self::Payload(payload) => payload.size,
            Self::Along(along) => along.size,
        }
    }

    /// Sets the size.
    pub fn set_size(&mut self, size: f64) {
        match self {
            Self::Joint(drawn) => drawn.size = size,
            Self::Encoder(error) => error.size = size,
            Self::Coupling(coupling) => coupling.size = size,
            Self::Payload(payload) => payload.size = size,
            Self::Along(along) => along.size = size,
        }
    }

    /// Returns true if the effect is proportional to its size.
    pub fn is_scalable(&self) -> bool {
        !matches!(self, Self::Joint(drawn) if !drawn.is_scalable())
    }

    /// Returns the smallest and largest magnitude to which the size is scaled.
    pub fn limits(&self, campaign: &Campaign) -> (f64, f64) {
        let most = match self {
            Self::Joint(drawn) => {
                let (least, most) = effect::limits(drawn, campaign);
                // A delay of a row is within the convention of when a row is sampled.
                let is_delay =
                    campaign.family == Family::Mixed && drawn.effect == HiddenCause::ChannelDelay;
                return if is_delay { (2.0 / campaign.rate_hz, most) } else { (least, most) };
            }
            // A magnet that is a few tenths of a millimetre off its axis.
            Self::Encoder(error) => 0.03 / error.order,
            Self::Coupling(_) | Self::Payload(_) => 3.0 * campaign.seal.coulomb_nm,
            Self::Along(_) => 0.8,
        };
        (1e-3 * most, most)
    }

    /// Returns the columns that the effect follows.
    pub fn columns(&self, campaign: &Campaign) -> Vec<&'static str> {
        let added = |meant: &[AddedColumn]| {
            let columns = campaign.added.iter().filter(|(_, column)| meant.contains(column));
            columns.map(|(name, _)| *name).collect()
        };
        match self {
            Self::Joint(drawn) => drawn.columns(),
            Self::Encoder(_) | Self::Along(_) => vec!["position_rad"],
            Self::Coupling(_) => {
                added(&[AddedColumn::OtherVelocity, AddedColumn::OtherAcceleration])
            }
            Self::Payload(_) => added(&[AddedColumn::Payload]),
        }
    }

    /// Returns the effect for the truth. `visible_rms_nm` is the RMS of its torque.
    pub fn describe(&self, campaign: &Campaign, visible_rms_nm: f64) -> Hidden {
        let effect = |unit, details, in_words| Hidden {
            cause: self.cause(),
            columns: self.columns(campaign),
            size: self.size(),
            unit,
            order: None,
            visible_rms_nm,
            details,
            in_words,
        };
        match self {
            Self::Joint(drawn) => {
                let order = drawn.is_periodic().then_some(drawn.order);
                Hidden { order, ..effect(drawn.unit(), drawn.details(), drawn.words()) }
            }
            Self::Encoder(error) => {
                let words = format!("encoder-error of {:.1e} rad", error.size);
                let details = vec![("phase_rad", error.phase)];
                Hidden { order: Some(error.order), ..effect("rad", details, words) }
            }
            Self::Coupling(coupling) => {
                let Coupling { size, acceleration, square, product, .. } = *coupling;
                let details =
                    vec![("acceleration", acceleration), ("square", square), ("product", product)];
                effect("Nm", details, format!("joint-coupling of {size:.2e} Nm"))
            }
            Self::Payload(Payload { size, weight, inertia, .. }) => {
                let details = vec![("weight", *weight), ("inertia", *inertia)];
                effect("Nm", details, format!("payload of {size:.2e} Nm"))
            }
            Self::Along(along) => {
                let (what, details) = match along.shape {
                    TravelShape::Slope => ("a slope", Vec::new()),
                    TravelShape::Dip { at, width } => ("a dip", vec![("at", at), ("width", width)]),
                };
                effect(
                    "1",
                    details,
                    format!("unknown: {what} of {:.2} along the travel", along.size),
                )
            }
        }
    }
}

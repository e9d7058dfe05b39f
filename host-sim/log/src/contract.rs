//! The contract: names and meaning of a log's columns.
//!
//! The names and their units are those of the core's table of quantities ([`compensator_core::quantity`]). Time,
//! velocity and torque are required, every other quantity of the table is optional, and any other name is a covariate.
//! A new row of that table is read, kept, written and simulated without a change here.

use compensator_core::quantity::{JointKind, Quantity};

/// The column of the run's name.
pub const RUN: &str = "run";

/// The column of time.
pub const TIME: &str = "time_s";

/// Columns of the demanded position, by joint kind. They are no covariates: the difference from the position is the error that
/// the friction causes.
pub const DEMANDS: [&str; 2] = ["demand_rad", "demand_m"];

/// Columns of a second encoder at the joint's side of the gear, by joint kind. Beside a position it is no covariate, because it
/// is nearly that position; the difference of both shows the play of the gear. Alone it is the position of the joint.
const JOINT_POSITIONS: [(&str, JointKind); 2] =
    [("joint_position_rad", JointKind::Revolute), ("joint_position_m", JointKind::Prismatic)];

/// Columns of the target, each with its joint kind.
pub(super) const TARGETS: [(&str, JointKind); 2] = both_kinds(Quantity::Torque);

/// Columns of the velocity, each with its joint kind.
pub(super) const VELOCITIES: [(&str, JointKind); 2] = both_kinds(Quantity::Velocity);

/// Columns of the position, each with its joint kind.
pub(super) const POSITIONS: [(&str, JointKind); 2] = both_kinds(Quantity::Position);

const fn both_kinds(quantity: Quantity) -> [(&'static str, JointKind); 2] {
    let (turns, slides) = (JointKind::Revolute, JointKind::Prismatic);
    [(quantity.name(turns), turns), (quantity.name(slides), slides)]
}

/// Returns the optional quantities of a log: all except time, velocity and torque. The core's auxiliary quantity has
/// no name of its own in a log; it is one of the covariates.
pub fn optional() -> impl Iterator<Item = Quantity> {
    use Quantity as Is;
    let excluded = [Is::Velocity, Is::Torque, Is::CampaignTime, Is::Auxiliary];
    Quantity::ALL.iter().copied().filter(move |quantity| !excluded.contains(quantity))
}

/// Returns the known quantities that are not motion of the joint itself: side load, pressure, and so on.
pub fn covariates() -> impl Iterator<Item = Quantity> {
    optional().filter(|known| !matches!(known, Quantity::Position | Quantity::Acceleration))
}

/// Returns the column of the encoder at the joint's side of the gear.
pub fn joint_position(joint: JointKind) -> &'static str {
    joint.choose(JOINT_POSITIONS.map(|(name, _)| name))
}

/// Returns true if a column is that of an encoder at the joint's side of the gear.
pub fn is_joint_position(name: &str) -> bool {
    JOINT_POSITIONS.iter().any(|(known, _)| *known == name)
}

/// Returns the quantity of which a column is a reading, with its joint kind.
pub(super) fn quantity_of(name: &str) -> Option<(Quantity, Option<JointKind>)> {
    let joint = JOINT_POSITIONS.iter().find(|(known, _)| *known == name);
    joint.map_or_else(|| Quantity::parse(name), |(_, kind)| Some((Quantity::Position, Some(*kind))))
}

/// Returns the optional quantity with a column name, in the units of a joint kind.
pub(super) fn parse_optional(name: &str, kind: JointKind) -> Option<Quantity> {
    let (quantity, found) = Quantity::parse(name)?;
    let fits = found.is_none_or(|found| found == kind) && optional().any(|of| of == quantity);
    fits.then_some(quantity)
}

/// Returns the names of the contract whose columns are read, each once: not those of the demand.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    let pairs = [Quantity::Velocity, Quantity::Torque].into_iter().chain(optional());
    let names = pairs.flat_map(|quantity| {
        let [turns, slides] = quantity.info().names;
        [Some(turns), (slides != turns).then_some(slides)]
    });
    let joint_positions = JOINT_POSITIONS.iter().map(|(name, _)| *name);
    [RUN, TIME].into_iter().chain(names.flatten()).chain(joint_positions)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_returns_each_column_once() {
        let all: Vec<&str> = names().collect();
        for name in ["run", "time_s", "velocity_m_s", "force_n", "position_rad", "temperature_c"] {
            assert!(all.contains(&name), "{name}");
        }
        let distinct: std::collections::HashSet<&str> = names().collect();
        assert_eq!(distinct.len(), all.len());
        assert!(DEMANDS.iter().all(|demand| !distinct.contains(demand)));
        assert!(!all.contains(&"auxiliary"));
    }

    #[test]
    fn parse_optional_with_unit_of_other_joint_kind_returns_none() {
        use JointKind::{Prismatic, Revolute};
        assert_eq!(parse_optional("position_m", Prismatic), Some(Quantity::Position));
        assert_eq!(parse_optional("position_m", Revolute), None);
        assert_eq!(parse_optional("temperature_c", Prismatic), Some(Quantity::Temperature));
        assert_eq!(parse_optional("torque_nm", Revolute), None);
        assert_eq!(parse_optional("flow", Revolute), None);
    }
}

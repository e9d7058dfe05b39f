//! Default identifiers of the PDOs.

use super::{InputSource, NodeId, PDO_UNUSED, PDOS};
use compensator_core::can::cob_id;

/// When a PDO has its default identifier.
#[derive(Clone, Copy)]
enum Used {
    Always,
    Never,
    With(InputSource),
}

/// Default identifier of a PDO less the node number, and when the PDO has it.
pub struct DefaultIdentifier(u16, Used);

impl DefaultIdentifier {
    /// Returns the identifier as in its object; bit 31 is set if the PDO is unused.
    pub fn value(&self, node: NodeId, source: InputSource) -> u32 {
        let is_used = match self.1 {
            Used::Always => true,
            Used::Never => false,
            Used::With(needed) => needed == source,
        };
        let unused = if is_used { 0 } else { PDO_UNUSED };
        (u32::from(self.0) + u32::from(node.number())) | unused
    }
}

/// Default identifiers of the transmit PDOs, to which the node number is added.
pub const TRANSMIT_IDENTIFIERS: [DefaultIdentifier; PDOS] = [
    DefaultIdentifier(cob_id::TPDO_1, Used::Always),
    DefaultIdentifier(cob_id::TPDO_2, Used::Always),
    DefaultIdentifier(cob_id::TPDO_3, Used::Always),
    DefaultIdentifier(cob_id::TPDO_4, Used::With(InputSource::Sensors)),
    DefaultIdentifier(cob_id::TPDO_5, Used::With(InputSource::Sensors)),
    // The predefined set has no sixth identifier. A master usually assigns that of a PDO it does not need.
    DefaultIdentifier(cob_id::TPDO_1, Used::Never),
];

/// Default identifiers of the receive PDOs. A joint on its sensors sends Motion and Torque; a joint in HIL receives them
/// with the same identifier.
pub const RECEIVE_IDENTIFIERS: [DefaultIdentifier; PDOS] = [
    DefaultIdentifier(cob_id::RPDO_1, Used::Always),
    DefaultIdentifier(cob_id::RPDO_2, Used::Always),
    DefaultIdentifier(cob_id::RPDO_3, Used::Always),
    DefaultIdentifier(cob_id::RPDO_4, Used::Always),
    DefaultIdentifier(cob_id::TPDO_4, Used::With(InputSource::Bus)),
    DefaultIdentifier(cob_id::TPDO_5, Used::With(InputSource::Bus)),
];

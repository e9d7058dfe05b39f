//! The table of a board's pins and peripherals, its identity, and the check of the connected pins.

use embassy_stm32::gpio::Pin;
use embassy_stm32::pac;
use firmware::update::package::CRC;

/// Returns the identity of a wiring: its table as text, and the parts of its bridge.
pub const fn identity(table: &str, parts: &[f32]) -> u32 {
    let mut identity = CRC.checksum(table.as_bytes());
    let mut at = 0;
    while at < parts.len() {
        let [e, f, g, h] = identity.to_le_bytes();
        let [i, j, k, l] = parts[at].to_bits().to_le_bytes();
        identity = CRC.checksum(&[e, f, g, h, i, j, k, l]);
        at += 1;
    }
    identity
}

/// Ports by their numbers.
const PORTS: [pac::gpio::Gpio; 6] =
    [pac::GPIOA, pac::GPIOB, pac::GPIOC, pac::GPIOD, pac::GPIOE, pac::GPIOF];

/// A pin that belongs to a peripheral, with its alternate function.
#[derive(Clone, Copy, Debug)]
pub struct Connection {
    port: u8,
    pin: u8,
    function: u8,
}

impl Connection {
    pub fn of(pin: &impl Pin, function: u8) -> Self {
        Self { port: pin.port(), pin: pin.pin(), function }
    }

    /// Returns true if the pin has this function now.
    fn holds(self) -> bool {
        let Some(port) = PORTS.get(usize::from(self.port)) else { return false };
        let pin = usize::from(self.pin);
        port.moder().read().moder(pin) == pac::gpio::vals::Moder::ALTERNATE
            && port.afr(pin / 8).read().afr(pin % 8) == self.function
    }
}

/// Returns true if these pins have their functions.
pub fn are_connected(connections: &[Connection]) -> bool {
    connections.iter().all(|connection| connection.holds())
}

/// Defines a struct for each part of a board, with its pins and peripherals, and the whole table. The number in brackets is
/// the alternate function of a pin that the start connects.
macro_rules! wiring {
    (
        required {$(
            $(#[$about:meta])*
            $field:ident: $group:ident {
                $($name:ident = $what:ident $([$function:literal])?, $text:literal;)*
            }
        )*}
        optional {$(
            $(#[$optional_about:meta])*
            $optional:ident: $optional_group:ident {
                $($optional_name:ident = $optional_what:ident, $optional_text:literal;)*
            }
        )*}
    ) => {
        $(
            $(#[$about])*
            pub struct $group {
                $(#[doc = $text] pub $name: embassy_stm32::Peri<'static, embassy_stm32::peripherals::$what>,)*
            }
        )*
        $(
            $(#[$optional_about])*
            pub struct $optional_group {
                $(#[doc = $optional_text] pub $optional_name: embassy_stm32::Peri<'static, embassy_stm32::peripherals::$optional_what>,)*
            }
        )*

        /// Names and pins of the table, without those that a board may leave open: an image that can use them also runs on a
        /// board without them.
        pub const TABLE: &str = concat!(
            $($(stringify!($field), ".", stringify!($name), "=", stringify!($what), ";",)*)*
        );

        /// The whole table.
        pub struct Wiring {
            $(pub $field: $group,)*
            $(pub $optional: $optional_group,)*
        }

        /// Returns the pins that the start connects to a peripheral.
        pub fn connections(p: &embassy_stm32::Peripherals) -> impl AsRef<[Connection]> + use<> {
            [$($($(Connection::of(&*p.$what, $function),)?)*)*]
        }

        /// Splits the peripherals into the parts of the board.
        pub fn wiring(p: embassy_stm32::Peripherals) -> Wiring {
            Wiring {
                $($field: $group { $($name: p.$what,)* },)*
                $($optional: $optional_group { $($optional_name: p.$optional_what,)* },)*
            }
        }
    };
}

//! The table of a board's pins and peripherals, its identity, and the check of the connected pins.
//!
//! The table is a text as well, `bridge.fault=PB10[12];`. What the code needs by number, such as the port of a pin for a panic
//! handler that does not own it, is read from this text by the compiler ([`pin_of`]). So it cannot differ from the table.

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

/// Returns the first byte after `name=` in the entries of a table; `None` without such an entry.
pub const fn find(table: &str, name: &str) -> Option<usize> {
    let (table, name) = (table.as_bytes(), name.as_bytes());
    let mut entry = 0;
    while entry < table.len() {
        let mut at = 0;
        while at < name.len() && entry + at < table.len() && table[entry + at] == name[at] {
            at += 1;
        }
        if at == name.len() && table[entry + at] == b'=' {
            return Some(entry + at + 1);
        }
        while table[entry] != b';' {
            entry += 1;
        }
        entry += 1;
    }
    None
}

/// Returns the first byte after `name=` in the entries of a table.
pub const fn value_at(table: &str, name: &str) -> usize {
    match find(table, name) {
        Some(at) => at,
        None => panic!("the table of pins has no entry of this name"),
    }
}

/// Returns the number that begins at a byte, and where it ends.
pub const fn number_at(table: &[u8], mut at: usize) -> (usize, usize) {
    let mut number = 0;
    while table[at].is_ascii_digit() {
        number = 10 * number + (table[at] - b'0') as usize;
        at += 1;
    }
    (number, at)
}

/// Returns port and number of the pin at this entry of a table, such as `bridge.enable`.
pub const fn pin_of(table: &str, name: &str) -> (pac::gpio::Gpio, usize) {
    let (table, at) = (table.as_bytes(), value_at(table, name));
    assert!(table[at] == b'P', "the entry is not a pin");
    (PORTS[(table[at + 1] - b'A') as usize], number_at(table, at + 2).0)
}

/// Returns true if the entry of a table is this pin, such as `is_pin(TABLE, "currents.phase_a", "PA0")`.
pub const fn is_pin(table: &str, name: &str, pin: &str) -> bool {
    let (first, mut at) = (value_at(table, name), 0);
    let (table, pin) = (table.as_bytes(), pin.as_bytes());
    while at < pin.len() {
        if table[first + at] != pin[at] {
            return false;
        }
        at += 1;
    }
    !table[first + at].is_ascii_digit()
}

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

/// Returns true if these pins have their functions. The log names the others.
pub fn are_connected(connections: &[Connection]) -> bool {
    let mut are_connected = true;
    for connection in connections.iter().filter(|connection| !connection.holds()) {
        let Connection { port, pin, function } = connection;
        defmt::error!("port {=u8}, pin {=u8}: not at its function {=u8}", port, pin, function);
        are_connected = false;
    }
    are_connected
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
        pub const TABLE: &str = concat!($($(
            stringify!($field), ".", stringify!($name), "=", stringify!($what), $("[", $function, "]",)? ";",
        )*)*);

        /// Names and pins that a board may leave open.
        pub const OPTIONAL: &str = concat!($($(
            stringify!($optional), ".", stringify!($optional_name), "=", stringify!($optional_what), ";",
        )*)*);

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

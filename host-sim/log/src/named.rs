//! Enums whose values have names for users.

/// Defines an enum with a name for each value: the list of all values, and the conversion in both directions.
#[macro_export]
macro_rules! named {
    (
        $(#[$attribute:meta])*
        $access:vis enum $name:ident { $($(#[doc = $doc:literal])+ $value:ident = $text:literal,)+ }
    ) => {
        $(#[$attribute])*
        $access enum $name { $($(#[doc = $doc])+ $value,)+ }

        impl $name {
            /// All values.
            pub const ALL: [Self; [$($text),+].len()] = [$(Self::$value),+];

            /// Returns the name for users.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$value => $text,)+ }
            }

            /// Describes the value to users: its documentation without the full stop.
            pub fn description(self) -> &'static str {
                let text = match self { $(Self::$value => concat!($($doc),+),)+ };
                text.trim().trim_end_matches('.')
            }

            /// Returns the value with a name.
            pub fn parse(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|value| value.name() == name)
            }
        }
    };
}

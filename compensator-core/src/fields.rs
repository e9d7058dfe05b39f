//! Parameters that are a struct of named numbers, each field written once.
//!
//! A set of thresholds or limits is a struct for the code that uses it, and a list of names and `f32`
//! values for a record, the object dictionary and a file. [`named_fields!`](crate::named_fields) makes
//! both from one list, so that a new field is one line and no order can differ from another.

/// Makes a struct of named numbers with `FIELDS`, `NAMES`, `TEXTS`, `to_array`, `from_array` and `Default`.
///
/// Each line is a field: its doc, name and type (`f32`, or an integer that an `f32` holds exactly) and its
/// default. Where every line also says `, least..=most, "why";` the struct has `RANGES`, in the form that
/// [`check_ranges`](crate::parameters::check_ranges) takes. The second doc is that of the defaults.
///
/// ```
/// compensator_core::named_fields! {
///     /// How hard a door closes.
///     pub struct Door {
///         /// Largest torque, Nm.
///         torque_limit_nm: f32 = 2.0, 0.0..=10.0, "a limit is a size";
///         /// How often it tries.
///         attempts: u32 = 3, 1.0..=100.0, "a door that never tries is a wall";
///     }
///     /// For a light door.
/// }
/// assert_eq!(Door::NAMES, ["torque_limit_nm", "attempts"]);
/// assert_eq!(Door::default().to_array(), [2.0, 3.0]);
/// assert_eq!(Door::from_array([1.0, 7.0]).attempts, 7);
/// assert_eq!((Door::RANGES[0].least, Door::RANGES[0].most), (0.0, 10.0));
/// ```
#[macro_export]
macro_rules! named_fields {
    ($(#[$doc:meta])* pub struct $name:ident {
        $($(#[$field_doc:meta])* $field:ident: $type:ty = $default:expr;)*
    } $(#[$default_doc:meta])*) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name { $($(#[$field_doc])* pub $field: $type,)* }

        impl $name {
            /// How many fields there are.
            pub const FIELDS: usize = [$(stringify!($field)),*].len();

            /// Names of the fields, in their order.
            pub const NAMES: [&'static str; Self::FIELDS] = [$(stringify!($field)),*];

            /// Names of the fields as a refusal contains them.
            pub const TEXTS: [$crate::parameters::Text; Self::FIELDS] =
                $crate::parameters::Text::all(Self::NAMES);

            /// The fields, in their order.
            // Out of line, because each copy of it takes two instructions for a field.
            #[inline(never)]
            pub const fn to_array(self) -> [f32; Self::FIELDS] {
                [$(self.$field as f32),*]
            }

            /// The parameters with these fields, in their order.
            #[inline(never)]
            pub const fn from_array(fields: [f32; Self::FIELDS]) -> Self {
                let [$($field),*] = fields;
                Self { $($field: $field as $type),* }
            }
        }

        impl Default for $name {
            $(#[$default_doc])*
            fn default() -> Self {
                // Copied from flash, because a store for each field takes more.
                static DEFAULTS: $name = $name { $($field: $default),* };
                DEFAULTS
            }
        }
    };
    ($(#[$doc:meta])* pub struct $name:ident {
        $($(#[$field_doc:meta])* $field:ident: $type:ty = $default:expr,
            $least:literal ..= $most:literal, $why:literal;)*
    } $(#[$default_doc:meta])*) => {
        $crate::named_fields! {
            $(#[$doc])* pub struct $name { $($(#[$field_doc])* $field: $type = $default;)* }
            $(#[$default_doc])*
        }

        impl $name {
            /// Smallest and largest legal value of each field, in their order, and why.
            pub const RANGES: [$crate::parameters::FieldRange; Self::FIELDS] =
                [$($crate::parameters::FieldRange {
                    least: $least,
                    most: $most,
                    why: $crate::parameters::Text::new($why),
                }),*];
        }
    };
}

//! Structs whose default values stand beside their fields, as in the default field values of RFC 3681.

/// Makes a struct and its `Default`. A field without a value has the default of its type. What stands behind the struct
/// (documentation, attributes) belongs to `default`.
macro_rules! with_defaults {
    (@value) => { Default::default() };
    (@value $default:expr) => { $default };
    ($(#[$doc:meta])* $visible:vis struct $name:ident {
        $($(#[$field_doc:meta])* $field_visible:vis $field:ident: $type:ty $(= $default:expr)?),* $(,)?
    } $(#[$default_doc:meta])*) => {
        $(#[$doc])*
        $visible struct $name { $($(#[$field_doc])* $field_visible $field: $type),* }

        impl Default for $name {
            $(#[$default_doc])*
            fn default() -> Self {
                Self { $($field: with_defaults!(@value $($default)?)),* }
            }
        }
    };
}

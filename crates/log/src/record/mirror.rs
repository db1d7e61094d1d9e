//! Records that are messages of the log with documentation: struct and conversion in one definition.

/// Defines a record with the fields of a message of the same names, and its conversion in both directions.
macro_rules! mirror {
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[$doc:meta])* pub $field:ident: $type:ty,)* }) => {
        $(#[$meta])*
        pub struct $name {
            $($(#[$doc])* pub $field: $type,)*
        }

        impl $name {
            /// The record that `message` holds.
            pub(crate) fn of(message: &crate::proto::$name) -> Self {
                Self { $($field: Clone::clone(&message.$field)),* }
            }

            /// Writes the record into `message`; its other fields stay.
            pub(crate) fn write(&self, message: &mut crate::proto::$name) {
                $(message.$field = Clone::clone(&self.$field);)*
            }
        }
    };
}

pub(crate) use mirror;

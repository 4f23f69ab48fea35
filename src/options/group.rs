//! Groups of options. Each is a struct whose fields can be set by name from text.

use std::fmt::Display;
use std::str::FromStr;

use crate::error::{Error, Result};

/// A field that can be set from text.
pub(super) trait Choice {
    /// Parses `texts`, a single text or the items of a list, and sets the field.
    ///
    /// # Errors
    /// A sentence that says what the texts should be.
    fn set(&mut self, texts: &[String]) -> Result<(), String>;
}

impl<T: FromStr<Err: Display>> Choice for Option<T> {
    fn set(&mut self, texts: &[String]) -> Result<(), String> {
        *self = Some(texts.join(",").parse().map_err(|error: T::Err| error.to_string())?);
        Ok(())
    }
}

impl<T: FromStr<Err: Display>> Choice for Vec<T> {
    fn set(&mut self, texts: &[String]) -> Result<(), String> {
        let items = texts.iter().map(|text| text.parse().map_err(|error: T::Err| error.to_string()));
        *self = items.collect::<Result<_, _>>()?;
        Ok(())
    }
}

impl Choice for bool {
    fn set(&mut self, texts: &[String]) -> Result<(), String> {
        *self = texts.concat().parse().map_err(|_| "it is true or false".to_owned())?;
        Ok(())
    }
}

/// A struct of options.
pub(super) trait Group {
    /// Sets the option `name`; false if the group has no such option.
    ///
    /// # Errors
    /// [`Error::Usage`] for texts that are no value of the option.
    fn set(&mut self, name: &str, texts: &[String]) -> Result<bool>;
}

/// Returns the error of a bad value: the option's name and the reason.
pub(super) fn bad_value(name: &str, why: &str) -> Error {
    Error::Usage(format!("{name}: {why}"))
}

/// Declares a group: a struct with `Default`, the command line's arguments (feature `cli`) and
/// [`Group`].
macro_rules! group {
    ($(#[$of_group:meta])* pub struct $group:ident { $($(#[$of_field:meta])* pub $field:ident: $type:ty,)* }) => {
        #[derive(Clone, Debug, Default, PartialEq)]
        #[cfg_attr(feature = "cli", derive(clap::Args))]
        $(#[$of_group])*
        // Brackets in help texts hold optional parts, such as [:L], and defaults, not links.
        #[allow(rustdoc::broken_intra_doc_links)]
        pub struct $group {
            $($(#[$of_field])* pub $field: $type,)*
        }

        impl $crate::options::group::Group for $group {
            fn set(&mut self, name: &str, texts: &[String]) -> $crate::Result<bool> {
                match name {
                    $(stringify!($field) => $crate::options::group::Choice::set(&mut self.$field, texts)
                        .map_err(|why| $crate::options::group::bad_value(name, &why))?,)*
                    _ => return Ok(false),
                }
                Ok(true)
            }
        }
    };
}

pub(super) use group;

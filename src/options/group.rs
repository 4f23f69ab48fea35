//! Groups of options: each is a struct whose fields are set by their names, from any text.

use std::fmt::Display;
use std::str::FromStr;

use crate::error::{Error, Result};

/// A field that texts can set.
pub(super) trait Choice {
    /// Sets the field to what `texts` say, which are the items of a list or one text.
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

/// The error of a value, with the name of its option.
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
        // Help texts write what may be left out as [:L], which is no link.
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

//! Memory that is asked for before it is taken in many parts, each of which would end the program
//! where there is none.

use crate::{Error, Result};

/// Makes sure that the system gives about so many bytes, which `what` is about to take. They are
/// given back at once.
///
/// # Errors
///
/// [`Error::NoMemory`].
pub(crate) fn check(bytes: u64, what: impl FnOnce() -> String) -> Result<()> {
    let room = Vec::<u8>::new().try_reserve_exact(usize::try_from(bytes).unwrap_or(usize::MAX));
    room.map_err(|_| Error::NoMemory { what: what(), mebibytes: bytes.div_ceil(1 << 20) })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn what_there_is_no_memory_for_is_named_with_its_size() {
        assert!(check(1 << 20, String::new).is_ok());
        let told = check(1 << 60, || "all of it".into()).unwrap_err();
        assert_eq!(told.to_string(), "the system has no memory for all of it: about 1099511627776 MiB are needed");
        assert_eq!(told.exit_code(), 1);
    }
}

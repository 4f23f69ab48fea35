//! Checks that memory is available before it is allocated in many parts. A failed allocation of a
//! part would end the program.

use crate::{Error, Result};

/// Checks that the system can provide this many bytes, by one allocation that is freed at once.
/// `what` names in the error what needs the memory.
///
/// # Errors
///
/// [`Error::NoMemory`] if the allocation fails.
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

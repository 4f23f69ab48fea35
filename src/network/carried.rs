//! Values that processes send to each other, as CBOR.

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{Network, exchanged};
use crate::error::{Error, Result};

/// A value that can be sent to other processes.
pub trait Carried: Send + Serialize + DeserializeOwned {}

impl<T: Send + Serialize + DeserializeOwned> Carried for T {}

/// Joins the values of all processes, in their order. `None` if a process has none.
///
/// # Errors
/// As [`exchanged`](super::exchanged); an error of this process in place of its value ends all.
pub fn joined<T: Carried>(
    network: &dyn Network,
    own: Result<Option<T>>,
    join: impl Fn(T, T) -> T,
) -> Result<Option<T>> {
    let damaged = || Error::Usage("a process sent values that are damaged".into());
    let encoded = own.and_then(|own| {
        let mut bytes = Vec::new();
        ciborium::into_writer(&own, &mut bytes).map_err(|_| damaged())?;
        Ok(vec![bytes; network.size()])
    });
    let all = exchanged(network, encoded)?;
    let read = |bytes: &Vec<u8>| ciborium::from_reader::<Option<T>, _>(&bytes[..]).map_err(|_| damaged());
    let all: Option<Vec<T>> = all.iter().map(read).collect::<Result<_>>()?;
    Ok(all.and_then(|all| all.into_iter().reduce(join)))
}

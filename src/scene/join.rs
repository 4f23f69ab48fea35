//! How a pixel joins the surfaces of splats and of triangles.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// The rule for pixels where splats and triangles meet. Both are resolved separately first: a
/// triangle hides no fragment of a splat before the splats are blended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Join {
    /// The nearer of the two, with the blended depth of the splats (Tien 2008, section 5.3). A
    /// splat that sticks out of its surface shifts this depth only by its share of the weight, so
    /// splats and triangles meet where their surfaces do.
    #[default]
    Corrected,
    /// The nearer of the two, with the depth of the splats' nearest fragment, as if both wrote to
    /// one depth buffer.
    Nearest,
    /// Both where their depths differ by at most epsilon (that of the largest surfel, along the
    /// camera's axis): the splats have the share `1/2 + (z_t - z_s) / (2 epsilon)` (after
    /// Guennebaud, Barthe and Paulin 2006).
    Blended,
}

impl FromStr for Join {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        match text {
            "corrected" => Ok(Self::Corrected),
            "nearest" => Ok(Self::Nearest),
            "blended" => Ok(Self::Blended),
            _ => Err(Error::Usage(format!(
                "splats and triangles are joined corrected, nearest or blended, not {text:?}"
            ))),
        }
    }
}

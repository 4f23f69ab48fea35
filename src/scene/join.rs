//! How what a pixel's splats show and what its triangles show become one.

use std::str::FromStr;

use crate::error::Error;

/// What shows where splats and triangles meet. Each is a surface by itself before: no fragment of a splat is told from others by a
/// triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Join {
    /// The nearer of the two, the splats by the depth that they blend to (Tien 2008, section 5.3). A splat that sticks out of its surface
    /// moves that depth by its weight's part only, so the two meet where their surfaces do.
    #[default]
    Corrected,
    /// The nearer of the two, the splats by their nearest fragment, as a depth buffer that both write to has it.
    Nearest,
    /// Both, where they lie within epsilon of each other, that of the largest surfel and along the axis, the nearer with the greater part: `1/2 + (z_t - z_s) / (2 epsilon)` of the
    /// splats (after Guennebaud, Barthe and Paulin 2006).
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

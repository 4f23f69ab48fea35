//! Light, background and the smoothness of edges.

use super::group::group;
use super::values::Rgba;
use crate::scene::{EyeDome, Light, Samples, Shading};

group! {
    /// Light, background and the smoothness of edges.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Look"))]
    pub struct LookOptions {
        /// Shading: unlit, lambert or phong [default: lambert; unlit if there are no normals]
        ///
        /// unlit shows the blended colour. lambert multiplies it by the lights' cosines, and phong
        /// adds white highlights. Points drawn with --facing, pictures with --blend nearest and
        /// Gaussians are unlit
        #[cfg_attr(feature = "cli", arg(long, value_name = "MODEL"))]
        pub shading: Option<Shading>,
        /// A light in place of the headlight: headlight[:INTENSITY] or X,Y,Z[:INTENSITY]
        ///
        /// X,Y,Z is the direction toward the light. The option may be given several times
        #[cfg_attr(feature = "cli", arg(long = "light", value_name = "LIGHT", allow_hyphen_values = true))]
        pub lights: Vec<Light>,
        /// Eye-dome lighting: darken what lies behind its neighbours in the image, with this
        /// strength [default: 1]
        ///
        /// It shows the shape of clouds without normals, and of points drawn with --facing
        #[cfg_attr(feature = "cli", arg(long, value_name = "STRENGTH", num_args = 0..=1, default_missing_value = "1"))]
        pub edl: Option<EyeDome>,
        /// Exponent of the highlights of --shading phong, 1 to 1000: the higher, the smaller the
        /// highlights [default: 32]
        #[cfg_attr(feature = "cli", arg(long, value_name = "EXPONENT", hide_short_help = true))]
        pub shininess: Option<f32>,
        /// Colour behind the scene: a name (white, black, gray), #RRGGBB, or linear R,G,B[,A]
        /// [default: transparent]
        #[cfg_attr(feature = "cli", arg(long, value_name = "COLOUR"))]
        pub background: Option<Rgba>,
        /// Samples per pixel: 1, 4, 8 or 16 [default: 4; 1 for Gaussians]
        ///
        /// More samples make smoother edges. Maps are taken at the pixel's centre. Samples are
        /// averaged in linear light; those of Gaussians are averaged as sRGB codes, as in their
        /// training
        #[cfg_attr(feature = "cli", arg(long, value_name = "N"))]
        pub samples: Option<Samples>,
    }
}

//! The attributes that are blended with the weight: colour, normal, depth, fragment count, and
//! texture coordinates.
//!
//! Each attribute has a file that adds its terms to a pixel's sums and a file that resolves them.
//! Where the attribute is absent, one file replaces both.

use super::lit;
use super::splat::Splat;
use crate::plan::pass::Pass;
use crate::plan::{ColorNeed, PixelLayout, RasterDepth, Settings, Sides, SurfelLayout, color_channels};
use crate::scene::{Camera, Map, Scene};

/// The pass's files and constants.
pub const PASS: Pass = Pass {
    name: "attributes",
    files: |needs| {
        let pick = |needed, file, absent| if needed { file } else { absent };
        let whole = needs.surface.raster().is_some_and(|raster| raster.depth != RasterDepth::Exact);
        let mut files = vec![
            pick(needs.normal, pick(needs.curved, "normal_curved.wgsl", "normal_flat.wgsl"), "normal_absent.wgsl"),
            pick(needs.own_normals, "normal_own.wgsl", "normal_plane.wgsl"),
            pick(needs.maps.has(Map::Count), "count.wgsl", "count_absent.wgsl"),
            // A single fragment needs no sum.
            match needs.sums_depth() && !needs.surface.shows_nearest() {
                false => "depth_absent.wgsl",
                true if needs.compares_depth() => "depth_middles.wgsl",
                true => pick(whole, "depth_whole.wgsl", "depth.wgsl"),
            },
            pick(needs.color == ColorNeed::Textured, "texture.wgsl", "texture_absent.wgsl"),
        ];
        files.extend(needs.normal.then_some("normal.wgsl"));
        files.push("attributes.wgsl");
        files.extend(match needs.color {
            // A single fragment needs no sum.
            _ if !needs.weighs() => &[][..],
            ColorNeed::Constant => &["color_constant.wgsl"],
            ColorNeed::Srgb8 => &["color_srgb8.wgsl", "srgb.wgsl", "color_sums.wgsl"],
            ColorNeed::Linear => &["color_linear.wgsl", "color_sums.wgsl"],
            ColorNeed::Textured => &["color_textured.wgsl", "textures.wgsl", "srgb.wgsl", "color_sums.wgsl"],
            ColorNeed::Harmonics(_) => &["color_harmonics.wgsl", "color_sums.wgsl"],
        });
        files
    },
    kernels: |_| Vec::new(),
    constants: |making| {
        let (layout, surfel) = (PixelLayout::of(making.needs), SurfelLayout::of(making.needs));
        let mut constants = vec![
            ("CHANNELS", layout.channels.into()),
            ("ATTRIBUTE_WORDS", surfel.words.into()),
            ("COPIES_WORD", surfel.copies.into()),
            ("LOW_WORD", surfel.low.into()),
            ("CLIP_WORD", surfel.clip.into()),
            ("CAP_WORD", surfel.cap.into()),
            ("THIRD_WORD", surfel.third.into()),
            ("NORMAL_WORD", surfel.normal.into()),
            ("NUMBER_WORD", surfel.number.into()),
            ("FADE_WORD", surfel.fade.into()),
            ("COLOR_CHANNELS", color_channels(making.needs).into()),
            ("TURNS", u32::from(making.needs.sides != Sides::Both).into()),
            ("NORMAL_CHANNEL", layout.normal_channel.into()),
            ("DEPTH_CHANNEL", layout.depth_channel.into()),
            ("MIDDLES_CHANNEL", layout.middles_channel.into()),
            ("COUNT_CHANNEL", layout.count_channel.into()),
            ("PLACE_CHANNEL", layout.place_channel.into()),
            ("HELD_BACK_CHANNEL", layout.held_back_channel.into()),
        ];
        if let ColorNeed::Harmonics(degree) = making.needs.color {
            constants.push(("HARMONICS_DEGREE", degree.into()));
        }
        constants
    },
};

/// The f64 twin: the premultiplied colour of a splat, as seen from the camera, and lit if splats
/// are lit.
pub fn color(scene: &Scene, splat: &Splat, camera: &Camera, options: &Settings) -> [f64; 4] {
    let surfel = splat.surfel as usize;
    let direction = camera.direction_to(scene.origin + scene.center(surfel));
    let [r, g, b, alpha] = scene.colors.seen(surfel, direction);
    lit::reference([r * alpha, g * alpha, b * alpha, alpha], splat, direction, options)
}

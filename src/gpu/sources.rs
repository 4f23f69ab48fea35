//! The kernels' texts: named files of WGSL, which are joined into modules.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::loops;
use crate::error::{Error, Result};

macro_rules! wgsl {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../wgsl/", $name)))),*]
    };
}

/// Every file of `wgsl/`.
pub const FILES: &[(&str, &str)] = wgsl![
    "accumulate.wgsl",
    "accumulator_cas.wgsl",
    "accumulator_fixed.wgsl",
    "accumulator_fixed32.wgsl",
    "accumulator_fixed64.wgsl",
    "accumulator_fixed_pairs.wgsl",
    "accumulator_fixed_wide.wgsl",
    "accumulator_float.wgsl",
    "accumulator_packed64.wgsl",
    "accumulator_raster.wgsl",
    "bin.wgsl",
    "blend.wgsl",
    "camera_orthographic.wgsl",
    "camera_pinhole.wgsl",
    "color_constant.wgsl",
    "color_linear.wgsl",
    "color_srgb8.wgsl",
    "color_sums.wgsl",
    "color_textured.wgsl",
    "copies.wgsl",
    "copies_absent.wgsl",
    "count.wgsl",
    "covered.wgsl",
    "count_absent.wgsl",
    "center.wgsl",
    "center_doubled.wgsl",
    "cull.wgsl",
    "cull_absent.wgsl",
    "depth.wgsl",
    "depth_absent.wgsl",
    "depth_whole.wgsl",
    "double.wgsl",
    "epsilon.wgsl",
    "epsilon_radius.wgsl",
    "filter.wgsl",
    "footprint.wgsl",
    "image_color.wgsl",
    "image_maps.wgsl",
    "kernel_constant.wgsl",
    "kernel_ellipse.wgsl",
    "kernel_gaussian.wgsl",
    "kernel_hat.wgsl",
    "layout.wgsl",
    "lowpass_ewa.wgsl",
    "lowpass_max.wgsl",
    "lowpass_none.wgsl",
    "normal.wgsl",
    "normal_absent.wgsl",
    "normal_map.wgsl",
    "normal_map_absent.wgsl",
    "occlusion.wgsl",
    "project.wgsl",
    "raster.wgsl",
    "raster_exact.wgsl",
    "raster_offset.wgsl",
    "raster_targets_1.wgsl",
    "raster_targets_2.wgsl",
    "raster_targets_3.wgsl",
    "records.wgsl",
    "resolve.wgsl",
    "rows.wgsl",
    "shade_lambert.wgsl",
    "shade_phong.wgsl",
    "shade_unlit.wgsl",
    "splat_plain.wgsl",
    "splat_shared.wgsl",
    "srgb.wgsl",
    "terms.wgsl",
    "terms_wide.wgsl",
    "texture.wgsl",
    "texture_absent.wgsl",
    "tile.wgsl",
    "tile_add.wgsl",
    "tile_add_wide.wgsl",
    "tile_deposit.wgsl",
    "tile_deposit_pairs.wgsl",
    "tile_filter.wgsl",
    "tile_filter_absent.wgsl",
    "tile_reach.wgsl",
    "tile_small.wgsl",
    "tile_small_absent.wgsl",
    "tile_sums.wgsl",
    "visibility.wgsl",
    "weight_map.wgsl",
    "weight_map_absent.wgsl",
    "words.wgsl",
    "words_long.wgsl",
];

/// The kernels' texts. The built-in ones, of which a researcher (or a test that must fail) may replace parts.
#[derive(Clone, Debug)]
pub struct Sources {
    texts: BTreeMap<&'static str, Cow<'static, str>>,
    counts_loops: bool,
}

impl Default for Sources {
    fn default() -> Self {
        Self { texts: FILES.iter().map(|&(name, text)| (name, Cow::Borrowed(text))).collect(), counts_loops: false }
    }
}

impl Sources {
    /// Replaces the one place in `file` that reads `from`; an error if there is not exactly one.
    pub fn replace(mut self, file: &str, from: &str, to: &str) -> Result<Self> {
        let text = self.texts.get_mut(file).ok_or_else(|| Error::Usage(format!("there is no kernel file {file}")))?;
        if text.matches(from).count() != 1 {
            return Err(Error::Usage(format!("{file} must hold {from:?} once, to be replaced")));
        }
        *text = Cow::Owned(text.replacen(from, to, 1));
        Ok(self)
    }

    /// The same, of which every loop is counted, those that are known to end too.
    pub(crate) fn with_counted_loops(self) -> Self {
        Self { counts_loops: true, ..self }
    }

    /// Whether all loops of `files` are known to end, and so need not be counted.
    pub(super) fn all_end(&self, files: &[&str]) -> bool {
        let ends = |file: &&str| match self.texts.get(file) {
            Some(Cow::Borrowed(text)) => loops::all_end(file, text),
            _ => false,
        };
        !self.counts_loops && files.iter().all(ends)
    }

    /// One module of `files`: WGSL's module scope is free of order, so joining is concatenation.
    pub fn join(&self, files: &[&str]) -> String {
        files.iter().map(|name| self.texts.get(name).map_or("", |text| text)).collect::<Vec<_>>().join("\n")
    }
}

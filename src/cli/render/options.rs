//! What the arguments of `epsplat render` say about a picture, and what a scene of Gaussians takes where they say nothing.

use epsplat::plan::{Accumulator, BackendName, Organisation, Raster, RenderOptions, check};
use epsplat::scene::composite::ALL_LAYERS;
use epsplat::scene::{
    Blend, Colors, Composite, Detail, Facing, Kernel, LowPass, Maps, PointSize, Samples, Scene, Shading, ShadingAt,
    Tail, gaussian,
};
use epsplat::{Error, Result};

use super::super::note;
use super::output::Format;
use super::{Arguments, LowPassName, NodeShape, ShadingAtName, ShadingName};

/// Samples of a pixel.
const SAMPLES: Samples = Samples { across: 2, down: 2 };

impl Arguments {
    /// The surfels are those of one file, which is no folder.
    pub(super) fn is_one_file(&self) -> bool {
        self.inputs.len() < 2 && self.inputs.iter().all(|path| !path.is_dir())
    }

    /// Points that face the camera have no normals, and of what is not blended none is kept.
    fn shading(&self) -> ShadingName {
        let unlit = self.facing.is_some() || self.blend == Some(Blend::Nearest);
        let unless_chosen = if unlit { ShadingName::Unlit } else { ShadingName::Lambert };
        self.shading.unwrap_or(unless_chosen)
    }
}

impl From<LowPassName> for LowPass {
    fn from(name: LowPassName) -> Self {
        match name {
            LowPassName::None => Self::None,
            LowPassName::Max => Self::Max,
            LowPassName::Ewa => Self::Ewa,
            LowPassName::Gaussians => Self::Gaussians,
        }
    }
}

pub(super) fn options(arguments: &Arguments, format: Format) -> Result<RenderOptions> {
    let maps = Maps::of(&arguments.aov);
    if !maps.is_empty() && format == Format::Png {
        return Err(Error::Usage("a PNG holds no maps: give --aov with an .exr output".into()));
    }
    check_chosen(arguments)?;
    if arguments.blend == Some(Blend::Nearest) && (arguments.epsilon.is_some() || arguments.kernel.is_some()) {
        let what = "--blend nearest has no tolerance and no weights: leave --epsilon and --kernel out";
        return Err(Error::Usage(what.into()));
    }
    if arguments.epsilon.is_some() && arguments.composite.is_some_and(Composite::is_order_free) {
        return Err(Error::Usage(
            "all fragments are summed, near and far: leave --epsilon out with --composite weighted or moments".into(),
        ));
    }
    // Without a last layer there is none to leave out, and the default says nothing.
    let layered = matches!(arguments.composite, Some(Composite::Layers(most)) if most < ALL_LAYERS);
    if arguments.tail.is_some_and(|tail| tail != Tail::default()) && !layered {
        return Err(Error::Usage("a tail lies behind a last layer: give --tail with --composite layers:L".into()));
    }
    if arguments.shading_at == ShadingAtName::Splat && arguments.shading() == ShadingName::Unlit {
        return Err(Error::Usage("nothing is lit: give --shading-at with --shading lambert or phong".into()));
    }
    let default = RenderOptions::default();
    let options = RenderOptions {
        epsilon: arguments.epsilon.unwrap_or(default.epsilon),
        kernel: arguments.kernel.unwrap_or(match arguments.lowpass {
            // It stands beside a Gaussian.
            Some(LowPassName::Gaussians) => gaussian::KERNEL,
            _ => default.kernel,
        }),
        blend: arguments.blend.unwrap_or_default(),
        composite: arguments.composite.unwrap_or_default(),
        opacity: arguments.opacity,
        tail: arguments.tail.unwrap_or_default(),
        join: arguments.join.unwrap_or_default(),
        // The surfels of one file stay together, with levels of detail too.
        separate: arguments.separate && !arguments.is_one_file(),
        cull: arguments.cull,
        detail: arguments.splats.map(|splats| Detail::Splats(splats.get())).or(arguments.lod).unwrap_or(default.detail),
        detail_measure: arguments.lod_measure.into(),
        detail_caps: arguments.lod_shape == NodeShape::Cap,
        detail_fades: arguments.lod_fade == Some(true),
        samples: arguments.samples.unwrap_or(SAMPLES),
        facing: facing(arguments),
        outline: arguments.outline,
        low_pass: arguments.lowpass.map_or(LowPass::None, LowPass::from),
        accumulator: arguments.accumulator.unwrap_or_default(),
        organisation: arguments.organisation.unwrap_or_default(),
        raster: raster(arguments),
        shading: shading(arguments),
        shading_at: match arguments.shading_at {
            ShadingAtName::Pixel => ShadingAt::Pixel,
            ShadingAtName::Splat => ShadingAt::Splat,
        },
        shininess: shininess(arguments)?.unwrap_or(default.shininess),
        lights: if arguments.lights.is_empty() { default.lights } else { arguments.lights.clone() },
        background: arguments.background.unwrap_or(default.background),
        maps,
        without: default.without,
    };
    check::options(&options, arguments.backend.0 == Some(BackendName::Reference))?;
    if !arguments.textures.is_empty() && arguments.facing.is_some() {
        return Err(Error::Usage("points that face the camera have no plane to paint: leave --texture out".into()));
    }
    if !arguments.textures.is_empty() {
        // Surfels have the mean of their texture where surfaces show through (scene.rs).
        let opaque = RenderOptions { composite: Composite::Opaque, ..options.clone() };
        check::textured(&opaque, arguments.backend.0 == Some(BackendName::Reference))?;
    }
    Ok(faded(arguments, options))
}

/// Of many views neighbouring cuts fade into each other where they can, unless something else was chosen.
fn faded(arguments: &Arguments, options: RenderOptions) -> RenderOptions {
    let default = arguments.cameras.is_some() && check::fades(&options).is_ok();
    RenderOptions { detail_fades: arguments.lod_fade.unwrap_or(default), ..options }
}

/// The options for a scene: Gaussians are drawn by the rules that their files are trained with ([`gaussian`]), but for what was chosen.
///
/// # Errors
/// [`Error::Usage`] for choices that do not go with Gaussians.
pub(super) fn for_scene(arguments: &Arguments, options: RenderOptions, scene: &Scene) -> Result<RenderOptions> {
    if options.blend == Blend::Nearest && matches!(scene.colors, Colors::Linear(_)) {
        note("--blend nearest keeps colours of 8 bits: finer ones are rounded, and what lies beyond white is cut");
    }
    if !scene.encoded {
        return Ok(options);
    }
    if arguments.shading_at == ShadingAtName::Splat && arguments.shading.is_none() {
        return Err(Error::Usage(
            "Gaussians have the colours that pictures of them show: leave --shading-at out".into(),
        ));
    }
    let shading = if arguments.shading.is_some() { options.shading } else { Shading::Unlit };
    let options = RenderOptions { shading, ..options };
    // Points that face the camera, the rasteriser and what is not blended have no such rules.
    if options.facing.is_some() || options.raster.is_some() || options.blend == Blend::Nearest {
        return Ok(options);
    }
    let kernel = arguments.kernel.unwrap_or(gaussian::KERNEL);
    let own = |sigma: f64| (sigma * gaussian::EXTENT - 1.0).abs() < 1e-6;
    if !matches!(kernel, Kernel::Gaussian { sigma } if own(sigma)) {
        note("warning: --kernel takes the place of the Gaussians' own: leave it out for pictures as they were trained");
    }
    let own_low_pass =
        arguments.lowpass.is_none() && options.outline.is_none() && matches!(kernel, Kernel::Gaussian { .. });
    let options = RenderOptions {
        kernel,
        low_pass: if own_low_pass { LowPass::Gaussians } else { options.low_pass },
        composite: arguments.composite.unwrap_or(Composite::Gaussians),
        // A Gaussian has no edge that more samples would smooth.
        samples: arguments.samples.unwrap_or(Samples::ONE),
        ..options
    };
    let options = faded(arguments, options);
    check::options(&options, arguments.backend.0 == Some(BackendName::Reference))?;
    Ok(options)
}

fn shading(arguments: &Arguments) -> Shading {
    match arguments.shading() {
        ShadingName::Unlit => Shading::Unlit,
        ShadingName::Lambert => Shading::Lambert,
        ShadingName::Phong => Shading::Phong,
    }
}

/// How points face the camera, if they do.
fn facing(arguments: &Arguments) -> Option<Facing> {
    let pixels = if let PointSize::Pixels(diameter) = arguments.point_size { [diameter; 2] } else { arguments.pixels };
    arguments.facing.map(|shape| Facing { shape, pixels })
}

/// The exponent of highlights, if there are any.
fn shininess(arguments: &Arguments) -> Result<Option<f32>> {
    match arguments.shininess {
        Some(_) if arguments.shading() != ShadingName::Phong => {
            Err(Error::Usage("--shininess is of highlights: give it with --shading phong".into()))
        }
        chosen => Ok(chosen),
    }
}

/// Fails for a choice that the backend does not have.
fn check_chosen(arguments: &Arguments) -> Result<()> {
    let chosen = check::Chosen {
        // A default that is given is no choice.
        accumulator: arguments.accumulator.is_some_and(|accumulator| accumulator != Accumulator::default()),
        organisation: arguments.organisation.is_some_and(|organisation| organisation != Organisation::default()),
        without: false,
        raster: arguments.blend_format.is_some() || arguments.raster_depth.is_some(),
    };
    check::chosen(arguments.backend.0, chosen)
}

/// The rasteriser's options, if it renders.
fn raster(arguments: &Arguments) -> Option<Raster> {
    let default = Raster::default();
    (arguments.backend.0 == Some(BackendName::Raster)).then(|| Raster {
        format: arguments.blend_format.unwrap_or(default.format),
        depth: arguments.raster_depth.unwrap_or(default.depth),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Alone {
        #[command(flatten)]
        arguments: Arguments,
    }

    #[test]
    fn what_nobody_asks_for_is_the_librarys_default_but_for_samples() {
        let of = |given: &[&str]| {
            let all = ["render", "in.ply", "-o", "out.exr"].iter().chain(given);
            options(&Alone::try_parse_from(all).unwrap().arguments, Format::Exr).unwrap()
        };
        let samples: Samples = "4".parse().unwrap();
        assert_eq!(of(&[]), RenderOptions { samples, ..RenderOptions::default() });
        assert_ne!(of(&["--epsilon", "rel:0.01"]).epsilon, RenderOptions::default().epsilon);
    }
}

//! The renders whose kernels are compiled, and the graphics card that they are translated for.

use epsplat::low_level::gpu::ahead::{Target, Translated, translate};
use epsplat::low_level::gpu::{AdapterDescription, Sources};
use epsplat::low_level::passes;
use epsplat::low_level::plan::pass::Making;
use epsplat::low_level::plan::{ColorNeed, Facts, Known, MeshFacts, Organisation, Plan, SceneNeeds, Settings, check};
use epsplat::low_level::scene::facing::POINT_SHAPES;
use epsplat::low_level::scene::{
    Blend, Composite, Detail, Facing, LevelFacts, LowPass, Map, Maps, Projection, Shading, ShadingAt, gaussian,
};
use epsplat::low_level::surfels::with_triangles;
use rayon::prelude::*;

use crate::common::meshes;
use crate::common::scenes::{painted, sphere, sphere_camera};

/// A render of the table.
pub struct Configuration {
    pub name: &'static str,
    needs: SceneNeeds,
    options: Settings,
    surfels: u64,
}

/// A Radeon RX 6800 with Mesa's driver, as wgpu describes it.
fn card() -> Target {
    let most = u64::from(u32::MAX);
    let adapter = AdapterDescription {
        name: "Radeon RX 6800".into(),
        api: "vulkan".into(),
        kind: "discrete",
        max_compute_workgroup_storage_size: 1 << 15,
        max_storage_buffer_binding_size: most,
        max_buffer_size: most,
        max_storage_buffers_per_shader_stage: 64,
        max_texture_dimension_2d: 16384,
        atomics_u64: true,
        integers_u64: true,
        blends_f32: true,
        subgroups: true,
        timestamps: true,
        ..AdapterDescription::core()
    };
    let features = wgpu::Features::SHADER_INT64
        | wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS
        | wgpu::Features::SUBGROUP
        | wgpu::Features::FLOAT32_BLENDABLE
        | wgpu::Features::TIMESTAMP_QUERY;
    let limits = wgpu::Limits {
        max_compute_workgroup_storage_size: 1 << 15,
        max_compute_invocations_per_workgroup: 1024,
        max_compute_workgroup_size_x: 1024,
        max_compute_workgroup_size_y: 1024,
        max_compute_workgroup_size_z: 1024,
        ..wgpu::Limits::default()
    };
    Target { adapter, features, limits }
}

impl Configuration {
    /// Plans a picture of 128 x 128 pixels.
    fn of(name: &'static str, facts: &Facts, options: Settings, projection: Projection, known: &Known) -> Self {
        check::options(&options, false).unwrap_or_else(|e| panic!("{name}: {e}"));
        check::scene(facts, &options, false).unwrap_or_else(|e| panic!("{name}: {e}"));
        let camera = sphere_camera(128, projection);
        let plan = Plan::of(facts, &card().adapter, &camera, &options, known).unwrap();
        Self { name, needs: plan.needs, options, surfels: facts.surfels }
    }

    /// Translates the kernels that the render dispatches.
    fn translated(&self, card: &Target, sources: &Sources) -> Vec<Translated> {
        let making = Making { needs: &self.needs, options: &self.options, surfels: self.surfels };
        let constants = passes::constants(&making);
        let of = |module: epsplat::low_level::plan::pass::Module| {
            let names: Vec<_> = module.kernels.iter().map(|kernel| kernel.name).collect();
            translate(card, sources, &module.files, &names, &constants).unwrap_or_else(|e| panic!("{}: {e}", self.name))
        };
        passes::modules(&self.needs).into_iter().flat_map(of).collect()
    }
}

/// The main renders. Those of many surfels on few pixels cull.
fn all() -> Vec<Configuration> {
    let (lit, many) = (Settings::default(), Facts::of(&sphere(20_000, 1.5)));
    let half = |composite: &str| Settings { composite: composite.parse().unwrap(), opacity: 0.5, ..lit.clone() };
    let long = Known { veiled: true, longest_list: 5000, ..Known::default() };
    let points = Facing { shape: POINT_SHAPES[0].1, pixels: Facing::LIMITS };
    let radius = many.largest_radius;
    let nodes = LevelFacts { largest_radius: radius, largest_shorter: radius, caps: true };
    let levels = Facts { levels: Some(nodes), ..many.clone() };
    let mesh = with_triangles(None, &[meshes::sphere(3, true)]).unwrap().0;
    let maps = Maps::of(&[Map::Normal, Map::Depth, Map::Weight, Map::Count, Map::Index]);
    let cut = Settings { detail: Detail::Pixels(2.0), ..lit.clone() };
    let gaussians = Settings {
        composite: Composite::Gaussians,
        kernel: gaussian::KERNEL,
        low_pass: LowPass::Gaussians,
        shading: Shading::Unlit,
        ..lit.clone()
    };
    let scatter = Settings { organisation: Organisation::Scatter, ..lit.clone() };
    let tile = Settings { organisation: Organisation::Tile, ..lit.clone() };
    let rows = [
        ("opaque", &many, lit.clone()),
        ("opaque, scattered", &many, scatter),
        ("opaque, by tiles", &many, tile.clone()),
        ("by tiles, 4 samples", &many, Settings { samples: "4".parse().unwrap(), ..tile.clone() }),
        ("unlit", &many, Settings { shading: Shading::Unlit, ..lit.clone() }),
        ("lit at splats", &many, Settings { shading_at: ShadingAt::Splat, shading: Shading::Phong, ..lit.clone() }),
        ("4 samples", &many, Settings { samples: "4".parse().unwrap(), ..lit.clone() }),
        ("maps", &many, Settings { maps, ..lit.clone() }),
        ("nearest", &many, Settings { blend: Blend::Nearest, shading: Shading::Unlit, ..lit.clone() }),
        ("curved", &Facts { caps: true, ..many.clone() }, lit.clone()),
        ("curved, by tiles", &Facts { caps: true, ..many.clone() }, tile.clone()),
        ("clipped", &Facts { clips: true, ..many.clone() }, lit.clone()),
        ("low pass ewa", &many, Settings { low_pass: LowPass::Ewa, ..lit.clone() }),
        ("textured", &Facts::of(&painted(2)), lit.clone()),
        ("layers", &many, half("layers")),
        ("layers, 2 and a tail", &many, half("layers:2")),
        ("sorted", &many, half("sorted")),
        ("weighted", &many, half("weighted")),
        ("moments", &many, half("moments")),
        ("gaussians", &Facts { encoded: true, colors: ColorNeed::Harmonics(3), ..many.clone() }, gaussians),
        ("triangles", &Facts { mesh: MeshFacts::of(&mesh.triangles), ..many.clone() }, lit.clone()),
        ("points", &many, Settings { facing: Some(points), shading: Shading::Unlit, ..lit.clone() }),
        ("levels", &levels, cut.clone()),
        ("fading levels", &levels, Settings { detail_fades: true, ..cut }),
    ];
    let known = Known::default();
    let pinhole = |(name, facts, options)| Configuration::of(name, facts, options, Projection::Pinhole, &known);
    let mut all: Vec<_> = rows.into_iter().map(pinhole).collect();
    all.push(Configuration::of("orthographic", &many, lit.clone(), Projection::Orthographic, &known));
    for (name, composite) in [("layers, long lists", "layers"), ("sorted, long lists", "sorted")] {
        all.push(Configuration::of(name, &many, half(composite), Projection::Pinhole, &long));
    }
    all
}

/// The kernels of each configuration, as the card gets them.
pub fn translated() -> Vec<(&'static str, Vec<Translated>)> {
    let (card, sources) = (card(), Sources::default());
    all().par_iter().map(|one| (one.name, one.translated(&card, &sources))).collect()
}

//! Every kernel is valid, portable WGSL, and its overrides and bindings match the host, for every
//! set of needs (the facts of scene and options that choose the WGSL files).

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::collections::{BTreeMap, BTreeSet};

use common::modules::{self, Made, Reflected};
use epsplat::low_level::gpu::Sources;
use epsplat::low_level::gpu::adapter::STORAGE_BUFFERS;
use epsplat::low_level::gpu::exact::open;
use epsplat::low_level::gpu::interface::reflect;
use epsplat::low_level::gpu::sources::FILES;
use epsplat::low_level::passes;
use epsplat::low_level::plan::pass::Making;
use epsplat::low_level::plan::{
    ACCUMULATORS, Accumulator, COLOR_CHANNEL, ColorNeed, Features, Oit, PixelLayout, Rasterised, SceneNeeds, Settings,
    Surface, Winner, color_channels,
};
use epsplat::low_level::scene::{Facing, Kernel, KernelShape, MAPS, Map, Outline};
use naga::AddressSpace;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use rayon::prelude::*;

/// Storage buffers per stage that core WebGPU guarantees.
const CORE_STORAGE_BUFFERS: usize = 8;

/// The naga capabilities that a kernel with `features` requires.
fn capabilities(features: Features) -> Vec<Capabilities> {
    match features {
        Features::None => vec![],
        Features::AtomicsU64 => vec![Capabilities::SHADER_INT64, Capabilities::SHADER_INT64_ATOMIC_ALL_OPS],
        Features::AtomicsF32 => vec![Capabilities::SHADER_FLOAT32_ATOMIC],
    }
}

fn is_valid(module: &naga::Module, capabilities: Capabilities) -> Result<(), String> {
    let outcome = Validator::new(ValidationFlags::all(), capabilities).validate(module);
    outcome.map(|_| ()).map_err(|e| e.into_inner().to_string())
}

#[test]
fn every_combination_is_valid_with_its_accumulators_features_and_no_others() {
    let different = modules::different();
    assert!(different.len() > 500, "{}", different.len());
    let without = different.par_iter().flat_map_iter(|made| {
        let Made { needs, files, kernels, .. } = made;
        let module = &made.reflected().module;
        let features = match needs.surface {
            Surface::Nearest(Winner::Once) => Features::AtomicsU64,
            Surface::Raster { .. } => Features::None,
            _ if needs.atomics_u64 => Features::AtomicsU64,
            _ => needs.accumulator.row().features,
        };
        let features = if made.of_tiles() { Features::None } else { features };
        let mut needed = capabilities(features);
        let by_triangles = if needs.mesh.is_some_and(|mesh| mesh.once) { Features::AtomicsU64 } else { Features::None };
        let by_triangles: Vec<_> = capabilities(by_triangles).into_iter().filter(|one| !needed.contains(one)).collect();
        needed.extend(&by_triangles);
        needed.extend(files.contains(&"splat_shared.wgsl").then_some(Capabilities::SUBGROUP));
        let long = files.contains(&"words_long.wgsl") && !needed.contains(&Capabilities::SHADER_INT64);
        needed.extend(long.then_some(Capabilities::SHADER_INT64));
        let all = needed.iter().copied().collect::<Capabilities>();
        is_valid(module, all).unwrap_or_else(|e| panic!("{}: {e}", needs.accumulator));
        for &capability in &needed {
            assert!(is_valid(module, all - capability).is_err(), "{} needs no {capability:?}", needs.accumulator);
        }
        let entries: BTreeSet<&str> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
        let drawn: &[&str] = match needs.surface {
            Surface::Raster { shown: Rasterised::Layers(_), .. } => {
                &["shape", "shape_to_peel", "shape_with_attributes", "raster_visibility", "raster_attributes"]
            }
            Surface::Raster { shown: Rasterised::Blended, .. } => {
                &["shape", "shape_with_attributes", "raster_visibility", "raster_attributes"]
            }
            Surface::Raster { shown: Rasterised::Nearest, .. } => &["shape", "shape_with_attributes", "raster_nearest"],
            _ => &[],
        };
        let of_mesh: &[&str] = match (needs.surface.raster(), needs.mesh) {
            (Some(_), Some(_)) => &["drawn_corner", "drawn_triangle"],
            _ => &[],
        };
        let drawn = drawn.iter().chain(of_mesh).copied();
        let own: BTreeSet<&str> = kernels.iter().map(|kernel| kernel.name).chain(drawn).collect();
        // Some modules contain entry points that they do not run: tiles and cuts share files with
        // other modules, order-free weights need no visibility pass, splats that are drawn as they
        // are projected need no kernel for it, and one module spreads fragments alone.
        let shared = entries.difference(&own).count();
        let leaves = made.of_tiles()
            || needs.levels
            || needs.draws_projected
            || files.contains(&"accumulate_spread.wgsl")
            || needs.surface.gathers()
            || needs.surface == Surface::OrderFree(Oit::Weighted);
        assert!(own.is_subset(&entries) && (shared == 0) != leaves, "{entries:?}");
        for (_, variable) in module.global_variables.iter().filter(|(_, v)| v.binding.is_some()) {
            let buffer = matches!(variable.space, AddressSpace::Uniform | AddressSpace::Storage { .. });
            // Only the rasteriser's outputs are textures.
            assert!(buffer || (needs.surface.raster().is_some() && variable.space == AddressSpace::Handle));
        }
        assert!(!made.text().lines().any(|line| line.starts_with("enable") || line.starts_with("requires")));
        needed.into_iter().map(move |of| match of {
            Capabilities::SUBGROUP => "tiles",
            of if by_triangles.contains(&of) => "triangles",
            Capabilities::SHADER_INT64 if long => "records",
            _ => needs.accumulator.name(),
        })
    });
    let without: BTreeSet<&str> = without.collect();
    assert_eq!(without, BTreeSet::from(["fixed", "fixed64", "float", "packed64", "records", "tiles", "triangles"]));
    // The default runs on any adapter.
    assert_eq!(Accumulator::Fixed.row().features, Features::None);
}

/// Each need is set in at least ten random renders and absent in at least ten, so the random
/// renders cover all that options can ask for.
#[test]
fn pictures_meet_every_need_and_its_absence() {
    let all = common::variants::all_needs();
    for (place, (_, name)) in all[0].flags().into_iter().enumerate() {
        let (with, without): (Vec<&SceneNeeds>, _) = all.iter().partition(|needs| needs.flags()[place].0);
        assert!(with.len() >= 10 && without.len() >= 10, "{name}: {} and {}", with.len(), without.len());
    }
    let names: BTreeSet<&str> = all.iter().flat_map(SceneNeeds::names).collect();
    let alternatives =
        ["pinhole", "orthographic", "kernel-gaussian", "kernel-ellipse", "kernel-cone", "kernel-constant"];
    let colors = ["color-constant", "color-srgb8", "color-linear", "color-textured", "color-harmonics"];
    let others =
        MAPS.iter().filter(|row| row.image_word.is_some()).map(|row| row.need).chain(alternatives).chain(colors);
    for name in others.chain(["raster-exact", "raster-offset"]) {
        assert!(names.contains(name), "{name}");
    }
    let accumulators: BTreeSet<&str> = all.iter().map(|needs| needs.accumulator.name()).collect();
    assert_eq!(accumulators, ACCUMULATORS.iter().map(|row| row.of.name()).collect());
}

#[test]
fn an_invalid_kernel_or_one_with_a_feature_is_noticed() {
    let needs = common::variants::plain();
    let broken = Sources::default().replace("kernel_ellipse.wgsl", "exp(-KERNEL_A", "exp(-view").unwrap();
    assert!(reflect(&broken.join(&passes::modules(&needs)[0].files)).is_err());
    let wide =
        Sources::default().replace("kernel_ellipse.wgsl", "var power: f32;", "var power: f32; let w = 1lu;").unwrap();
    let text = wide.join(&passes::modules(&needs)[0].files);
    let module = naga::front::wgsl::parse_str(&text).unwrap();
    assert!(Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).is_err());
}

/// No operation of a kernel has bits that depend on the adapter.
#[test]
fn no_kernel_uses_an_operation_that_drivers_compute_differently() {
    let different = modules::different();
    let left: BTreeSet<String> = different.par_iter().flat_map_iter(|made| open(made.text()).unwrap()).collect();
    assert!(left.is_empty(), "{left:?}");
}

/// The control: each built-in operation that may differ is either replaced or noticed.
#[test]
fn an_operation_that_drivers_compute_differently_is_noticed() {
    let text = |term: &str| {
        format!(
            "struct View {{ zero: u32 }}
            @group(0) @binding(0) var<uniform> view: View;
            @group(0) @binding(1) var<storage, read_write> a: array<vec3<f32>>;
            var<private> held: View;
            @compute @workgroup_size(1) fn run() {{ held = view; let x = a[0].x; let y = a[1].y; a[2].x = {term}; }}"
        )
    };
    let noticed = [
        "dot(a[0], a[1])",
        "cross(a[0], a[1]).x",
        "length(a[0])",
        "distance(a[0], a[1])",
        "normalize(a[0]).x",
        "fma(x, y, x)",
        "reflect(a[0], a[1]).x",
        "smoothstep(0.0, x, y)",
        "step(x, y)",
        "sin(x)",
        "cos(x)",
        "tan(x)",
        "asin(x)",
        "acos(x)",
        "atan(x)",
        "atan2(x, y)",
        "sinh(x)",
        "cosh(x)",
        "tanh(x)",
        "degrees(x)",
        "radians(x)",
        "x % y",
        "ldexp(x, 3)",
        "saturate(x)",
        "quantizeToF16(x)",
        "f32(pack2x16float(a[0].xy))",
        "(mat3x3<f32>(a[0], a[1], a[2]) * a[3]).x",
        "determinant(mat3x3<f32>(a[0], a[1], a[2]))",
        "unpack4x8unorm(bitcast<u32>(x)).x",
        "unpack2x16float(bitcast<u32>(x)).x",
    ];
    for term in noticed {
        assert_eq!(open(&text(term)).unwrap().len(), 1, "{term}");
    }
    let replaced = [
        "x / y",
        "sqrt(x)",
        "inverseSqrt(x)",
        "exp(x)",
        "exp2(x)",
        "log(x)",
        "log2(x)",
        "pow(x, y)",
        "min(x, y)",
        "max(x, y)",
        "clamp(x, y, 1.0)",
        "mix(x, y, 0.5)",
        "fract(x)",
        "f32(bitcast<u32>(x))",
        "abs(x)",
        "sign(x)",
        "floor(x)",
        "ceil(x)",
        "trunc(x)",
        "round(x)",
        "f32(i32(x))",
        "x * y - x",
    ];
    for term in replaced {
        assert_eq!(open(&text(term)).unwrap(), [""; 0], "{term}");
    }
    assert_eq!(open(&text("x").replace("held = view;", "")).unwrap(), [""; 0]);
    assert_eq!(open(&text("x * y").replace("held = view;", "")).unwrap(), ["run: no zero is held"]);
}

/// Files that are modules of their own: the kernels that only frames on the device use
/// (`src/render/record.rs`).
const ALONE: [&str; 2] = ["texture_rows.wgsl", "verdict.wgsl"];

#[test]
fn every_file_is_known_and_reached() {
    let directory = concat!(env!("CARGO_MANIFEST_DIR"), "/wgsl");
    let stages = std::fs::read_dir(directory).unwrap().map(|stage| stage.unwrap().path());
    let on_disk: BTreeSet<String> = stages
        .flat_map(|stage| std::fs::read_dir(stage).unwrap())
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".wgsl"))
        .collect();
    let known: BTreeSet<String> = FILES.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(on_disk, known);
    assert_eq!(known.len(), FILES.len());
    // Every module ends with the arithmetic, but those of `ALONE`.
    let files = modules::all().iter().flat_map(|made| &made.files).chain(&["arithmetic.wgsl"]).chain(&ALONE);
    let reached: BTreeSet<String> = files.map(|&file| file.to_owned()).collect();
    assert_eq!(reached, known);
}

#[test]
fn host_and_kernels_agree_about_overrides() {
    let mut declared_anywhere = BTreeSet::new();
    let mut set_anywhere = BTreeSet::new();
    for made in modules::all() {
        let (needs, module) = (&made.needs, &made.reflected().module);
        let kernel = match needs.kernel {
            KernelShape::Gaussian => Kernel::Gaussian { sigma: 0.4 },
            KernelShape::Ellipse => Kernel::Ellipse { a: 6.0, n: 3.0, smooth: true },
            KernelShape::Cone => Kernel::Cone { power: 1.5 },
            KernelShape::Constant => Kernel::Constant,
        };
        assert_eq!(kernel.shape(), needs.kernel);
        let facing = needs.facing.map(|shape| Facing { shape, pixels: Facing::LIMITS });
        let outline = needs.outline.then(|| Outline::of_sides(5).unwrap());
        let options = Settings { kernel, facing, outline, ..Settings::default() };
        let constants = passes::constants(&Making { needs, options: &options, surfels: 1000 });
        assert!(constants.iter().all(|(_, value)| value.is_finite()));
        let set: BTreeSet<String> = constants.into_iter().map(|(name, _)| name.to_owned()).collect();
        for (_, declared) in module.overrides.iter() {
            let name = declared.name.clone().unwrap();
            assert!(declared.id.is_none(), "{name} is set by name");
            assert!(declared.init.is_some() || set.contains(&name), "nobody sets {name}");
            declared_anywhere.insert(name);
        }
        set_anywhere.extend(set);
    }
    assert_eq!(declared_anywhere, set_anywhere);
}

#[test]
fn storage_buffers_stay_within_core_limits() {
    let mut most = 0;
    for made in modules::all() {
        let Reflected { module, bindings } = made.reflected();
        let stored: BTreeSet<&str> = module
            .global_variables
            .iter()
            .filter(|(_, v)| matches!(v.space, AddressSpace::Storage { .. }))
            .filter_map(|(_, v)| v.name.as_deref())
            .collect();
        let dispatched = |stage: &str| {
            made.needs.surface.raster().is_some() || made.kernels.iter().any(|kernel| kernel.name == stage)
        };
        for (stage, variables) in bindings.iter().filter(|(stage, _)| dispatched(stage)) {
            let count = variables.iter().filter(|(name, _)| stored.contains(name.as_str())).count();
            assert!(count <= CORE_STORAGE_BUFFERS, "{stage} of {:?} uses {count}", made.needs.names());
            most = most.max(count);
        }
    }
    assert_eq!(most, STORAGE_BUFFERS as usize, "buffers of the largest kernel, and those requested from adapters");
}

#[test]
fn the_channels_of_a_pixel_do_not_overlap() {
    for needs in common::variants::all_needs() {
        let pixel = PixelLayout::of(needs);
        let ranges = |all: &[(u32, u32)]| all.iter().flat_map(|(first, count)| *first..first + count).collect();
        let of = |needed: bool, count: u32| if needed { count } else { 0 };
        let sums: Vec<u32> = ranges(&[
            (0, 1),
            (COLOR_CHANNEL, color_channels(needs)),
            (pixel.normal_channel, of(needs.normal, 3)),
            (pixel.depth_channel, of(needs.sums_depth(), 1)),
            (pixel.middles_channel, of(needs.compares_depth(), 1)),
            (pixel.count_channel, of(needs.maps.has(Map::Count), 1)),
            (pixel.held_back_channel, of(needs.surface.oit().is_some(), 1)),
            (pixel.place_channel, of(needs.color == ColorNeed::Textured, 5)),
        ]);
        let maps = MAPS.iter().zip(pixel.map_words).filter(|(row, _)| needs.maps.has(row.map));
        let maps = maps.map(|(row, word)| (word, row.map.width() as u32));
        let image: Vec<u32> = ranges(&[(0, 4)].into_iter().chain(maps).collect::<Vec<_>>());
        for (places, room) in [(&sums, pixel.channels), (&image, pixel.image_words)] {
            assert!(places.iter().all(|place| *place < room), "{places:?} of {room}, {:?}", needs.names());
            assert_eq!(places.iter().collect::<BTreeSet<_>>().len(), places.len(), "{:?}", needs.names());
        }
        // Padding: at most one channel completes the last pair, and at most two align the starts of
        // pairs.
        assert!(pixel.channels as usize <= sums.len() + 3 && pixel.image_words as usize == image.len());
        // Values that are added in pairs start at an even channel; the second pair of the colour
        // starts at 2.
        let pairs = [pixel.channels, pixel.normal_channel, pixel.place_channel].map(|channel| channel % 2);
        assert_eq!((pairs, COLOR_CHANNEL), ([0; 3], 1));
    }
}

/// Returns the signature `fn name(parameters) -> result` of each function of a file, by name.
fn signatures(text: &str) -> BTreeMap<String, String> {
    let code: String = text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join(" ");
    let mut found = BTreeMap::new();
    for part in code.split("fn ").skip(1) {
        let signature = part.split('{').next().unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
        let signature = signature.replace("( ", "(").replace(", )", ")");
        found.insert(signature.split('(').next().unwrap().to_owned(), signature);
    }
    found
}

fn text_of(name: &str) -> &'static str {
    FILES.iter().find(|(file, _)| *file == name).unwrap_or_else(|| panic!("no {name}")).1
}

/// A file `*_absent.wgsl` has the interface of its partner: each of its functions exists there with
/// the same signature.
///
/// Each combination of files is valid, so no function of the partner is missing either.
#[test]
fn absent_parts_have_their_partners_signatures() {
    let absent: Vec<&str> = FILES.iter().map(|(name, _)| *name).filter(|name| name.ends_with("_absent.wgsl")).collect();
    assert!(absent.len() >= 5);
    let mut pairs: Vec<(&str, Vec<String>)> =
        absent.into_iter().map(|name| (name, vec![name.replace("_absent", "")])).collect();
    let normals = pairs.iter_mut().filter(|(name, _)| *name == "normal_absent.wgsl");
    normals.for_each(|(_, partners)| partners.push("normal_flat.wgsl".into()));
    for (_, partners) in pairs.iter_mut().filter(|(name, _)| *name == "oit_absent.wgsl") {
        partners.push("oit_weighted.wgsl".into());
    }
    for name in ["flat.wgsl", "normal_flat.wgsl", "tile_flat.wgsl", "hand_flat.wgsl"] {
        pairs.push((name, vec![name.replace("flat", "curved")]));
    }
    pairs.push(("color_constant.wgsl", vec!["color_srgb8.wgsl".into(), "color_sums.wgsl".into()]));
    pairs.push(("color_constant.wgsl", vec!["color_linear.wgsl".into(), "color_sums.wgsl".into()]));
    pairs.push(("color_constant.wgsl", vec!["color_textured.wgsl".into(), "color_sums.wgsl".into()]));
    pairs.push(("shade_unlit.wgsl", vec!["shade_lambert.wgsl".into()]));
    pairs.push(("shade_unlit.wgsl", vec!["shade_phong.wgsl".into()]));
    for (name, partners) in pairs {
        let partner: BTreeMap<_, _> = partners.iter().flat_map(|partner| signatures(text_of(partner))).collect();
        let own = signatures(text_of(name));
        assert!(!own.is_empty(), "{name}");
        for (function, signature) in own {
            assert_eq!(partner.get(&function), Some(&signature), "{name} and {partners:?}");
        }
    }
    // Interchangeable files share these functions; other functions may exist in one file only.
    let starting = |prefix: &str| FILES.iter().map(|(name, _)| *name).filter(|name| name.starts_with(prefix)).collect();
    let alike_in = |prefix: &str, all: Vec<&str>, functions: &[&str]| {
        assert!(all.len() >= 2, "{prefix}");
        for function in functions {
            let first = signatures(text_of(all[0])).remove(*function);
            assert!(first.is_some(), "{} has no {function}", all[0]);
            for name in &all {
                assert_eq!(signatures(text_of(name)).get(*function), first.as_ref(), "{name}");
            }
        }
    };
    let alike = |prefix: &str, functions: &[&str]| alike_in(prefix, starting(prefix), functions);
    alike("accumulator_", &["show", "sum_at", "weight_at"]);
    let in_words = ["accumulator_fixed.wgsl", "accumulator_fixed_pairs.wgsl"];
    alike_in(
        "accumulator_fixed",
        in_words.to_vec(),
        &["add_stored", "add_pair_stored", "settle_stored", "deposit_stored"],
    );
    let with_sums = [starting("accumulator_"), starting("sums_")].concat();
    let with_sums = with_sums.into_iter().filter(|name| !in_words.contains(name));
    alike_in("sums_", with_sums.collect(), &["add", "add_pair", "settle"]);
    let apart = [
        "accumulator_fixed.wgsl",
        "accumulator_fixed64.wgsl",
        "accumulator_fixed_pairs.wgsl",
        "accumulator_fixed_wide.wgsl",
    ];
    let with_terms =
        [starting("accumulator_"), starting("terms")].concat().into_iter().filter(|name| !apart.contains(name));
    alike_in("terms", with_terms.collect(), &["quantise", "term"]);
    alike("words", &["words", "each_word", "surfel_at", "surfels_held"]);
    alike("image_", &["write_color"]);
    alike("tile_deposit", &["deposit_sums"]);
    alike("splat_", &["hold_lane", "fetcher", "offered", "farthest_in_tile", "handed"]);
    alike("tile_filter", &["filter_misses"]);
    alike("hand_filter", &["handed_filter"]);
    alike("tile_small", &["small_list", "small_entry"]);
    alike("kernel_", &["kernel_weight"]);
    alike("nearest_", &["keep_nearest", "mark_of", "nearest_at"]);
    alike_in("winner_", vec!["winner_constant.wgsl", "winner_color.wgsl"], &["resolve_color"]);
    alike_in("winners", vec!["winner_second.wgsl", "nearest_color.wgsl"], &["winning_word"]);
    let oit = ["oit_absent.wgsl", "oit_weighted.wgsl", "oit_moments.wgsl"];
    alike_in("oit", oit.to_vec(), &["weight_before"]);
    alike("epsilon", &["radius_of", "deepest_accepted", "farthest_accepted"]);
    let shared = ["homography", "intersect", "ray", "seen_at"];
    let orthographic = signatures(text_of("camera_orthographic.wgsl"));
    for camera in ["camera_pinhole.wgsl", "camera_lens.wgsl"] {
        let mut own = signatures(text_of("perspective.wgsl"));
        own.extend(signatures(text_of(camera)));
        for function in shared {
            assert!(own.contains_key(function), "{camera}");
            assert_eq!(own.get(function), orthographic.get(function), "{camera}");
        }
    }
    alike("lens_", &["see_plane", "plane_ray"]);
    alike("frame_", &["frame_of", "frame_rows", "frame_normal", "frame_holds_center"]);
}

/// The names in a kernel's code, in order, without comments.
fn names(text: &str) -> Vec<&str> {
    let code = text.lines().map(|line| line.split("//").next().unwrap_or(""));
    let part = |c: char| !c.is_alphanumeric() && c != '_';
    code.flat_map(|line| line.split(part).filter(|name| !name.is_empty())).collect()
}

/// The compute entry points of a kernel's text, each with the first name in its body.
fn beginnings(text: &str) -> Vec<(&str, &str)> {
    let of_entry = |part| -> (&str, &str) {
        let (head, body) = str::split_once(part, "{\n").unwrap();
        (head.split("fn ").nth(1).unwrap().split('(').next().unwrap(), names(body)[0])
    };
    text.split("@compute").skip(1).map(of_entry).collect()
}

/// Only `hold` and `hold_view` read uniforms. Entry points that use uniforms call one of them
/// first, while all invocations still take part.
#[test]
fn uniforms_are_read_once_and_first() {
    for (file, text) in FILES {
        let read = names(text).into_iter().filter(|name| ["view", "band"].contains(name)).count();
        // `layout.wgsl` declares both uniforms and reads each once.
        assert_eq!(read, if *file == "layout.wgsl" { 4 } else { 0 }, "{file}");
        for (entry, first) in beginnings(text) {
            let arranges = entry == "arrange_triangles";
            let without = arranges
                || ALONE.contains(file)
                || (*file == "select.wgsl" && !["select_top", "select_judge", "select_spread"].contains(&entry));
            assert_eq!(["hold", "hold_view"].contains(&first), !without, "{entry} in {file} begins with {first}");
        }
    }
    modules::different().par_iter().for_each(|made| {
        let module = &made.reflected().module;
        let info = Validator::new(ValidationFlags::all(), Capabilities::all()).validate(module).unwrap();
        for (index, entry) in module.entry_points.iter().enumerate() {
            let uses = |name: &str| {
                let mut all = module.global_variables.iter();
                all.any(|(handle, v)| {
                    v.name.as_deref() == Some(name) && !info.get_entry_point(index)[handle].is_empty()
                })
            };
            assert_eq!(uses("held"), uses("view"), "{}", entry.name);
            assert!(!uses("held_band") || uses("band"), "{}", entry.name);
        }
    });
}

//! WGSL states the layout, Rust mirrors it, this decides: name, offset, size and scalar kind of every member of every
//! struct that a binding of any reachable module can see, and the constants that both sides hold.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::mem::{offset_of, size_of};

use common::modules;
use epsplat::gpu::Sources;
use epsplat::gpu::kernel::{FILES, reflect};
use epsplat::gpu::layout::{
    AWAY, BATCH, BLOCK_SIDE, Band, COVERED_GRID, COVERED_GRID_OF_EIGHTS, COVERED_LIST, Filter, LIST_ENDS, LIST_START,
    MOST_GROUPS, OCCLUSION_TILE, ONE, ONE_WIDE, QUEUE_GRID, QUEUE_LISTING, QUEUE_START, Splat, TILE, TILE_WIDTH, View,
    WORKGROUP,
};
use epsplat::passes::accumulate::accumulator;
use epsplat::passes::variant::{self, COLOR_CHANNEL, PixelLayout, color_channels};
use epsplat::scene::camera::MAX_SIDE;
use epsplat::scene::options::{LEAST_FILTERED_WEIGHT, LEAST_WEIGHT};
use epsplat::scene::{SceneNeeds, Surfel};
use naga::{AddressSpace, ArraySize, Expression, Literal, Module, ScalarKind, TypeInner};

/// A type as host and device can compare it: so many scalars of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shape {
    kind: ScalarKind,
    /// Bytes of a scalar.
    width: usize,
    scalars: usize,
}

impl Shape {
    fn bytes(&self) -> usize {
        self.width * self.scalars
    }
}

trait Shaped {
    const SHAPE: Shape;
}

macro_rules! scalar {
    ($($ty:ty => $kind:ident),*) => {
        $(impl Shaped for $ty { const SHAPE: Shape = Shape { kind: ScalarKind::$kind, width: size_of::<$ty>(), scalars: 1 }; })*
    };
}
scalar!(f32 => Float, u32 => Uint, i32 => Sint, u64 => Uint);

impl<T: Shaped, const N: usize> Shaped for [T; N] {
    const SHAPE: Shape = Shape { scalars: T::SHAPE.scalars * N, ..T::SHAPE };
}

#[derive(Clone, Debug, PartialEq)]
struct Member {
    name: String,
    offset: usize,
    shape: Shape,
}

#[derive(Clone, Debug, PartialEq)]
struct Struct {
    size: usize,
    members: Vec<Member>,
}

macro_rules! mirror {
    ($ty:ident { $($field:ident),* $(,)? }) => {{
        fn shape<F: Shaped>(_: fn(&$ty) -> &F) -> Shape {
            F::SHAPE
        }
        // A field that is not listed does not compile.
        let _complete = |value: $ty| { let $ty { $($field: _),* } = value; };
        let members = vec![$(Member {
            name: stringify!($field).to_owned(),
            offset: offset_of!($ty, $field),
            shape: shape(|value: &$ty| &value.$field),
        }),*];
        (stringify!($ty), Struct { size: size_of::<$ty>(), members })
    }};
}

fn mirrors() -> BTreeMap<&'static str, Struct> {
    BTreeMap::from([
        mirror!(View {
            rotation,
            rotation_low,
            eye,
            eye_low,
            intrinsics,
            intrinsics_low,
            color_low,
            color_span,
            color_scale,
            background,
            lights,
            width,
            height,
            zero,
            unit,
            near,
            epsilon_relative,
            epsilon_absolute,
            world,
            epsilon_radius,
            epsilon_deepest,
            farthest,
            middle,
            texture_width,
            texture_height,
            padding_0,
            padding_1,
            place,
        }),
        mirror!(Band { first_row, rows, padding_0, padding_1 }),
        mirror!(Splat { anchor_x, anchor_y, bounds_first, bounds_last, a, b, c, a_low }),
        mirror!(Surfel { center, s, t }),
        mirror!(Filter { center_x, center_y, depth_low, depth_high, r_xx, r_xy, r_yy, gain }),
    ])
}

/// What a binding's elements are on the host.
enum Element {
    Struct(&'static str),
    /// A struct, or words of which the kernels make it.
    Words(&'static str),
    Plain(&'static [Shape]),
}

/// What an accumulator keeps a sum in, and how many of them (twice, as packed ones hold two sums).
fn sums_of(accumulator: &str) -> (&'static [Shape], u32) {
    match accumulator {
        "fixed" => (&[u32::SHAPE], 4),
        "fixed32" | "cas" => (&[u32::SHAPE], 2),
        "fixed64" => (&[u64::SHAPE], 2),
        "packed64" => (&[u64::SHAPE], 1),
        "float" => (&[f32::SHAPE], 2),
        other => panic!("this test does not know the accumulator {other}"),
    }
}

fn elements(accumulator: &str) -> BTreeMap<&'static str, Element> {
    const WORD: &[Shape] = &[u32::SHAPE];
    BTreeMap::from([
        ("view", Element::Struct("View")),
        ("band", Element::Struct("Band")),
        // By words that an adapter reads well, or two words of any surfel.
        ("surfels", Element::Words("Surfel")),
        ("splats", Element::Words("Splat")),
        ("projected", Element::Words("Splat")),
        ("filters", Element::Words("Filter")),
        ("projected_filters", Element::Words("Filter")),
        ("queue", Element::Plain(WORD)),
        ("queued", Element::Plain(WORD)),
        ("rare", Element::Plain(WORD)),
        ("listed", Element::Plain(WORD)),
        ("balls", Element::Plain(&[<[f32; 4]>::SHAPE])),
        ("surviving", Element::Plain(WORD)),
        ("drawn", Element::Plain(WORD)),
        ("lists", Element::Plain(WORD)),
        ("large_lists", Element::Plain(WORD)),
        ("small_lists", Element::Plain(WORD)),
        ("nearest", Element::Plain(WORD)),
        ("visible", Element::Plain(WORD)),
        ("sums", Element::Plain(sums_of(accumulator).0)),
        ("added", Element::Plain(&[<[u64; 2]>::SHAPE])),
        ("overflows", Element::Plain(WORD)),
        ("image", Element::Plain(&[f32::SHAPE])),
        ("colors", Element::Plain(&[u32::SHAPE, <[u32; 4]>::SHAPE, <[u64; 2]>::SHAPE])),
        ("texels", Element::Plain(WORD)),
        ("srgb_to_linear", Element::Plain(&[<[f32; 256]>::SHAPE])),
    ])
}

/// The shape of a type without structs; an error for what must not be shared.
fn shape(module: &Module, ty: naga::Handle<naga::Type>) -> Result<Shape, String> {
    let one = |scalar: naga::Scalar| match scalar.width {
        width @ (4 | 8) => Ok(Shape { kind: scalar.kind, width: width.into(), scalars: 1 }),
        width => Err(format!("a scalar of {width} bytes")),
    };
    match module.types[ty].inner {
        TypeInner::Scalar(scalar) | TypeInner::Atomic(scalar) => one(scalar),
        TypeInner::Vector { size: naga::VectorSize::Tri, .. } => {
            Err("a vec3, whose alignment no Pod struct has".into())
        }
        TypeInner::Vector { size, scalar } => Ok(Shape { scalars: size as usize, ..one(scalar)? }),
        TypeInner::Matrix { .. } => Err("a matrix".into()),
        TypeInner::Array { base, size: ArraySize::Constant(count), stride } => {
            let element = shape(module, base)?;
            if stride as usize != element.bytes() {
                return Err(format!("an array with gaps: stride {stride} for {} scalars", element.scalars));
            }
            Ok(Shape { scalars: element.scalars * count.get() as usize, ..element })
        }
        ref other => Err(format!("a type that is not shared: {other:?}")),
    }
}

/// The accumulator whose sums are kept alike: 64-bit atomics keep those of `fixed` as `fixed64` does.
fn kept_as(needs: &SceneNeeds) -> &'static str {
    if needs.atomics_u64 { "fixed64" } else { needs.accumulator }
}

/// Differences between a module's bindings and the host's mirrors, in words.
fn differences(module: &Module, accumulator: &str) -> Vec<String> {
    let (mirrors, elements) = (mirrors(), elements(accumulator));
    let mut found = Vec::new();
    let bound = |space| matches!(space, AddressSpace::Uniform | AddressSpace::Storage { .. });
    for (_, variable) in module.global_variables.iter().filter(|(_, v)| bound(v.space)) {
        let name = variable.name.as_deref().unwrap_or("?");
        let ty = match module.types[variable.ty].inner {
            TypeInner::Array { base, size: ArraySize::Dynamic, .. } => base,
            _ => variable.ty,
        };
        let Some(element) = elements.get(name) else {
            found.push(format!("the host has no buffer {name}"));
            continue;
        };
        match (&module.types[ty].inner, element) {
            (TypeInner::Struct { members, span }, Element::Struct(expected) | Element::Words(expected)) => {
                let device_name = module.types[ty].name.as_deref().unwrap_or("?");
                if device_name != *expected {
                    found.push(format!("{name} holds {device_name}, on the host {expected}"));
                    continue;
                }
                compare(module, device_name, members, *span as usize, &mirrors[expected], &mut found);
                if let TypeInner::Array { stride, .. } = module.types[variable.ty].inner
                    && stride as usize != mirrors[expected].size
                {
                    found.push(format!("{name} has a stride of {stride}, on the host {}", mirrors[expected].size));
                }
            }
            (TypeInner::Struct { .. }, Element::Plain(_)) => found.push(format!("{name} holds a struct")),
            (_, Element::Struct(expected)) => found.push(format!("{name} does not hold {expected}")),
            (_, Element::Words(expected)) => {
                let of_name = |(_, ty): &(_, &naga::Type)| ty.name.as_deref() == Some(*expected);
                match module.types.iter().find(of_name).map(|(_, ty)| &ty.inner) {
                    Some(TypeInner::Struct { members, span }) => {
                        compare(module, expected, members, *span as usize, &mirrors[expected], &mut found);
                    }
                    _ => found.push(format!("{name}: there is no {expected}")),
                }
                match shape(module, ty) {
                    Ok(Shape { kind: ScalarKind::Uint, scalars: 1, .. }) if *expected == "Surfel" => {}
                    Ok(device) if device.kind == ScalarKind::Uint && device.bytes() == mirrors[expected].size => {}
                    other => found.push(format!("{name} holds {other:?}, on the host {expected}")),
                }
            }
            (_, Element::Plain(expected)) => match shape(module, ty) {
                Ok(device) if expected.contains(&device) => {}
                Ok(device) => found.push(format!("{name} holds {device:?}, on the host {expected:?}")),
                Err(what) => found.push(format!("{name} holds {what}")),
            },
        }
    }
    found
}

fn compare(
    module: &Module,
    name: &str,
    members: &[naga::StructMember],
    span: usize,
    mirror: &Struct,
    found: &mut Vec<String>,
) {
    let mut device = Vec::new();
    for member in members {
        let member_name = member.name.clone().unwrap_or_default();
        match shape(module, member.ty) {
            Ok(shape) => device.push(Member { name: member_name, offset: member.offset as usize, shape }),
            Err(what) => found.push(format!("{name}.{member_name} is {what}")),
        }
    }
    let partners = |from: &[Member], to: &[Member], side: &str, found: &mut Vec<String>| {
        for member in from {
            match to.iter().find(|other| other.name == member.name) {
                None => found.push(format!("{name}.{} exists {side} only", member.name)),
                Some(other) if other != member => {
                    found.push(format!("{name}: {member:?} and {other:?} ({side} first)"))
                }
                Some(_) => {}
            }
        }
    };
    partners(&device, &mirror.members, "in WGSL", found);
    partners(&mirror.members, &device, "in Rust", found);
    if span != mirror.size {
        found.push(format!("{name} spans {span} bytes in WGSL, {} in Rust", mirror.size));
    }
}

/// The first module of `needs`.
fn first_of(sources: &Sources, needs: &SceneNeeds) -> Module {
    reflect(&sources.join(&variant::modules(needs)[0].0)).unwrap().0
}

#[test]
fn mirrors_have_no_gaps() {
    for (name, mirror) in mirrors() {
        let mut next = 0;
        for member in &mirror.members {
            assert_eq!(member.offset, next, "{name}.{}", member.name);
            next += member.shape.bytes();
        }
        assert_eq!(next, mirror.size, "{name}");
    }
}

#[test]
fn every_binding_has_the_hosts_layout() {
    let mut seen = BTreeSet::new();
    for made in modules::different() {
        let (module, needs) = (&made.reflected().module, &made.needs);
        assert_eq!(
            differences(module, if made.of_tiles() { "fixed" } else { kept_as(needs) }),
            Vec::<String>::new(),
            "{}",
            needs.accumulator
        );
        let buffers = module.global_variables.iter().filter(|(_, v)| v.space != AddressSpace::Handle);
        seen.extend(buffers.filter_map(|(_, v)| v.binding.and(v.name.clone())));
    }
    let known: BTreeSet<String> = elements("fixed").keys().map(|name| (*name).to_owned()).collect();
    assert_eq!(seen, known, "buffers in WGSL, and those the host knows");
}

#[test]
fn a_changed_layout_is_noticed() {
    // So that no kernel uses `middle`, and the module stays valid.
    let needs = common::all_needs().into_iter().find(|needs| !needs.cull).unwrap();
    let broken = |from: &str, to: &str| {
        let sources = Sources::default().replace("layout.wgsl", from, to).unwrap();
        differences(&first_of(&sources, &needs), needs.accumulator).join("; ")
    };
    let swapped =
        broken("    a: array<f32, 3>,\n    b: array<f32, 3>,\n", "    b: array<f32, 3>,\n    a: array<f32, 3>,\n");
    assert!(swapped.contains("Splat") && swapped.contains("\"a\""), "{swapped}");
    let renamed = broken("    middle: f32,\n", "    center: f32,\n");
    assert!(renamed.contains("View.center exists in WGSL only"), "{renamed}");
    assert!(renamed.contains("View.middle exists in Rust only"), "{renamed}");
    let exchanged = broken(
        "    farthest: f32,\n    // Depth of the middle of the scene's bounds, device units.\n    middle: f32,\n",
        "    middle: f32,\n    farthest: f32,\n",
    );
    assert!(exchanged.contains("\"farthest\"") && exchanged.contains("\"middle\""), "{exchanged}");
    let cut = Sources::default().replace("records.wgsl", "array<Words, 4>", "array<Words, 5>").unwrap();
    let cut = cut.replace("records.wgsl", "splat.a_low[2]))),", "splat.a_low[2]))), words(vec4<u32>()),").unwrap();
    let cut = differences(&first_of(&cut, &needs), needs.accumulator).join("; ");
    assert!(cut.contains("projected holds") && cut.contains("splats holds"), "{cut}");
    let longer = broken("    rows: u32,\n    padding_0: u32,\n", "    rows: u32,\n    padding_0: vec2<u32>,\n");
    assert!(longer.contains("Band"), "{longer}");
    let retyped = broken("    middle: f32,\n", "    middle: u32,\n");
    assert!(retyped.contains("middle") && retyped.contains("Uint"), "{retyped}");
    // Sums of another kind than the accumulator's.
    let wide = SceneNeeds { accumulator: "fixed64", ..needs };
    let other = &first_of(&Sources::default(), &wide);
    assert_eq!(differences(other, "packed64"), Vec::<String>::new());
    for name in ["fixed", "float"] {
        let sums = differences(other, name).join("; ");
        assert!(sums.contains("sums holds"), "{sums}");
    }
}

#[test]
fn binding_numbers_are_unique_over_all_files() {
    let mut numbers: BTreeMap<u32, BTreeSet<String>> = BTreeMap::new();
    let mut names: BTreeMap<String, BTreeSet<u32>> = BTreeMap::new();
    for made in modules::different() {
        for (_, variable) in made.reflected().module.global_variables.iter() {
            if let (Some(binding), Some(name)) = (&variable.binding, &variable.name) {
                assert_eq!(binding.group, 0, "{name}");
                numbers.entry(binding.binding).or_default().insert(name.clone());
                names.entry(name.clone()).or_default().insert(binding.binding);
            }
        }
    }
    assert!(numbers.len() >= 14);
    assert!(numbers.values().all(|names| names.len() == 1), "{numbers:?}");
    assert!(names.values().all(|numbers| numbers.len() == 1), "{names:?}");
}

fn constant(module: &Module, name: &str) -> Option<f64> {
    let (_, constant) = module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name))?;
    match module.global_expressions[constant.init] {
        Expression::Literal(Literal::U32(value)) => Some(f64::from(value)),
        Expression::Literal(Literal::F32(value)) => Some(f64::from(value)),
        ref other => panic!("{name} is {other:?}"),
    }
}

#[test]
fn constants_agree() {
    for made in modules::different() {
        let (module, needs, tiles) = (&made.reflected().module, made.needs, made.of_tiles());
        let constant = |name| constant(module, name);
        for (name, value) in [
            ("WORKGROUP", WORKGROUP),
            ("TILE", TILE),
            ("QUEUE_START", QUEUE_START),
            ("QUEUE_GRID", QUEUE_GRID),
            ("QUEUE_LISTING", QUEUE_LISTING),
            ("TILE_WIDTH", TILE_WIDTH),
            ("COVERED_LIST", COVERED_LIST),
            ("COVERED_GRID", COVERED_GRID),
            ("COVERED_GRID_OF_EIGHTS", COVERED_GRID_OF_EIGHTS),
            ("MOST_GROUPS", MOST_GROUPS),
            ("AWAY", AWAY),
            ("NOTHING", f32::INFINITY.to_bits()),
            ("WEIGHT_CHANNEL", 0),
        ] {
            assert_eq!(constant(name), Some(f64::from(value)), "{name}");
        }
        let tile = needs.raster.is_none().then_some(f64::from(OCCLUSION_TILE));
        assert_eq!(constant("OCCLUSION_TILE"), tile);
        let of_tiles = [("BLOCK_SIDE", BLOCK_SIDE), ("LIST_ENDS", LIST_ENDS)];
        let of_batches = [("BATCH", BATCH), ("LIST_START", LIST_START)];
        for (exists, constants) in [(tiles, &of_tiles[..]), (needs.cull, &of_batches)] {
            for &(name, value) in constants {
                assert_eq!(constant(name), exists.then_some(f64::from(value)), "{name}");
            }
        }
        assert_eq!(constant("LEAST_WEIGHT"), Some(LEAST_WEIGHT));
        assert_eq!(constant("LEAST_FILTERED_WEIGHT"), Some(LEAST_FILTERED_WEIGHT));
        let colors = color_channels(&needs) > 0;
        assert_eq!(constant("COLOR_CHANNEL"), colors.then_some(f64::from(COLOR_CHANNEL)));
        let one = match needs.accumulator {
            _ if needs.raster.is_some() => None,
            "fixed" if !needs.wide_sums => Some(f64::from(ONE)),
            "fixed" | "fixed64" => Some(ONE_WIDE as f64),
            _ => None,
        };
        assert_eq!(constant("ONE"), one, "{}", needs.accumulator);
        for entry in module.entry_points.iter().filter(|entry| entry.stage == naga::ShaderStage::Compute) {
            let size = match entry.name.as_str() {
                "arrange" | "arrange_rare" | "arrange_covered" => [1, 1, 1],
                "bin_count_large" | "bin_place_large" => [8, 8, 1],
                "bin_scan" | "bin_scan_large" => [256, 1, 1],
                name if name.ends_with("_large") => [TILE, TILE, 1],
                _ => [WORKGROUP, 1, 1],
            };
            assert_eq!(entry.workgroup_size, size, "{}", entry.name);
        }
    }
    // The least weight is a whole number of units, and the bits that follow from it are kept.
    assert_eq!((f64::from(ONE) * LEAST_WEIGHT).fract(), 0.0);
    // A pixel's row fits beside the flag, its column below the row.
    assert_eq!((MAX_SIDE - 1) << 16 & AWAY, 0);
    const { assert!(MAX_SIDE - 1 <= 0xffff) };
    // The scale is stated once: no kernel repeats it as a number.
    let repeated = FILES.iter().map(|(_, text)| text.matches(&ONE.to_string()).count()).sum::<usize>();
    assert_eq!(repeated, 1);
}

#[test]
fn the_hosts_room_for_a_pixels_sums_is_the_devices() {
    for needs in common::all_needs() {
        let (channels, row) = (PixelLayout::of(&needs).channels, accumulator(needs.accumulator).unwrap());
        let (shapes, halves) = sums_of(row.name);
        let bytes = channels as usize * halves as usize * shapes[0].bytes() / 2;
        assert_eq!(bytes, 4 * (channels * row.words) as usize, "{}", row.name);
    }
}

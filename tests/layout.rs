//! WGSL states the layout, Rust mirrors it, this decides: name, offset, size and scalar kind of every member of every
//! struct that a binding of any reachable module can see, and the constants that both sides hold.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::mem::{offset_of, size_of};

use epsplat::gpu::Sources;
use epsplat::gpu::kernel::{FILES, reflect};
use epsplat::gpu::layout::{AWAY, Band, ONE, SUM_WORDS, Splat, View, WORKGROUP};
use epsplat::scene::Surfel;
use epsplat::scene::camera::MAX_SIDE;
use naga::{AddressSpace, ArraySize, Expression, Literal, Module, ScalarKind, TypeInner};

/// A type as host and device can compare it: so many scalars of four bytes of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shape {
    kind: ScalarKind,
    scalars: usize,
}

trait Shaped {
    const SHAPE: Shape;
}

macro_rules! scalar {
    ($($ty:ty => $kind:ident),*) => {
        $(impl Shaped for $ty { const SHAPE: Shape = Shape { kind: ScalarKind::$kind, scalars: 1 }; })*
    };
}
scalar!(f32 => Float, u32 => Uint, i32 => Sint);

impl<T: Shaped, const N: usize> Shaped for [T; N] {
    const SHAPE: Shape = Shape { kind: T::SHAPE.kind, scalars: T::SHAPE.scalars * N };
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
            light_count,
            width,
            height,
            zero,
            unit,
            near,
            epsilon_relative,
            epsilon_absolute,
            world,
            padding_0,
            padding_1,
            padding_2,
        }),
        mirror!(Band { first_row, rows, padding_0, padding_1 }),
        mirror!(Splat { anchor_x, anchor_y, bounds_first, bounds_last, a, b, c, a_low }),
        mirror!(Surfel { center, s, t }),
    ])
}

/// What a binding's elements are on the host.
enum Element {
    Struct(&'static str),
    Plain(&'static [Shape]),
}

fn elements() -> BTreeMap<&'static str, Element> {
    const WORD: &[Shape] = &[u32::SHAPE];
    BTreeMap::from([
        ("view", Element::Struct("View")),
        ("band", Element::Struct("Band")),
        ("surfels", Element::Struct("Surfel")),
        ("splats", Element::Struct("Splat")),
        ("projected", Element::Struct("Splat")),
        ("drawn", Element::Plain(WORD)),
        ("nearest", Element::Plain(WORD)),
        ("visible", Element::Plain(WORD)),
        ("sums", Element::Plain(WORD)),
        ("image", Element::Plain(&[f32::SHAPE])),
        ("colors", Element::Plain(&[u32::SHAPE, <[f32; 4]>::SHAPE])),
        ("srgb_to_linear", Element::Plain(&[f32::SHAPE])),
    ])
}

/// The shape of a type without structs; an error for what must not be shared.
fn shape(module: &Module, ty: naga::Handle<naga::Type>) -> Result<Shape, String> {
    let one = |scalar: naga::Scalar| match scalar.width {
        4 => Ok(Shape { kind: scalar.kind, scalars: 1 }),
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
            if stride as usize != element.scalars * 4 {
                return Err(format!("an array with gaps: stride {stride} for {} scalars", element.scalars));
            }
            Ok(Shape { scalars: element.scalars * count.get() as usize, ..element })
        }
        ref other => Err(format!("a type that is not shared: {other:?}")),
    }
}

/// Differences between a module's bindings and the host's mirrors, in words.
fn differences(module: &Module) -> Vec<String> {
    let (mirrors, elements) = (mirrors(), elements());
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
            (TypeInner::Struct { members, span }, Element::Struct(expected)) => {
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

/// The different modules of all needs.
fn modules(sources: &Sources) -> Vec<Module> {
    let texts: BTreeSet<String> = common::all_needs().iter().map(|needs| sources.join(needs)).collect();
    texts.iter().map(|text| reflect(text).unwrap_or_else(|e| panic!("{e}")).0).collect()
}

#[test]
fn mirrors_have_no_gaps() {
    for (name, mirror) in mirrors() {
        let mut next = 0;
        for member in &mirror.members {
            assert_eq!(member.offset, next, "{name}.{}", member.name);
            next += member.shape.scalars * 4;
        }
        assert_eq!(next, mirror.size, "{name}");
    }
}

#[test]
fn every_binding_has_the_hosts_layout() {
    let mut seen = BTreeSet::new();
    for module in modules(&Sources::default()) {
        assert_eq!(differences(&module), Vec::<String>::new());
        seen.extend(module.global_variables.iter().filter_map(|(_, v)| v.binding.and(v.name.clone())));
    }
    let known: BTreeSet<String> = elements().keys().map(|name| (*name).to_owned()).collect();
    assert_eq!(seen, known, "buffers in WGSL, and those the host knows");
}

#[test]
fn a_changed_layout_is_noticed() {
    let needs = common::all_needs()[0];
    let broken = |from: &str, to: &str| {
        let sources = Sources::default().replace("layout.wgsl", from, to).unwrap();
        differences(&reflect(&sources.join(&needs)).unwrap().0).join("; ")
    };
    let swapped =
        broken("    a: array<f32, 3>,\n    b: array<f32, 3>,\n", "    b: array<f32, 3>,\n    a: array<f32, 3>,\n");
    assert!(swapped.contains("Splat") && swapped.contains("\"a\""), "{swapped}");
    // A field that no kernel uses, so that the module stays valid.
    let renamed = broken("    padding_2: u32,\n}\n\n// The rows", "    padding_x: u32,\n}\n\n// The rows");
    assert!(renamed.contains("View.padding_x exists in WGSL only"), "{renamed}");
    assert!(renamed.contains("View.padding_2 exists in Rust only"), "{renamed}");
    let longer = broken("    rows: u32,\n    padding_0: u32,\n", "    rows: u32,\n    padding_0: vec2<u32>,\n");
    assert!(longer.contains("Band"), "{longer}");
    let retyped = broken("    padding_1: u32,\n    padding_2", "    padding_1: f32,\n    padding_2");
    assert!(retyped.contains("padding_1") && retyped.contains("Float"), "{retyped}");
}

#[test]
fn binding_numbers_are_unique_over_all_files() {
    let mut numbers: BTreeMap<u32, BTreeSet<String>> = BTreeMap::new();
    let mut names: BTreeMap<String, BTreeSet<u32>> = BTreeMap::new();
    for module in modules(&Sources::default()) {
        for (_, variable) in module.global_variables.iter() {
            if let (Some(binding), Some(name)) = (&variable.binding, &variable.name) {
                assert_eq!(binding.group, 0, "{name}");
                numbers.entry(binding.binding).or_default().insert(name.clone());
                names.entry(name.clone()).or_default().insert(binding.binding);
            }
        }
    }
    assert!(numbers.len() >= 10);
    assert!(numbers.values().all(|names| names.len() == 1), "{numbers:?}");
    assert!(names.values().all(|numbers| numbers.len() == 1), "{names:?}");
}

fn constant(module: &Module, name: &str) -> f64 {
    let (_, constant) = module
        .constants
        .iter()
        .find(|(_, c)| c.name.as_deref() == Some(name))
        .unwrap_or_else(|| panic!("no constant {name} in WGSL"));
    match module.global_expressions[constant.init] {
        Expression::Literal(Literal::U32(value)) => f64::from(value),
        Expression::Literal(Literal::F32(value)) => f64::from(value),
        ref other => panic!("{name} is {other:?}"),
    }
}

#[test]
fn constants_agree() {
    for module in modules(&Sources::default()) {
        let constant = |name| constant(&module, name);
        assert_eq!(constant("WORKGROUP"), f64::from(WORKGROUP));
        assert_eq!(constant("SUM_WORDS"), f64::from(SUM_WORDS));
        assert_eq!(constant("ONE"), f64::from(ONE));
        assert_eq!(constant("AWAY"), f64::from(AWAY));
        assert_eq!(constant("NOTHING"), f64::from(f32::INFINITY.to_bits()));
        assert_eq!(constant("WEIGHT_WORD"), 0.0);
        for entry in &module.entry_points {
            assert_eq!(entry.workgroup_size, [WORKGROUP, 1, 1], "{}", entry.name);
        }
    }
    assert_eq!(ONE, 1 << 24);
    // A pixel's row fits beside the flag, its column below the row.
    assert_eq!((MAX_SIDE - 1) << 16 & AWAY, 0);
    const { assert!(MAX_SIDE - 1 <= 0xffff) };
    // The scale is stated once: no kernel repeats it as a number.
    let repeated = FILES.iter().map(|(_, text)| text.matches("16777216").count()).sum::<usize>();
    assert_eq!(repeated, 1);
}

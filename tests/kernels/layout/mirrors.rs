//! The host's mirrors of the bindings' element types, and how a module differs from them.

use std::collections::BTreeMap;
use std::mem::{offset_of, size_of};

use epsplat::low_level::gpu::layout::{Band, Branch, Filter, Page, Splat, TreeNode, View};
use epsplat::low_level::passes::triangles::CORNER_WORDS;
use epsplat::low_level::plan::SceneNeeds;
use epsplat::low_level::scene::Surfel;
use naga::{AddressSpace, ArraySize, Module, ScalarKind, TypeInner};

/// The layout of a type that host and device share: a number of scalars of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    kind: ScalarKind,
    /// Bytes of a scalar.
    width: usize,
    scalars: usize,
}

impl Shape {
    pub fn bytes(&self) -> usize {
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
pub struct Member {
    pub name: String,
    pub offset: usize,
    pub shape: Shape,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Struct {
    pub size: usize,
    pub members: Vec<Member>,
}

macro_rules! mirror {
    ($ty:ident { $($field:ident),* $(,)? }) => {{
        fn shape<F: Shaped>(_: fn(&$ty) -> &F) -> Shape {
            F::SHAPE
        }
        // Does not compile if a field is missing from the list.
        let _complete = |value: $ty| { let $ty { $($field: _),* } = value; };
        let members = vec![$(Member {
            name: stringify!($field).to_owned(),
            offset: offset_of!($ty, $field),
            shape: shape(|value: &$ty| &value.$field),
        }),*];
        (stringify!($ty), Struct { size: size_of::<$ty>(), members })
    }};
}

pub fn mirrors() -> BTreeMap<&'static str, Struct> {
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
            epsilon_most,
            first,
            last,
            textures,
            place,
            levels,
            atlas,
            lens,
        }),
        mirror!(Band { first_row, rows, padding_0, padding_1 }),
        mirror!(Splat { anchor_x, anchor_y, bounds_first, bounds_last, a, b, c, a_low }),
        mirror!(Surfel { center, s, t }),
        mirror!(Page { first, surfels, runs, stride, chosen, padding_0, padding_1, padding_2 }),
        mirror!(TreeNode { center, radius, first, below, children, cone }),
        mirror!(Branch { surfels, roots, first_root, whole, chosen, small_levels, padding_0, padding_1 }),
        mirror!(Filter { center_x, center_y, depth_low, depth_high, r_xx, r_xy, r_yy, gain }),
    ])
}

/// The host's type of a binding's elements.
pub enum Element {
    Struct(&'static str),
    /// A struct, or u32 words that the kernels decode into it.
    Words(&'static str),
    Plain(&'static [Shape]),
}

/// Returns the element types of an accumulator's sum buffer, and twice the number of elements per
/// sum. (A packed element holds two sums, so that number can be one half.)
pub fn sums_of(accumulator: &str) -> (&'static [Shape], u32) {
    match accumulator {
        "fixed" => (&[u32::SHAPE], 4),
        "fixed32" | "cas" => (&[u32::SHAPE], 2),
        "fixed64" => (&[u64::SHAPE], 2),
        "packed64" => (&[u64::SHAPE], 1),
        "float" => (&[f32::SHAPE], 2),
        other => panic!("this test does not know the accumulator {other}"),
    }
}

pub fn elements(accumulator: &str) -> BTreeMap<&'static str, Element> {
    const WORD: &[Shape] = &[u32::SHAPE];
    BTreeMap::from([
        ("view", Element::Struct("View")),
        ("band", Element::Struct("Band")),
        // Words of 32 or 64 bits, whichever suits the adapter.
        ("surfels", Element::Words("Surfel")),
        ("splats", Element::Words("Splat")),
        ("projected", Element::Words("Splat")),
        ("attributes", Element::Plain(WORD)),
        ("indexed", Element::Plain(WORD)),
        ("page", Element::Struct("Page")),
        ("branch", Element::Struct("Branch")),
        ("tree_nodes", Element::Struct("TreeNode")),
        ("frontier", Element::Plain(WORD)),
        ("fates", Element::Plain(WORD)),
        ("counts_of", Element::Plain(&[<[u32; 2]>::SHAPE])),
        ("boxes", Element::Plain(WORD)),
        ("boxed", Element::Plain(WORD)),
        ("chosen", Element::Plain(WORD)),
        ("reached", Element::Plain(WORD)),
        ("selection", Element::Plain(WORD)),
        ("selected", Element::Plain(WORD)),
        ("queue", Element::Plain(WORD)),
        ("queued", Element::Plain(WORD)),
        ("rare", Element::Plain(WORD)),
        ("listed", Element::Plain(WORD)),
        ("balls", Element::Plain(&[<[f32; 4]>::SHAPE])),
        ("surviving", Element::Plain(WORD)),
        ("drawn", Element::Plain(WORD)),
        ("rest", Element::Plain(WORD)),
        ("lists", Element::Plain(WORD)),
        ("large_lists", Element::Plain(WORD)),
        ("small_lists", Element::Plain(WORD)),
        ("nearest", Element::Plain(WORD)),
        ("visible", Element::Plain(WORD)),
        ("sums", Element::Plain(sums_of(accumulator).0)),
        // A colour, or depth and colour in one u64.
        ("winners", Element::Plain(&[u32::SHAPE, u64::SHAPE])),
        ("added", Element::Plain(&[<[u64; 2]>::SHAPE])),
        ("list_starts", Element::Plain(WORD)),
        ("starts", Element::Plain(WORD)),
        ("peeled", Element::Plain(WORD)),
        ("veils", Element::Plain(WORD)),
        ("found_lists", Element::Plain(WORD)),
        ("long_lists", Element::Plain(WORD)),
        ("moments", Element::Plain(WORD)),
        ("told", Element::Plain(WORD)),
        ("keys", Element::Plain(&[<[u32; 2]>::SHAPE])),
        ("fragments", Element::Plain(&[<[u32; 4]>::SHAPE, <[u64; 2]>::SHAPE])),
        ("image", Element::Plain(&[f32::SHAPE, <[f32; 4]>::SHAPE])),
        ("vertices", Element::Plain(&[f32::SHAPE])),
        ("corners_seen", Element::Plain(&[<[f32; CORNER_WORDS as usize]>::SHAPE])),
        ("corners", Element::Plain(&[<[f32; CORNER_WORDS as usize]>::SHAPE])),
        ("triangles", Element::Plain(WORD)),
        ("large_triangles", Element::Plain(WORD)),
        ("queued_triangles", Element::Plain(WORD)),
        ("rare_triangles", Element::Plain(WORD)),
        ("listed_triangles", Element::Plain(WORD)),
        // A number and a depth, or both in one u64.
        ("nearest_triangles", Element::Plain(&[u32::SHAPE, u64::SHAPE])),
        ("named_triangles", Element::Plain(WORD)),
        ("triangle_attributes", Element::Plain(&[f32::SHAPE])),
        ("textures", Element::Plain(WORD)),
        ("individuals", Element::Plain(&[<[f32; 4]>::SHAPE])),
        ("triangle_pixels", Element::Plain(&[<[f32; 4]>::SHAPE])),
        ("triangle_tiles", Element::Plain(WORD)),
        ("tiles_of_triangles", Element::Plain(WORD)),
        ("beside", Element::Plain(&[<[f32; 4]>::SHAPE])),
        ("srgb_to_linear", Element::Plain(&[<[f32; 256]>::SHAPE])),
    ])
}

/// Returns the shape of a type without structs; fails for types that must not be shared.
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

/// Returns the accumulator whose layout of sums `needs` has: with 64-bit atomics, `fixed` stores
/// sums as `fixed64` does.
pub fn kept_as(needs: &SceneNeeds) -> &'static str {
    if needs.atomics_u64 { "fixed64" } else { needs.accumulator.name() }
}

/// Describes each difference between a module's bindings and the host's mirrors.
pub fn differences(module: &Module, accumulator: &str) -> Vec<String> {
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
        // A splat's filter, if any, follows the splat in its record.
        let filtered = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some("Filter"));
        let filtered =
            filtered.is_some_and(|(_, ty)| matches!(&ty.inner, TypeInner::Struct { members, .. } if members.len() > 1));
        // Then come its clip lines and its cap, two rows of four words each, and its fade, one row.
        let has = |name: &str| {
            let found = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name));
            found.is_some_and(|(_, ty)| matches!(&ty.inner, TypeInner::Struct { members, .. } if members.len() > 1))
        };
        let rows = 32 * (usize::from(has("Clip")) + usize::from(has("Cap"))) + 16 * usize::from(has("Fade"));
        let beside = if filtered { mirrors["Filter"].size } else { 0 } + rows;
        let record = |of: &str| mirrors[of].size + if of == "Splat" { beside } else { 0 };
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
                        if filtered && *expected == "Splat" {
                            compare_named(module, "Filter", &mirrors["Filter"], &mut found);
                        }
                    }
                    _ => found.push(format!("{name}: there is no {expected}")),
                }
                match shape(module, ty) {
                    Ok(Shape { kind: ScalarKind::Uint, scalars: 1, .. }) if *expected == "Surfel" => {}
                    Ok(device) if device.kind == ScalarKind::Uint && device.bytes() == record(expected) => {}
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

fn compare_named(module: &Module, name: &str, mirror: &Struct, found: &mut Vec<String>) {
    for (_, ty) in module.types.iter().filter(|(_, ty)| ty.name.as_deref() == Some(name)) {
        if let TypeInner::Struct { members, span } = &ty.inner {
            compare(module, name, members, *span as usize, mirror, found);
        }
    }
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
    // The clip lines, cap and fade are members only in WGSL; in the record they follow the filter.
    let (members, span) = match members {
        [own @ .., clip, cap, fade]
            if name == "Splat" && [clip, cap, fade].map(|m| m.name.as_deref()) == ["clip", "cap", "fade"].map(Some) =>
        {
            let end = own
                .last()
                .map_or(0, |member| member.offset as usize + shape(module, member.ty).map_or(0, |shape| shape.bytes()));
            (own, end)
        }
        all => (all, span),
    };
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

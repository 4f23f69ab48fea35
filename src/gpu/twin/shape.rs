//! Sizes of types: in values, which are packed words, and in buffers, which have padding. Every
//! scalar has one word.

use naga::{ArraySize, Handle, Module, ScalarKind, Type, TypeInner};

/// The kind of a scalar, of a vector's components or of an atomic number.
pub(super) fn kind_of(inner: &TypeInner) -> ScalarKind {
    inner.scalar_kind().unwrap_or(ScalarKind::Uint)
}

fn elements(size: ArraySize) -> Result<usize, String> {
    match size {
        ArraySize::Constant(count) => Ok(count.get() as usize),
        _ => Err("an array without a constant size is no value".into()),
    }
}

/// The number of words of a value.
pub(super) fn words(module: &Module, inner: &TypeInner) -> Result<usize, String> {
    let of = |ty: Handle<Type>| words(module, &module.types[ty].inner);
    match inner {
        TypeInner::Scalar(_) | TypeInner::Atomic(_) => Ok(1),
        TypeInner::Vector { size, .. } => Ok(*size as usize),
        TypeInner::Array { base, size, .. } => Ok(elements(*size)? * of(*base)?),
        TypeInner::Struct { members, .. } => members.iter().map(|member| of(member.ty)).sum(),
        other => Err(format!("{other:?} is no value")),
    }
}

/// A member or element of a type: its type, and where it starts in a value and in a buffer, words.
pub(super) struct Part {
    pub inner: TypeInner,
    pub value: usize,
    pub buffer: usize,
}

/// Returns part `index` of a type.
pub(super) fn part(module: &Module, inner: &TypeInner, index: usize) -> Result<Part, String> {
    match inner {
        TypeInner::Vector { scalar, .. } => Ok(Part { inner: TypeInner::Scalar(*scalar), value: index, buffer: index }),
        TypeInner::Array { base, stride, .. } => {
            let inner = module.types[*base].inner.clone();
            Ok(Part { value: index * words(module, &inner)?, buffer: index * *stride as usize / 4, inner })
        }
        TypeInner::Struct { members, .. } => {
            let before = members[..index].iter().map(|member| words(module, &module.types[member.ty].inner));
            let value = before.sum::<Result<usize, _>>()?;
            let member = &members[index];
            Ok(Part { inner: module.types[member.ty].inner.clone(), value, buffer: member.offset as usize / 4 })
        }
        other => Err(format!("{other:?} has no parts")),
    }
}

/// The number of parts of a type; `None` for a scalar, and for an array whose size the buffer has.
pub(super) fn parts(inner: &TypeInner) -> Option<usize> {
    match inner {
        TypeInner::Vector { size, .. } => Some(*size as usize),
        TypeInner::Array { size: ArraySize::Constant(count), .. } => Some(count.get() as usize),
        TypeInner::Struct { members, .. } => Some(members.len()),
        _ => None,
    }
}

/// Returns where in a buffer each word of a value lies, relative to its start, words.
pub(super) fn places(module: &Module, inner: &TypeInner) -> Result<Vec<usize>, String> {
    let Some(count) = parts(inner) else { return Ok((0..words(module, inner)?).collect()) };
    let mut all = Vec::new();
    for index in 0..count {
        let Part { inner, buffer, .. } = part(module, inner, index)?;
        all.extend(places(module, &inner)?.into_iter().map(|place| place + buffer));
    }
    Ok(all)
}

//! The values of expressions, for all invocations of a workgroup.

use std::rc::Rc;

use naga::{Expression, Function, Handle, Literal, RelationalFunction, TypeInner};

use super::group::{Done, Group, Pointer, Root, Slot};
use super::operations::{Math, Two, binary, conversion, math, unary};
use super::shape::{Part, kind_of, part, parts, words};

impl Group<'_> {
    /// Returns the value that a statement stored for an expression, or evaluates the expression.
    pub(super) fn slot(&mut self, handle: Handle<Expression>) -> Done<Slot> {
        if let Some(slot) = &self.top().values[handle.index()] {
            return Ok(slot.clone());
        }
        self.evaluated(handle)
    }

    pub(super) fn value(&mut self, handle: Handle<Expression>) -> Done<Rc<[u32]>> {
        match self.slot(handle)? {
            Slot::Value(value) => Ok(value),
            Slot::Pointer(_) => Err("a pointer is no value".into()),
        }
    }

    pub(super) fn pointer(&mut self, handle: Handle<Expression>) -> Done<Pointer> {
        match self.slot(handle)? {
            Slot::Pointer(pointer) => Ok(pointer),
            Slot::Value(_) => Err("a value is no pointer".into()),
        }
    }

    /// The words of a constant expression of the module.
    pub(super) fn constant(&self, handle: Handle<Expression>) -> Done<Vec<u32>> {
        match &self.module.global_expressions[handle] {
            Expression::Literal(literal) => of_literal(*literal).map(|word| vec![word]),
            Expression::Constant(constant) => self.constant(self.module.constants[*constant].init),
            Expression::ZeroValue(ty) => Ok(vec![0; words(self.module, &self.module.types[*ty].inner)?]),
            Expression::Compose { components, .. } => {
                let all = components.iter().map(|component| self.constant(*component)).collect::<Done<Vec<_>>>()?;
                Ok(all.concat())
            }
            Expression::Splat { size, value } => Ok(self.constant(*value)?.repeat(*size as usize)),
            other => Err(format!("the constant {other:?} is not known here")),
        }
    }

    fn everywhere(&self, words: &[u32]) -> Slot {
        Slot::Value(words.iter().flat_map(|word| std::iter::repeat_n(*word, self.lanes)).collect())
    }

    pub(super) fn evaluated(&mut self, handle: Handle<Expression>) -> Done<Slot> {
        let function = self.top().function;
        match &function.expressions[handle] {
            Expression::Compose { .. }
            | Expression::Splat { .. }
            | Expression::Swizzle { .. }
            | Expression::Access { .. }
            | Expression::AccessIndex { .. } => self.arranged(&function.expressions[handle]),
            Expression::Unary { .. } | Expression::Binary { .. } | Expression::Math { .. } | Expression::As { .. } => {
                self.computed(&function.expressions[handle])
            }
            Expression::Select { condition, accept, reject } => self.selected(*condition, *accept, *reject),
            Expression::Relational { fun, argument } => self.related(*fun, *argument),
            given => self.given(function, given),
        }
    }

    /// A constant, a variable, or what memory holds.
    fn given(&mut self, function: &Function, expression: &Expression) -> Done<Slot> {
        let lanes = self.lanes;
        Ok(match *expression {
            Expression::Literal(literal) => self.everywhere(&[of_literal(literal)?]),
            Expression::Constant(constant) => {
                let words = self.constant(self.module.constants[constant].init)?;
                self.everywhere(&words)
            }
            Expression::ZeroValue(ty) => {
                let count = words(self.module, &self.module.types[ty].inner)?;
                self.everywhere(&vec![0; count])
            }
            Expression::FunctionArgument(index) => self.top().arguments[index as usize].clone(),
            Expression::GlobalVariable(variable) => {
                let inner = self.module.types[self.module.global_variables[variable].ty].inner.clone();
                Slot::Pointer(Pointer { root: Root::Global(variable), inner, at: vec![0; lanes].into() })
            }
            Expression::LocalVariable(local) => {
                let inner = self.module.types[function.local_variables[local].ty].inner.clone();
                let root = Root::Local(self.frames.len() - 1, local);
                Slot::Pointer(Pointer { root, inner, at: vec![0; lanes].into() })
            }
            Expression::Load { pointer } => {
                let pointer = self.pointer(pointer)?;
                Slot::Value(self.load(&pointer)?)
            }
            Expression::ArrayLength(array) => {
                let Pointer { root, inner, at } = self.pointer(array)?;
                let (Root::Global(variable), TypeInner::Array { stride, .. }) = (root, &inner) else {
                    return Err("only buffers have lengths".into());
                };
                let held = self.buffers.get(&variable).map_or(0, |words| words.len()) as u32;
                Slot::Value(at.iter().map(|at| held.saturating_sub(*at) / (stride / 4)).collect())
            }
            ref other => return Err(format!("the expression {other:?} is not known here")),
        })
    }

    /// Components put together or taken apart.
    fn arranged(&mut self, expression: &Expression) -> Done<Slot> {
        let lanes = self.lanes;
        Ok(match *expression {
            Expression::Compose { ref components, .. } => {
                let mut all = Vec::new();
                for component in components {
                    all.extend_from_slice(&self.value(*component)?);
                }
                Slot::Value(all.into())
            }
            Expression::Splat { size, value } => Slot::Value(self.value(value)?.repeat(size as usize).into()),
            Expression::Swizzle { size, vector, pattern } => {
                let vector = self.value(vector)?;
                let taken = pattern[..size as usize].iter().map(|c| &vector[*c as usize * lanes..][..lanes]);
                Slot::Value(taken.flatten().copied().collect())
            }
            Expression::AccessIndex { base, index } => {
                let index = vec![index; lanes];
                self.access(base, &index)?
            }
            Expression::Access { base, index } => {
                let index = self.value(index)?;
                self.access(base, &index)?
            }
            ref other => return Err(format!("{other:?} arranges nothing")),
        })
    }

    /// The result of an operation, component by component.
    fn computed(&mut self, expression: &Expression) -> Done<Slot> {
        Ok(match *expression {
            Expression::Unary { op, expr } => {
                let operation = unary(op, kind_of(self.inner(expr)));
                Slot::Value(self.value(expr)?.iter().map(|word| operation(*word)).collect())
            }
            Expression::Binary { op, left, right } => {
                let operation = binary(op, kind_of(self.inner(left)))?;
                Slot::Value(each_pair(operation, &self.value(left)?, &self.value(right)?))
            }
            Expression::Math { fun, arg, arg1, arg2, .. } => {
                let a = self.value(arg)?;
                let [b, c] = [self.value(arg1.unwrap_or(arg))?, self.value(arg2.unwrap_or(arg))?];
                Slot::Value(match math(fun, kind_of(self.inner(arg)))? {
                    Math::One(operation) => a.iter().map(|word| operation(*word)).collect(),
                    Math::Two(operation) => each_pair(operation, &a, &b),
                    Math::Three(operation) => (0..a.len()).map(|k| operation(a[k], b[k], c[k])).collect(),
                })
            }
            Expression::As { expr, convert: None, .. } => Slot::Value(self.value(expr)?),
            Expression::As { expr, kind, .. } => {
                let operation = conversion(kind_of(self.inner(expr)), kind)?;
                Slot::Value(self.value(expr)?.iter().map(|word| operation(*word)).collect())
            }
            ref other => return Err(format!("{other:?} computes nothing")),
        })
    }

    /// One of two values, by component if the condition has components.
    fn selected(
        &mut self,
        condition: Handle<Expression>,
        accept: Handle<Expression>,
        reject: Handle<Expression>,
    ) -> Done<Slot> {
        let (chosen, accept, reject) = (self.value(condition)?, self.value(accept)?, self.value(reject)?);
        let one = |((truth, accept), reject): ((&u32, &u32), &u32)| if *truth == 1 { *accept } else { *reject };
        let choices = chosen.iter().cycle().zip(accept.iter()).zip(reject.iter());
        Ok(Slot::Value(choices.map(one).collect()))
    }

    fn related(&mut self, fun: RelationalFunction, argument: Handle<Expression>) -> Done<Slot> {
        let (lanes, value) = (self.lanes, self.value(argument)?);
        let of_lane = |lane: usize| value.iter().skip(lane).step_by(lanes);
        let truth: &dyn Fn(usize) -> bool = match fun {
            RelationalFunction::All => &|lane| of_lane(lane).all(|t| *t == 1),
            RelationalFunction::Any => &|lane| of_lane(lane).any(|t| *t == 1),
            other => return Err(format!("the function {other:?} is not known here")),
        };
        Ok(Slot::Value((0..lanes).map(|lane| u32::from(truth(lane))).collect()))
    }

    /// A part of a value, or a pointer to a part of what a pointer leads to.
    fn access(&mut self, base: Handle<Expression>, index: &[u32]) -> Done<Slot> {
        match self.slot(base)? {
            Slot::Pointer(pointer) => self.pointed(pointer, index),
            Slot::Value(value) => {
                let inner = self.inner(base);
                let lanes = self.lanes;
                let places = self.places_of(inner, index, |part| part.value)?;
                let which = if matches!(inner, TypeInner::Struct { .. }) { index[0] as usize } else { 0 };
                let count = words(self.module, &part(self.module, inner, which)?.inner)?;
                let mut all = vec![0; count * lanes];
                for (lane, from) in places.into_iter().enumerate() {
                    for word in 0..count {
                        all[word * lanes + lane] = value[(from + word) * lanes + lane];
                    }
                }
                Ok(Slot::Value(all.into()))
            }
        }
    }

    /// A pointer to a part of what a pointer leads to.
    fn pointed(&mut self, Pointer { root, inner, at }: Pointer, index: &[u32]) -> Done<Slot> {
        let in_buffer = matches!(root, Root::Global(variable) if self.buffers.contains_key(&variable));
        let place = |part: &Part| if in_buffer { part.buffer } else { part.value };
        let places = self.places_of(&inner, index, place)?;
        let at = at.iter().zip(places).map(|(at, place)| at.wrapping_add(place as u32)).collect();
        // All elements of an array have one type, and the members of a structure one index.
        let which = if matches!(inner, TypeInner::Struct { .. }) { index[0] as usize } else { 0 };
        Ok(Slot::Pointer(Pointer { root, inner: part(self.module, &inner, which)?.inner, at }))
    }

    /// Where each invocation's part of a type starts, words.
    ///
    /// An index outside the type is one of an invocation that takes no part; it gets the last part.
    fn places_of(&self, inner: &TypeInner, index: &[u32], place: impl Fn(&Part) -> usize) -> Done<Vec<usize>> {
        let most = parts(inner).map_or(u32::MAX / 64, |count| count as u32 - 1);
        let of = |index: u32| part(self.module, inner, index.min(most) as usize).map(|part| place(&part));
        if matches!(inner, TypeInner::Struct { .. }) {
            return Ok(vec![of(index[0])?; index.len()]);
        }
        // Elements follow each other at one distance.
        let (first, step) = (of(0)?, of(most.min(1))?);
        Ok(index.iter().map(|index| first + (*index).min(most) as usize * (step - first)).collect())
    }
}

/// The results of an operation on each pair of words. A scalar beside a vector is the same for each
/// component.
fn each_pair(operation: Two, a: &[u32], b: &[u32]) -> Rc<[u32]> {
    if a.len() == b.len() {
        return a.iter().zip(b).map(|(a, b)| operation(*a, *b)).collect();
    }
    a.iter().cycle().zip(b.iter().cycle()).take(a.len().max(b.len())).map(|(a, b)| operation(*a, *b)).collect()
}

/// The word of a number.
fn of_literal(literal: Literal) -> Done<u32> {
    match literal {
        Literal::F32(value) => Ok(value.to_bits()),
        Literal::U32(value) => Ok(value),
        Literal::I32(value) => Ok(value as u32),
        Literal::Bool(value) => Ok(u32::from(value)),
        other => Err(format!("the number {other:?} is not known here")),
    }
}

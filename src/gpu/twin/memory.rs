//! Reads, writes and atomic operations of a workgroup's invocations.

use std::rc::Rc;

use naga::{AddressSpace, AtomicFunction, BinaryOperator, Expression, Handle, MathFunction};

use super::group::{Done, Group, Mask, Pointer, Root, Slot};
use super::operations::{binary, math};
use super::shape::{kind_of, places, words};

impl Group<'_> {
    /// Returns where the words that a pointer leads to lie, relative to its place, and the number
    /// of invocations that have a copy of the variable.
    fn layout(&self, pointer: &Pointer) -> Done<(Vec<usize>, usize)> {
        match pointer.root {
            Root::Global(variable) if self.buffers.bind(variable) => Ok((places(self.module, &pointer.inner)?, 1)),
            Root::Global(variable) => {
                let copies = match self.module.global_variables[variable].space {
                    AddressSpace::WorkGroup => 1,
                    _ => self.lanes,
                };
                Ok(((0..words(self.module, &pointer.inner)?).collect(), copies))
            }
            Root::Local(..) => Ok(((0..words(self.module, &pointer.inner)?).collect(), self.lanes)),
        }
    }

    fn memory(&mut self, root: Root) -> Done<&mut [u32]> {
        let found = match root {
            Root::Global(variable) if self.buffers.bind(variable) => self.buffers.of(variable),
            Root::Global(variable) => self.memory.get_mut(&variable).map(Vec::as_mut_slice),
            Root::Local(frame, local) => self.frames[frame].locals.get_mut(&local).map(Vec::as_mut_slice),
        };
        found.ok_or_else(|| "a variable has no memory here".into())
    }

    pub(super) fn load(&mut self, pointer: &Pointer) -> Done<Rc<[u32]>> {
        let lanes = self.lanes;
        let (places, copies) = self.layout(pointer)?;
        let memory = self.memory(pointer.root)?;
        let mut all = vec![0; places.len() * lanes];
        for (word, place) in places.iter().enumerate() {
            for lane in 0..lanes {
                let at = (pointer.at[lane] as usize + place) * copies + if copies == 1 { 0 } else { lane };
                all[word * lanes + lane] = memory.get(at).copied().unwrap_or(0);
            }
        }
        Ok(all.into())
    }

    pub(super) fn store(&mut self, pointer: &Pointer, value: &[u32], mask: &Mask) -> Done {
        let lanes = self.lanes;
        let (places, copies) = self.layout(pointer)?;
        let memory = self.memory(pointer.root)?;
        for (word, place) in places.iter().enumerate() {
            for lane in (0..lanes).filter(|lane| mask[*lane]) {
                let at = (pointer.at[lane] as usize + place) * copies + if copies == 1 { 0 } else { lane };
                if let Some(held) = memory.get_mut(at) {
                    *held = value[word * lanes + lane];
                }
            }
        }
        Ok(())
    }

    pub(super) fn atomic(
        &mut self,
        pointer: Handle<Expression>,
        fun: AtomicFunction,
        value: Handle<Expression>,
        result: Option<Handle<Expression>>,
        mask: &Mask,
    ) -> Done {
        let lanes = self.lanes;
        let pointer = self.pointer(pointer)?;
        let value = self.value(value)?;
        let compare = match fun {
            AtomicFunction::Exchange { compare: Some(compare) } => Some(self.value(compare)?),
            _ => None,
        };
        let kind = kind_of(&pointer.inner);
        let memory = self.memory(pointer.root)?;
        let mut before = vec![0; lanes];
        let mut exchanged = vec![0; lanes];
        for lane in (0..lanes).filter(|lane| mask[*lane]) {
            // An access outside the buffer has no effect.
            let Some(held) = memory.get_mut(pointer.at[lane] as usize) else { continue };
            let (old, given) = (*held, value[lane]);
            let equal = compare.as_ref().is_none_or(|compare| compare[lane] == old);
            *held = match fun {
                AtomicFunction::Add => binary(BinaryOperator::Add, kind, old, given)?,
                AtomicFunction::Subtract => binary(BinaryOperator::Subtract, kind, old, given)?,
                AtomicFunction::And => old & given,
                AtomicFunction::ExclusiveOr => old ^ given,
                AtomicFunction::InclusiveOr => old | given,
                AtomicFunction::Min => math(MathFunction::Min, kind, old, given, 0)?,
                AtomicFunction::Max => math(MathFunction::Max, kind, old, given, 0)?,
                AtomicFunction::Exchange { .. } if !equal => old,
                AtomicFunction::Exchange { .. } => given,
            };
            before[lane] = old;
            exchanged[lane] = u32::from(equal);
        }
        // The result of a comparing exchange is a structure of both.
        if compare.is_some() {
            before.extend(exchanged);
        }
        if let Some(result) = result {
            self.top().values[result.index()] = Some(Slot::Value(before.into()));
        }
        Ok(())
    }
}

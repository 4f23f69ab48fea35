//! Reads, writes and atomic operations of a workgroup's invocations.

use std::rc::Rc;

use naga::{AddressSpace, AtomicFunction, BinaryOperator, Expression, Handle};

use super::group::{Done, Group, Mask, Pointer, Root, Slot};
use super::operations::{binary, math};
use super::shape::{places, scalar_of, scalar_words, words};

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
        let scalar = scalar_of(&pointer.inner);
        let each = scalar_words(scalar);
        let memory = self.memory(pointer.root)?;
        let mut before = vec![0; (each + usize::from(compare.is_some())) * lanes];
        for lane in (0..lanes).filter(|lane| mask[*lane]) {
            let at = pointer.at[lane] as usize;
            if at + each > memory.len() {
                continue;
            }
            let of = |words: &[u32], at: usize, step: usize| {
                u64::from(words[at]) | if each == 2 { u64::from(words[at + step]) << 32 } else { 0 }
            };
            let (old, given) = (of(memory, at, 1), of(&value, lane, lanes));
            let equal = compare.as_ref().is_none_or(|compare| of(compare, lane, lanes) == old);
            let new = match fun {
                AtomicFunction::Add => binary(BinaryOperator::Add, scalar, old, given)?,
                AtomicFunction::Subtract => binary(BinaryOperator::Subtract, scalar, old, given)?,
                AtomicFunction::And => old & given,
                AtomicFunction::ExclusiveOr => old ^ given,
                AtomicFunction::InclusiveOr => old | given,
                AtomicFunction::Min => math(naga::MathFunction::Min, scalar, old, given, 0)?,
                AtomicFunction::Max => math(naga::MathFunction::Max, scalar, old, given, 0)?,
                AtomicFunction::Exchange { .. } => {
                    if equal {
                        given
                    } else {
                        old
                    }
                }
            };
            memory[at] = new as u32;
            before[lane] = old as u32;
            if each == 2 {
                memory[at + 1] = (new >> 32) as u32;
                before[lanes + lane] = (old >> 32) as u32;
            }
            if compare.is_some() {
                before[each * lanes + lane] = u32::from(equal);
            }
        }
        if let Some(result) = result {
            self.top().values[result.index()] = Some(Slot::Value(before.into()));
        }
        Ok(())
    }
}

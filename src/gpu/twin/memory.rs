//! Reads, writes and atomic operations of a workgroup's invocations.

use std::rc::Rc;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

use naga::{AddressSpace, AtomicFunction, BinaryOperator, Expression, Handle, MathFunction, ScalarKind};

use super::group::{Done, Group, Mask, Pointer, Root, Slot};
use super::operations::{Math, Two, binary, math};
use super::shape::{kind_of, places, words};

/// The words of a variable.
enum Memory<'a> {
    /// A buffer, which all workgroups share.
    Shared(&'a [AtomicU32]),
    /// A variable of the workgroup.
    Own(&'a mut [u32]),
}

impl Memory<'_> {
    /// Returns a word, and 0 outside.
    fn get(&self, at: usize) -> u32 {
        match self {
            Self::Shared(words) => words.get(at).map_or(0, |word| word.load(Relaxed)),
            Self::Own(words) => words.get(at).copied().unwrap_or(0),
        }
    }

    /// Sets a word, if it is inside.
    fn set(&mut self, at: usize, value: u32) {
        match self {
            Self::Shared(words) => words.get(at).into_iter().for_each(|word| word.store(value, Relaxed)),
            Self::Own(words) => words.get_mut(at).into_iter().for_each(|word| *word = value),
        }
    }

    /// Replaces a word, and returns what it was; `None` outside.
    fn update(&mut self, at: usize, of: impl Fn(u32) -> u32) -> Option<u32> {
        match self {
            Self::Shared(words) => words.get(at)?.fetch_update(Relaxed, Relaxed, |old| Some(of(old))).ok(),
            Self::Own(words) => {
                let held = words.get_mut(at)?;
                Some(std::mem::replace(held, of(*held)))
            }
        }
    }
}

/// Returns the number that an atomic function stores, from the old one and the one given.
fn combination(fun: AtomicFunction, kind: ScalarKind) -> Done<Two> {
    let named = |fun| match math(fun, kind) {
        Ok(Math::Two(operation)) => Ok(operation),
        _ => Err(format!("an atomic {fun:?} of {kind:?}")),
    };
    match fun {
        AtomicFunction::Add => binary(BinaryOperator::Add, kind),
        AtomicFunction::Subtract => binary(BinaryOperator::Subtract, kind),
        AtomicFunction::And => binary(BinaryOperator::And, kind),
        AtomicFunction::ExclusiveOr => binary(BinaryOperator::ExclusiveOr, kind),
        AtomicFunction::InclusiveOr => binary(BinaryOperator::InclusiveOr, kind),
        AtomicFunction::Min => named(MathFunction::Min),
        AtomicFunction::Max => named(MathFunction::Max),
        AtomicFunction::Exchange { .. } => Ok(|_, given| given),
    }
}

impl Group<'_> {
    /// Returns where the words that a pointer leads to lie, relative to its place, and the number
    /// of invocations that have a copy of the variable.
    fn layout(&self, pointer: &Pointer) -> Done<(Vec<usize>, usize)> {
        match pointer.root {
            Root::Global(variable) if self.buffers.contains_key(&variable) => {
                Ok((places(self.module, &pointer.inner)?, 1))
            }
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

    fn memory(&mut self, root: Root) -> Done<Memory<'_>> {
        let own = match root {
            Root::Global(variable) => match self.buffers.get(&variable) {
                Some(words) => return Ok(Memory::Shared(words)),
                None => self.memory.get_mut(&variable),
            },
            Root::Local(frame, local) => self.frames[frame].locals.get_mut(&local),
        };
        own.map(|words| Memory::Own(words)).ok_or_else(|| "a variable has no memory here".into())
    }

    pub(super) fn load(&mut self, pointer: &Pointer) -> Done<Rc<[u32]>> {
        let lanes = self.lanes;
        let (places, copies) = self.layout(pointer)?;
        let memory = self.memory(pointer.root)?;
        let mut all = vec![0; places.len() * lanes];
        for (word, place) in places.iter().enumerate() {
            for lane in 0..lanes {
                let at = (pointer.at[lane] as usize + place) * copies + if copies == 1 { 0 } else { lane };
                all[word * lanes + lane] = memory.get(at);
            }
        }
        Ok(all.into())
    }

    pub(super) fn store(&mut self, pointer: &Pointer, value: &[u32], mask: &Mask) -> Done {
        let lanes = self.lanes;
        let (places, copies) = self.layout(pointer)?;
        let mut memory = self.memory(pointer.root)?;
        for (word, place) in places.iter().enumerate() {
            for lane in (0..lanes).filter(|lane| mask[*lane]) {
                let at = (pointer.at[lane] as usize + place) * copies + if copies == 1 { 0 } else { lane };
                memory.set(at, value[word * lanes + lane]);
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
        let combine = combination(fun, kind_of(&pointer.inner))?;
        if let Root::Global(variable) = pointer.root
            && self.buffers.contains_key(&variable)
        {
            let name = self.module.global_variables[variable].name.clone().unwrap_or_default();
            *self.tally.atomics.entry(name).or_default() += mask.iter().filter(|on| **on).count() as u64;
        }
        let mut memory = self.memory(pointer.root)?;
        let mut before = vec![0; lanes];
        let mut exchanged = vec![0; lanes];
        for lane in (0..lanes).filter(|lane| mask[*lane]) {
            let equal = |old| compare.as_ref().is_none_or(|compare| compare[lane] == old);
            let combined = |old| if equal(old) { combine(old, value[lane]) } else { old };
            // An access outside the buffer has no effect.
            let Some(old) = memory.update(pointer.at[lane] as usize, combined) else { continue };
            before[lane] = old;
            exchanged[lane] = u32::from(equal(old));
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

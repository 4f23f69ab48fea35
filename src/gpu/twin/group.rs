//! A workgroup that runs on the processor, all invocations in step: its calls and statements.

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::atomic::AtomicU32;

use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{
    AddressSpace, Block, BuiltIn, Expression, Function, GlobalVariable, Handle, LocalVariable, Module, Statement,
    SwitchCase, SwitchValue, TypeInner,
};

use super::shape::words;
use super::tally::KernelTally;

/// The words that each variable of a dispatch binds. All workgroups share them.
pub(super) type Buffers<'a> = HashMap<Handle<GlobalVariable>, &'a [AtomicU32]>;

/// The invocations that take part, one flag each.
pub(super) type Mask = Vec<bool>;

fn any(mask: &Mask) -> bool {
    mask.contains(&true)
}

/// A variable of the module, or of a function that is being called.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Root {
    Global(Handle<GlobalVariable>),
    Local(usize, Handle<LocalVariable>),
}

/// Where each invocation's pointer leads.
#[derive(Clone)]
pub(super) struct Pointer {
    pub root: Root,
    pub inner: TypeInner,
    /// The word of the variable, by invocation.
    pub at: Rc<[u32]>,
}

/// The value of an expression: words, each for all invocations one after the other.
#[derive(Clone)]
pub(super) enum Slot {
    Value(Rc<[u32]>),
    Pointer(Pointer),
}

/// A loop or a switch, and the invocations that left its body.
struct Scope {
    broken: Mask,
    /// `None` for a switch.
    continued: Option<Mask>,
}

/// A call in progress.
pub(super) struct Frame<'a> {
    pub function: &'a Function,
    pub info: &'a FunctionInfo,
    pub values: Vec<Option<Slot>>,
    pub arguments: Vec<Slot>,
    /// Local variables, laid out as values.
    pub locals: HashMap<Handle<LocalVariable>, Vec<u32>>,
    result: Option<Vec<u32>>,
    scopes: Vec<Scope>,
}

/// A workgroup.
pub(super) struct Group<'a> {
    pub module: &'a Module,
    pub info: &'a ModuleInfo,
    pub lanes: usize,
    /// The size of a workgroup.
    pub size: [u32; 3],
    pub id: [u32; 3],
    /// The number of workgroups.
    pub grid: [u32; 3],
    pub buffers: &'a Buffers<'a>,
    /// Private variables of all invocations, laid out as values, and workgroup memory.
    pub memory: HashMap<Handle<GlobalVariable>, Vec<u32>>,
    pub frames: Vec<Frame<'a>>,
    pub tally: KernelTally,
}

/// A result, or why the twin cannot go on.
pub(super) type Done<T = ()> = Result<T, String>;

impl<'a> Group<'a> {
    pub fn new(
        (module, info): (&'a Module, &'a ModuleInfo),
        size: [u32; 3],
        (id, grid): ([u32; 3], [u32; 3]),
        buffers: &'a Buffers<'a>,
    ) -> Done<Self> {
        let lanes = size.iter().product::<u32>() as usize;
        let (memory, frames, tally) = Default::default();
        let mut group = Self { module, info, lanes, size, id, grid, buffers, memory, frames, tally };
        for (handle, variable) in module.global_variables.iter() {
            let copies = match variable.space {
                AddressSpace::Private => lanes,
                AddressSpace::WorkGroup => 1,
                _ => continue,
            };
            let mut zeros = vec![0; words(module, &module.types[variable.ty].inner)? * copies];
            if let Some(init) = variable.init {
                zeros = group.constant(init)?.iter().flat_map(|word| std::iter::repeat_n(*word, copies)).collect();
            }
            group.memory.insert(handle, zeros);
        }
        Ok(group)
    }

    /// Runs an entry point. Returns what it did.
    pub fn run(mut self, entry: usize) -> Done<KernelTally> {
        let function = &self.module.entry_points[entry].function;
        let arguments = function.arguments.iter().map(|argument| {
            let Some(naga::Binding::BuiltIn(built_in)) = argument.binding else {
                return Err("an argument of a kernel is no built-in value".to_owned());
            };
            self.built_in(built_in)
        });
        let arguments = arguments.collect::<Done<Vec<_>>>()?;
        self.call(function, self.info.get_entry_point(entry), arguments, vec![true; self.lanes])?;
        Ok(self.tally)
    }

    fn built_in(&self, built_in: BuiltIn) -> Done<Slot> {
        let local = |lane: usize| {
            let [x, y, _] = self.size;
            let lane = lane as u32;
            [lane % x, lane / x % y, lane / (x * y)]
        };
        let three = |of: &dyn Fn(usize, usize) -> u32| {
            let all = (0..3).flat_map(|k| (0..self.lanes).map(move |lane| (k, lane)));
            Ok(Slot::Value(all.map(|(k, lane)| of(k, lane)).collect()))
        };
        match built_in {
            BuiltIn::GlobalInvocationId => three(&|k, lane| self.id[k] * self.size[k] + local(lane)[k]),
            BuiltIn::LocalInvocationId => three(&|k, lane| local(lane)[k]),
            BuiltIn::WorkGroupId => three(&|k, _| self.id[k]),
            BuiltIn::NumWorkGroups => three(&|k, _| self.grid[k]),
            BuiltIn::WorkGroupSize => three(&|k, _| self.size[k]),
            BuiltIn::LocalInvocationIndex => Ok(Slot::Value((0..self.lanes as u32).collect())),
            other => Err(format!("the built-in value {other:?} is not known here")),
        }
    }

    fn call(
        &mut self,
        function: &'a Function,
        info: &'a FunctionInfo,
        arguments: Vec<Slot>,
        mask: Mask,
    ) -> Done<Option<Vec<u32>>> {
        let values = vec![None; function.expressions.len()];
        let frame =
            Frame { function, info, values, arguments, locals: HashMap::new(), result: None, scopes: Vec::new() };
        self.frames.push(frame);
        for (handle, local) in function.local_variables.iter() {
            let value = match local.init {
                Some(init) => self.value(init)?.to_vec(),
                None => vec![0; words(self.module, &self.module.types[local.ty].inner)? * self.lanes],
            };
            self.top().locals.insert(handle, value);
        }
        self.block(&function.body, mask)?;
        Ok(self.frames.pop().and_then(|frame| frame.result))
    }

    pub(super) fn top(&mut self) -> &mut Frame<'a> {
        // `call` pushes a frame before anything asks for one.
        let last = self.frames.len() - 1;
        &mut self.frames[last]
    }

    pub(super) fn inner(&self, handle: Handle<Expression>) -> &'a TypeInner {
        let frame = &self.frames[self.frames.len() - 1];
        frame.info[handle].ty.inner_with(&self.module.types)
    }

    /// Runs a block. Returns the invocations that reach its end.
    fn block(&mut self, block: &'a Block, mut mask: Mask) -> Done<Mask> {
        for statement in block.iter() {
            if !any(&mask) {
                break;
            }
            mask = self.statement(statement, mask)?;
        }
        Ok(mask)
    }

    fn statement(&mut self, statement: &'a Statement, mask: Mask) -> Done<Mask> {
        match statement {
            Statement::Emit(range) => {
                for handle in range.clone() {
                    let slot = self.evaluated(handle)?;
                    self.top().values[handle.index()] = Some(slot);
                }
            }
            Statement::Block(block) => return self.block(block, mask),
            Statement::If { condition, accept, reject } => {
                let truth = self.value(*condition)?;
                let side = |wanted: u32| mask.iter().zip(truth.iter()).map(|(on, t)| *on && *t == wanted).collect();
                let (yes, no) = (side(1), side(0));
                let yes = self.block(accept, yes)?;
                let no = self.block(reject, no)?;
                return Ok(yes.iter().zip(no).map(|(a, b)| *a || b).collect());
            }
            Statement::Switch { selector, cases } => return self.switch(*selector, cases, mask),
            Statement::Loop { body, continuing, break_if } => return self.repeat(body, continuing, *break_if, mask),
            Statement::Break => {
                if let Some(scope) = self.top().scopes.last_mut() {
                    add(&mut scope.broken, &mask);
                }
                return Ok(vec![false; mask.len()]);
            }
            Statement::Continue => {
                let continued = self.top().scopes.iter_mut().rev().find_map(|scope| scope.continued.as_mut());
                continued.into_iter().for_each(|continued| add(continued, &mask));
                return Ok(vec![false; mask.len()]);
            }
            Statement::Return { value } => {
                if let Some(value) = value {
                    let value = self.value(*value)?;
                    let lanes = self.lanes;
                    let result = self.top().result.get_or_insert_with(|| vec![0; value.len()]);
                    for (k, word) in result.iter_mut().enumerate().filter(|(k, _)| mask[k % lanes]) {
                        *word = value[k];
                    }
                }
                return Ok(vec![false; mask.len()]);
            }
            // All invocations are in step.
            Statement::ControlBarrier(_) | Statement::MemoryBarrier(_) => {}
            Statement::Store { pointer, value } => {
                let value = self.value(*value)?;
                let pointer = self.pointer(*pointer)?;
                self.store(&pointer, &value, &mask)?;
            }
            Statement::Atomic { pointer, fun, value, result } => self.atomic(*pointer, *fun, *value, *result, &mask)?,
            Statement::WorkGroupUniformLoad { pointer, result } => {
                let pointer = self.pointer(*pointer)?;
                let value = self.load(&pointer)?;
                self.top().values[result.index()] = Some(Slot::Value(value));
            }
            Statement::Call { function, arguments, result } => {
                let arguments = arguments.iter().map(|argument| self.slot(*argument)).collect::<Done<Vec<_>>>()?;
                let called = &self.module.functions[*function];
                self.tally.called(called.name.as_deref().unwrap_or_default(), &mask);
                let value = self.call(called, &self.info[*function], arguments, mask.clone())?;
                if let (Some(result), Some(value)) = (result, value) {
                    self.top().values[result.index()] = Some(Slot::Value(value.into()));
                }
            }
            other => return Err(format!("the statement {other:?} is not known here")),
        }
        Ok(mask)
    }

    fn switch(&mut self, selector: Handle<Expression>, cases: &'a [SwitchCase], mask: Mask) -> Done<Mask> {
        let selected = self.value(selector)?;
        let listed = |word: u32| {
            cases.iter().position(|case| match case.value {
                SwitchValue::I32(value) => value as u32 == word,
                SwitchValue::U32(value) => value == word,
                SwitchValue::Default => false,
            })
        };
        let default = cases.iter().position(|case| case.value == SwitchValue::Default);
        let chosen: Vec<_> = selected.iter().map(|word| listed(*word).or(default)).collect();
        let none = || vec![false; mask.len()];
        self.top().scopes.push(Scope { broken: none(), continued: None });
        // Invocations that no case takes go on after the switch.
        let mut out: Mask = mask.iter().zip(&chosen).map(|(on, case)| *on && case.is_none()).collect();
        let mut falling = none();
        for (k, case) in cases.iter().enumerate() {
            let mut here: Mask = mask.iter().zip(&chosen).map(|(on, chosen)| *on && *chosen == Some(k)).collect();
            add(&mut here, &falling);
            let reached = self.block(&case.body, here)?;
            falling = none();
            add(if case.fall_through { &mut falling } else { &mut out }, &reached);
        }
        if let Some(scope) = self.top().scopes.pop() {
            add(&mut out, &scope.broken);
        }
        Ok(out)
    }

    fn repeat(
        &mut self,
        body: &'a Block,
        continuing: &'a Block,
        break_if: Option<Handle<Expression>>,
        mut mask: Mask,
    ) -> Done<Mask> {
        let none = || vec![false; self.lanes];
        let mut out = none();
        let empty = none();
        while any(&mask) {
            self.top().scopes.push(Scope { broken: empty.clone(), continued: Some(empty.clone()) });
            let mut reached = self.block(body, mask)?;
            if let Some(scope) = self.top().scopes.last_mut() {
                let continued = scope.continued.replace(empty.clone()).unwrap_or_default();
                add(&mut reached, &continued);
            }
            mask = self.block(continuing, reached)?;
            if let Some(condition) = break_if.filter(|_| any(&mask)) {
                let ends = self.value(condition)?;
                for (lane, on) in mask.iter_mut().enumerate().filter(|(lane, on)| **on && ends[*lane] == 1) {
                    (out[lane], *on) = (true, false);
                }
            }
            if let Some(scope) = self.top().scopes.pop() {
                add(&mut out, &scope.broken);
            }
        }
        Ok(out)
    }
}

/// Adds the invocations of `more` to `mask`.
fn add(mask: &mut Mask, more: &Mask) {
    mask.iter_mut().zip(more).for_each(|(on, more)| *on |= more);
}

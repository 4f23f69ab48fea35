//! Builds the functions of a module anew, with calls and barriers in place of operations.

use std::collections::HashMap;

use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{
    Arena, BinaryOperator, Block, Expression, Function, Handle, LocalVariable, MathFunction, Module, Range, Scalar,
    ScalarKind, Span, Statement, SwitchCase, Type, TypeInner, VectorSize,
};

use super::{Fate, Needs, fate, is_own};

/// The types that the new expressions need.
struct Types {
    vectors: [Handle<Type>; 3],
}

/// The variable that holds a zero unknown to compilers, and the number of its member.
#[derive(Clone, Copy)]
struct Zero {
    variable: Handle<naga::GlobalVariable>,
    member: u32,
}

/// The facts that all functions of a module share.
struct Context<'a> {
    module: &'a Module,
    needs: Needs,
    types: Types,
    zero: Option<Zero>,
    /// The new handle of each old function.
    functions: HashMap<Handle<Function>, Handle<Function>>,
    /// The new handles of the functions of the arithmetic, by name.
    own: HashMap<String, Handle<Function>>,
}

/// Returns `module` with the functions in place of the operations.
///
/// # Errors
/// A message if the module lacks a function, or `held` where barriers are needed.
pub(in super::super) fn settle(module: &Module, info: &ModuleInfo, needs: Needs) -> Result<Module, String> {
    let mut settled = module.clone();
    let sizes = [VectorSize::Bi, VectorSize::Tri, VectorSize::Quad];
    let vector = |size| Type { name: None, inner: TypeInner::Vector { size, scalar: Scalar::F32 } };
    let types = Types { vectors: sizes.map(|size| settled.types.insert(vector(size), Span::UNDEFINED)) };
    let zero = zero_of(module);
    let mut context = Context { module, needs, types, zero, functions: HashMap::new(), own: HashMap::new() };
    settled.functions = Arena::new();
    // A function may call only those before it.
    for own in [true, false] {
        for (old, function) in module.functions.iter().filter(|(_, function)| is_own(function) == own) {
            let built = Body::build(&context, function, &info[old], own)?;
            let new = settled.functions.append(built, module.functions.get_span(old));
            context.functions.insert(old, new);
            if own {
                context.own.insert(function.name.clone().unwrap_or_default(), new);
            }
        }
    }
    for (k, entry) in module.entry_points.iter().enumerate() {
        settled.entry_points[k].function = Body::build(&context, &entry.function, info.get_entry_point(k), false)?;
    }
    Ok(settled)
}

/// Returns the member `zero` of the variable `held`.
fn zero_of(module: &Module) -> Option<Zero> {
    let (variable, held) = module.global_variables.iter().find(|(_, v)| v.name.as_deref() == Some("held"))?;
    let TypeInner::Struct { members, .. } = &module.types[held.ty].inner else { return None };
    let member = members.iter().position(|member| member.name.as_deref() == Some("zero"))?;
    Some(Zero { variable, member: member as u32 })
}

/// A function under construction.
struct Body<'a> {
    context: &'a Context<'a>,
    old: &'a Function,
    info: &'a FunctionInfo,
    /// Whether the function is one of the arithmetic, whose operations no call replaces.
    own: bool,
    expressions: Arena<Expression>,
    /// The new handle of each old expression.
    known: HashMap<Handle<Expression>, Handle<Expression>>,
    /// The statements of the innermost block.
    block: Block,
    /// First and last of the new expressions that no statement evaluates yet.
    pending: Option<(Handle<Expression>, Handle<Expression>)>,
}

type New = Result<Handle<Expression>, String>;

impl<'a> Body<'a> {
    fn build(
        context: &'a Context<'a>,
        old: &'a Function,
        info: &'a FunctionInfo,
        own: bool,
    ) -> Result<Function, String> {
        let mut body = Self {
            context,
            old,
            info,
            own,
            expressions: Arena::new(),
            known: HashMap::new(),
            block: Block::new(),
            pending: None,
        };
        let mut local_variables = Arena::new();
        for (handle, local) in old.local_variables.iter() {
            let init = local.init.map(|init| body.get(init)).transpose()?;
            let local = LocalVariable { init, ..local.clone() };
            local_variables.append(local, old.local_variables.get_span(handle));
        }
        let block = body.block(&old.body)?;
        let named = old.named_expressions.iter();
        let named = named.filter_map(|(handle, name)| Some((*body.known.get(handle)?, name.clone())));
        Ok(Function {
            named_expressions: named.collect(),
            local_variables,
            expressions: body.expressions,
            body: block,
            ..old.clone()
        })
    }

    fn inner(&self, handle: Handle<Expression>) -> &'a TypeInner {
        self.info[handle].ty.inner_with(&self.context.module.types)
    }

    /// Appends an expression that a statement has to evaluate.
    fn append(&mut self, expression: Expression) -> Handle<Expression> {
        let new = self.expressions.append(expression, Span::UNDEFINED);
        let first = self.pending.map_or(new, |(first, _)| first);
        self.pending = Some((first, new));
        new
    }

    /// Appends an expression that no statement evaluates: a constant, a variable, a result.
    fn append_given(&mut self, expression: Expression) -> Handle<Expression> {
        self.evaluate();
        self.expressions.append(expression, Span::UNDEFINED)
    }

    /// Adds the statement that evaluates what is pending.
    fn evaluate(&mut self) {
        if let Some((first, last)) = self.pending.take() {
            self.block.push(Statement::Emit(Range::new_from_bounds(first, last)), Span::UNDEFINED);
        }
    }

    /// Returns the new expression for an old one. One that no statement evaluated is a constant, a
    /// variable or an argument, and is appended now.
    fn get(&mut self, old: Handle<Expression>) -> New {
        if let Some(new) = self.known.get(&old) {
            return Ok(*new);
        }
        let expression = self.mapped(&self.old.expressions[old])?;
        let new = self.append_given(expression);
        self.known.insert(old, new);
        Ok(new)
    }

    fn get_some(&mut self, old: Option<Handle<Expression>>) -> Result<Option<Handle<Expression>>, String> {
        old.map(|old| self.get(old)).transpose()
    }

    fn get_all(&mut self, old: &[Handle<Expression>]) -> Result<Vec<Handle<Expression>>, String> {
        old.iter().map(|old| self.get(*old)).collect()
    }

    /// Returns an old expression with new operands.
    fn mapped(&mut self, old: &Expression) -> Result<Expression, String> {
        use Expression as E;
        Ok(match *old {
            E::Literal(_)
            | E::Constant(_)
            | E::Override(_)
            | E::ZeroValue(_)
            | E::FunctionArgument(_)
            | E::GlobalVariable(_)
            | E::LocalVariable(_)
            | E::AtomicResult { .. }
            | E::WorkGroupUniformLoadResult { .. }
            | E::SubgroupBallotResult
            | E::SubgroupOperationResult { .. } => old.clone(),
            E::CallResult(function) => E::CallResult(self.context.functions[&function]),
            E::Compose { ty, ref components } => E::Compose { ty, components: self.get_all(components)? },
            E::Access { base, index } => E::Access { base: self.get(base)?, index: self.get(index)? },
            E::AccessIndex { base, index } => E::AccessIndex { base: self.get(base)?, index },
            E::Splat { size, value } => E::Splat { size, value: self.get(value)? },
            E::Swizzle { size, vector, pattern } => E::Swizzle { size, vector: self.get(vector)?, pattern },
            E::Load { pointer } => E::Load { pointer: self.get(pointer)? },
            E::ImageLoad { image, coordinate, array_index, sample, level } => E::ImageLoad {
                image: self.get(image)?,
                coordinate: self.get(coordinate)?,
                array_index: self.get_some(array_index)?,
                sample: self.get_some(sample)?,
                level: self.get_some(level)?,
            },
            E::ImageQuery { image, query } => {
                let query = match query {
                    naga::ImageQuery::Size { level } => naga::ImageQuery::Size { level: self.get_some(level)? },
                    other => other,
                };
                E::ImageQuery { image: self.get(image)?, query }
            }
            E::Unary { op, expr } => E::Unary { op, expr: self.get(expr)? },
            E::Binary { op, left, right } => E::Binary { op, left: self.get(left)?, right: self.get(right)? },
            E::Select { condition, accept, reject } => {
                E::Select { condition: self.get(condition)?, accept: self.get(accept)?, reject: self.get(reject)? }
            }
            E::Derivative { axis, ctrl, expr } => E::Derivative { axis, ctrl, expr: self.get(expr)? },
            E::Relational { fun, argument } => E::Relational { fun, argument: self.get(argument)? },
            E::Math { fun, arg, arg1, arg2, arg3 } => E::Math {
                fun,
                arg: self.get(arg)?,
                arg1: self.get_some(arg1)?,
                arg2: self.get_some(arg2)?,
                arg3: self.get_some(arg3)?,
            },
            E::As { expr, kind, convert } => E::As { expr: self.get(expr)?, kind, convert },
            E::ArrayLength(base) => E::ArrayLength(self.get(base)?),
            ref other => return Err(format!("a kernel cannot have the expression {other:?}")),
        })
    }

    /// Appends the new form of an old expression that a statement evaluates.
    fn expression(&mut self, old: Handle<Expression>) -> New {
        let expression = &self.old.expressions[old];
        let (info, types) = (self.info, &self.context.module.types);
        let inner = |handle: Handle<Expression>| info[handle].ty.inner_with(types);
        match fate(expression, inner, self.context.needs) {
            Fate::Call(name) if !self.own => self.each_component(old, name),
            Fate::Select(fun) => self.selected(fun, old),
            Fate::Call("f32_divide" | "f32_sqrt") | Fate::Rounds if self.context.needs.barriers => {
                let mapped = self.mapped(expression)?;
                let rounded = self.append(mapped);
                self.barred(rounded, self.inner(old))
            }
            _ => {
                let mapped = self.mapped(expression)?;
                Ok(self.append(mapped))
            }
        }
    }

    /// Appends the comparisons and choices of `min`, `max` and `clamp`.
    fn selected(&mut self, fun: MathFunction, old: Handle<Expression>) -> New {
        let Expression::Math { arg, arg1, arg2, .. } = self.old.expressions[old] else {
            return Err(format!("no operation for {fun:?}"));
        };
        let (x, bounds) = (self.get(arg)?, [self.get_some(arg1)?, self.get_some(arg2)?]);
        let (least, most) = match (fun, bounds) {
            (MathFunction::Min, [bound, _]) => (None, bound),
            (MathFunction::Max, [bound, _]) => (bound, None),
            (_, [low, high]) => (low, high),
        };
        let raised = least.map_or(x, |bound| self.chosen(BinaryOperator::Greater, x, bound));
        Ok(most.map_or(raised, |bound| self.chosen(BinaryOperator::Less, raised, bound)))
    }

    /// Appends `left` where the comparison holds, else `right`.
    fn chosen(
        &mut self,
        op: BinaryOperator,
        left: Handle<Expression>,
        right: Handle<Expression>,
    ) -> Handle<Expression> {
        let condition = self.append(Expression::Binary { op, left, right });
        // `naga` folds a choice of constants to the earlier expression, so a statement of its own
        // evaluates it.
        self.evaluate();
        let chosen = self.append(Expression::Select { condition, accept: left, reject: right });
        self.evaluate();
        chosen
    }

    /// Appends calls of a function for each component of an operation.
    fn each_component(&mut self, old: Handle<Expression>, name: &str) -> New {
        let operands: Vec<Handle<Expression>> = match self.old.expressions[old] {
            Expression::Binary { left, right, .. } => vec![left, right],
            Expression::Math { arg, arg1, arg2, .. } => [Some(arg), arg1, arg2].into_iter().flatten().collect(),
            Expression::As { expr, .. } => vec![expr],
            _ => return Err(format!("no operation for {name}")),
        };
        let function = *self.context.own.get(name).ok_or_else(|| format!("{} has no {name}", super::ARITHMETIC))?;
        let new = self.get_all(&operands)?;
        let TypeInner::Vector { size, .. } = *self.inner(old) else { return Ok(self.call(function, new)) };
        let is_vector: Vec<bool> =
            operands.iter().map(|operand| matches!(self.inner(*operand), TypeInner::Vector { .. })).collect();
        let mut components = Vec::new();
        for index in 0..size as u32 {
            let mut arguments = Vec::new();
            for (&base, &is_vector) in new.iter().zip(&is_vector) {
                arguments.push(if is_vector { self.component(base, size as usize, index) } else { base });
            }
            components.push(self.call(function, arguments));
        }
        let ty = self.context.types.vectors[size as usize - 2];
        Ok(self.append(Expression::Compose { ty, components }))
    }

    /// Returns a component of a vector. `naga` folds the component of a vector that was just
    /// composed to the earlier expression, which no later statement may evaluate, so it is used
    /// right away. Overrides may be folded later, so a statement of its own evaluates it.
    fn component(&mut self, base: Handle<Expression>, size: usize, index: u32) -> Handle<Expression> {
        match &self.expressions[base] {
            Expression::Compose { components, .. } if components.len() == size => components[index as usize],
            Expression::Splat { value, .. } => *value,
            _ => {
                self.evaluate();
                let component = self.append(Expression::AccessIndex { base, index });
                self.evaluate();
                component
            }
        }
    }

    fn call(&mut self, function: Handle<Function>, arguments: Vec<Handle<Expression>>) -> Handle<Expression> {
        let result = self.append_given(Expression::CallResult(function));
        self.block.push(Statement::Call { function, arguments, result: Some(result) }, Span::UNDEFINED);
        result
    }

    /// Appends an exclusive or of a number, or of each component of a vector, with the zero.
    fn barred(&mut self, value: Handle<Expression>, inner: &TypeInner) -> New {
        let Some(Zero { variable, member }) = self.context.zero else {
            return Err("the device needs barriers, and the module has no held.zero (layout.wgsl)".into());
        };
        let base = self.append_given(Expression::GlobalVariable(variable));
        let pointer = self.append(Expression::AccessIndex { base, index: member });
        let mut zero = self.append(Expression::Load { pointer });
        if let TypeInner::Vector { size, .. } = *inner {
            zero = self.append(Expression::Splat { size, value: zero });
        }
        let bits = self.append(Expression::As { expr: value, kind: ScalarKind::Uint, convert: None });
        let op = BinaryOperator::ExclusiveOr;
        let expr = self.append(Expression::Binary { op, left: bits, right: zero });
        Ok(self.append(Expression::As { expr, kind: ScalarKind::Float, convert: None }))
    }

    fn block(&mut self, old: &Block) -> Result<Block, String> {
        let outer = std::mem::take(&mut self.block);
        for (statement, span) in old.span_iter() {
            if let Statement::Emit(range) = statement {
                for handle in range.clone() {
                    let new = self.expression(handle)?;
                    self.known.insert(handle, new);
                }
                continue;
            }
            let new = self.statement(statement)?;
            self.evaluate();
            self.block.push(new, *span);
        }
        self.evaluate();
        Ok(std::mem::replace(&mut self.block, outer))
    }

    fn statement(&mut self, old: &Statement) -> Result<Statement, String> {
        use Statement as S;
        // Blocks come after what they use.
        self.evaluate();
        Ok(match *old {
            S::Break | S::Continue | S::Kill | S::ControlBarrier(_) | S::MemoryBarrier(_) => old.clone(),
            S::Block(ref block) => S::Block(self.block(block)?),
            S::If { condition, ref accept, ref reject } => {
                let condition = self.get(condition)?;
                S::If { condition, accept: self.block(accept)?, reject: self.block(reject)? }
            }
            S::Switch { selector, ref cases } => {
                let selector = self.get(selector)?;
                let case = |case: &SwitchCase| Ok(SwitchCase { body: self.block(&case.body)?, ..*case });
                S::Switch { selector, cases: cases.iter().map(case).collect::<Result<_, String>>()? }
            }
            S::Loop { ref body, ref continuing, break_if } => {
                let (body, continuing) = (self.block(body)?, self.block(continuing)?);
                S::Loop { body, continuing, break_if: self.get_some(break_if)? }
            }
            S::Return { value } => S::Return { value: self.get_some(value)? },
            S::Store { pointer, value } => S::Store { pointer: self.get(pointer)?, value: self.get(value)? },
            S::Atomic { pointer, fun, value, result } => {
                let fun = match fun {
                    naga::AtomicFunction::Exchange { compare } => {
                        naga::AtomicFunction::Exchange { compare: self.get_some(compare)? }
                    }
                    other => other,
                };
                S::Atomic { pointer: self.get(pointer)?, fun, value: self.get(value)?, result: self.get_some(result)? }
            }
            S::WorkGroupUniformLoad { pointer, result } => {
                S::WorkGroupUniformLoad { pointer: self.get(pointer)?, result: self.get(result)? }
            }
            S::Call { function, ref arguments, result } => S::Call {
                function: self.context.functions[&function],
                arguments: self.get_all(arguments)?,
                result: self.get_some(result)?,
            },
            S::SubgroupBallot { result, predicate } => {
                S::SubgroupBallot { predicate: self.get_some(predicate)?, result: self.get(result)? }
            }
            S::SubgroupCollectiveOperation { op, collective_op, argument, result } => S::SubgroupCollectiveOperation {
                op,
                collective_op,
                argument: self.get(argument)?,
                result: self.get(result)?,
            },
            S::SubgroupGather { mode, argument, result } => {
                use naga::GatherMode as G;
                let mode = match mode {
                    G::Broadcast(at) => G::Broadcast(self.get(at)?),
                    G::Shuffle(at) => G::Shuffle(self.get(at)?),
                    G::ShuffleDown(at) => G::ShuffleDown(self.get(at)?),
                    G::ShuffleUp(at) => G::ShuffleUp(self.get(at)?),
                    G::ShuffleXor(at) => G::ShuffleXor(self.get(at)?),
                    G::QuadBroadcast(at) => G::QuadBroadcast(self.get(at)?),
                    other => other,
                };
                S::SubgroupGather { mode, argument: self.get(argument)?, result: self.get(result)? }
            }
            ref other => return Err(format!("a kernel cannot have the statement {other:?}")),
        })
    }
}

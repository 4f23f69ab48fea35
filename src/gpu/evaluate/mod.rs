//! Evaluates a WGSL function of one number on the processor, in f64: the twin of a kernel that a
//! user wrote.
//!
//! The evaluator interprets the function's naga IR: numbers, truth values, local variables,
//! branches, loops and calls. A function that needs more (vectors, memory) cannot be evaluated.

mod arithmetic;

use std::collections::HashMap;
use std::fmt;

use naga::{
    Arena, Block, Expression, Function, Handle, Module, RelationalFunction, ScalarKind, Statement, SwitchValue,
    TypeInner,
};

use naga::valid::Capabilities;

use super::interface::Interface;
use arithmetic::{binary, converted, math, of_literal, recast, unary};

/// Limit of loop rounds and function calls, counted together.
const MOST_ROUNDS: u32 = 10_000;

/// Limit of nested calls, which protects the evaluator's stack: WGSL has no recursion, so calls
/// end.
const DEEPEST: u32 = 64;

/// The reason why an evaluation gave no number.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// The function uses a feature, named here, that the evaluator does not support.
    Unsupported(String),
    /// Loop rounds and calls exceed [`MOST_ROUNDS`].
    Endless,
    /// The text is not valid WGSL by itself. Has the line and column of the fault, and its
    /// description.
    Invalid(Option<(u32, u32)>, String),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsupported(what) => write!(f, "it uses {what}"),
            Self::Endless => write!(f, "its loops take more than {MOST_ROUNDS} rounds"),
            Self::Invalid(_, what) => f.write_str(what),
        }
    }
}

/// A function from a number to a number, and the values of the overrides that it uses.
pub struct Evaluated {
    module: Module,
    function: Handle<Function>,
    overrides: HashMap<String, f64>,
}

/// A scalar. Integers wrap as on a device.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Value {
    Float(f64),
    Signed(i32),
    Unsigned(u32),
    Truth(bool),
}

/// How a block ends.
enum Flow {
    Next,
    Break,
    Continue,
    Return(Option<Value>),
}

fn unsupported<T>(what: impl Into<String>) -> Result<T, Fault> {
    Err(Fault::Unsupported(what.into()))
}

impl Evaluated {
    /// Parses `text` and finds its function `name`, which takes and returns one f32.
    ///
    /// # Errors
    /// [`Fault::Invalid`] if the text is not valid by itself, [`Fault::Unsupported`] if it has no
    /// such function.
    pub fn new(text: &str, name: &str, overrides: &[(&'static str, f64)]) -> Result<Self, Fault> {
        let Interface { module, .. } = Interface::of(text, Capabilities::empty()).map_err(|invalid| {
            let (at, sentence) = invalid.parts();
            Fault::Invalid(at, sentence)
        })?;
        let is_float = |ty| matches!(module.types[ty].inner, TypeInner::Scalar(scalar) if scalar == naga::Scalar::F32);
        let found = module.functions.iter().find(|(_, function)| function.name.as_deref() == Some(name));
        let fits = |function: &Function| {
            let result = function.result.as_ref().is_some_and(|result| is_float(result.ty));
            function.arguments.len() == 1 && is_float(function.arguments[0].ty) && result
        };
        let Some((function, _)) = found.filter(|(_, function)| fits(function)) else {
            return unsupported(format!("no function {name} from f32 to f32"));
        };
        let overrides = overrides.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
        Ok(Self { module, function, overrides })
    }

    /// Returns the function's value at `argument`.
    ///
    /// # Errors
    /// A [`Fault`] if the function gives no value.
    pub fn at(&self, argument: f64) -> Result<f64, Fault> {
        let mut rounds = 0;
        let function = &self.module.functions[self.function];
        match self.call(function, &[Value::Float(argument)], &mut rounds, 0)? {
            Some(Value::Float(value)) => Ok(value),
            _ => unsupported("a path without a result"),
        }
    }

    fn call(
        &self,
        function: &Function,
        arguments: &[Value],
        rounds: &mut u32,
        depth: u32,
    ) -> Result<Option<Value>, Fault> {
        *rounds += 1;
        if *rounds > MOST_ROUNDS {
            return Err(Fault::Endless);
        }
        if depth > DEEPEST {
            return unsupported(format!("more than {DEEPEST} calls inside each other"));
        }
        let mut call =
            Call { of: self, function, arguments, values: HashMap::new(), locals: HashMap::new(), rounds, depth };
        match call.block(&function.body)? {
            Flow::Return(value) => Ok(value),
            _ => Ok(None),
        }
    }

    /// Evaluates a constant expression of the module.
    fn global(&self, handle: Handle<Expression>) -> Result<Value, Fault> {
        let all = &self.module.global_expressions;
        match all[handle] {
            Expression::Literal(literal) => of_literal(literal),
            Expression::Constant(constant) => self.global(self.module.constants[constant].init),
            Expression::Override(which) => self.of_override(which),
            Expression::ZeroValue(ty) => self.zero(ty),
            Expression::Unary { op, expr } => unary(op, self.global(expr)?),
            Expression::Binary { op, left, right } => binary(op, self.global(left)?, self.global(right)?),
            Expression::As { expr, kind, convert: Some(1 | 4) } => converted(self.global(expr)?, kind),
            _ => unsupported("a constant that is no number"),
        }
    }

    fn of_override(&self, which: Handle<naga::Override>) -> Result<Value, Fault> {
        let declared = &self.module.overrides[which];
        let given = declared.name.as_ref().and_then(|name| self.overrides.get(name));
        match (given, declared.init, &self.module.types[declared.ty].inner) {
            // The device rounds overrides to f32.
            (Some(value), _, TypeInner::Scalar(scalar)) => {
                converted(Value::Float(f64::from(*value as f32)), scalar.kind)
            }
            (None, Some(init), _) => self.global(init),
            _ => unsupported("an override that has no value"),
        }
    }

    fn zero(&self, ty: Handle<naga::Type>) -> Result<Value, Fault> {
        match self.module.types[ty].inner {
            TypeInner::Scalar(scalar) if scalar.width == 4 || scalar.kind == ScalarKind::Bool => {
                converted(Value::Unsigned(0), scalar.kind)
            }
            _ => unsupported("vectors, arrays or structures"),
        }
    }
}

/// A call in progress.
struct Call<'a> {
    of: &'a Evaluated,
    function: &'a Function,
    arguments: &'a [Value],
    /// Values of expressions that statements evaluated.
    values: HashMap<Handle<Expression>, Value>,
    locals: HashMap<Handle<naga::LocalVariable>, Value>,
    rounds: &'a mut u32,
    depth: u32,
}

impl Call<'_> {
    fn block(&mut self, block: &Block) -> Result<Flow, Fault> {
        for statement in block.iter() {
            match self.statement(statement)? {
                Flow::Next => {}
                end => return Ok(end),
            }
        }
        Ok(Flow::Next)
    }

    fn statement(&mut self, statement: &Statement) -> Result<Flow, Fault> {
        match statement {
            Statement::Emit(range) => {
                for handle in range.clone() {
                    let value = self.evaluated(handle)?;
                    self.values.insert(handle, value);
                }
            }
            Statement::Block(block) => return self.block(block),
            Statement::If { condition, accept, reject } => {
                let taken = if self.truth(*condition)? { accept } else { reject };
                return self.block(taken);
            }
            Statement::Switch { selector, cases } => return self.switch(*selector, cases),
            Statement::Loop { body, continuing, break_if } => return self.repeated(body, continuing, *break_if),
            Statement::Break => return Ok(Flow::Break),
            Statement::Continue => return Ok(Flow::Continue),
            Statement::Return { value } => {
                return Ok(Flow::Return(value.map(|value| self.value(value)).transpose()?));
            }
            Statement::Store { pointer, value } => {
                let value = self.value(*value)?;
                let local = self.local(*pointer)?;
                self.locals.insert(local, value);
            }
            Statement::Call { function, arguments, result } => {
                let arguments = arguments.iter().map(|a| self.value(*a)).collect::<Result<Vec<_>, _>>()?;
                let function = &self.of.module.functions[*function];
                let value = self.of.call(function, &arguments, self.rounds, self.depth + 1)?;
                if let (Some(result), Some(value)) = (result, value) {
                    self.values.insert(*result, value);
                }
            }
            _ => return unsupported("memory that kernels share"),
        }
        Ok(Flow::Next)
    }

    fn switch(&mut self, selector: Handle<Expression>, cases: &[naga::SwitchCase]) -> Result<Flow, Fault> {
        let selected = match self.value(selector)? {
            Value::Signed(number) => SwitchValue::I32(number),
            Value::Unsigned(number) => SwitchValue::U32(number),
            _ => return unsupported("a switch of no number"),
        };
        let found = cases.iter().position(|case| case.value == selected);
        let from = found.or_else(|| cases.iter().position(|case| case.value == SwitchValue::Default));
        for case in cases.iter().skip(from.unwrap_or(cases.len())) {
            match self.block(&case.body)? {
                Flow::Break => break,
                Flow::Next if case.fall_through => {}
                Flow::Next => break,
                end => return Ok(end),
            }
        }
        Ok(Flow::Next)
    }

    fn repeated(
        &mut self,
        body: &Block,
        continuing: &Block,
        break_if: Option<Handle<Expression>>,
    ) -> Result<Flow, Fault> {
        loop {
            *self.rounds += 1;
            if *self.rounds > MOST_ROUNDS {
                return Err(Fault::Endless);
            }
            match self.block(body)? {
                Flow::Break => return Ok(Flow::Next),
                Flow::Return(value) => return Ok(Flow::Return(value)),
                Flow::Next | Flow::Continue => {}
            }
            self.block(continuing)?;
            if let Some(condition) = break_if
                && self.truth(condition)?
            {
                return Ok(Flow::Next);
            }
        }
    }

    fn truth(&mut self, handle: Handle<Expression>) -> Result<bool, Fault> {
        match self.value(handle)? {
            Value::Truth(truth) => Ok(truth),
            _ => unsupported("a condition of no truth value"),
        }
    }

    fn local(&self, pointer: Handle<Expression>) -> Result<Handle<naga::LocalVariable>, Fault> {
        match self.function.expressions[pointer] {
            Expression::LocalVariable(local) => Ok(local),
            _ => unsupported("memory other than variables of its own"),
        }
    }

    /// Returns the value that a statement stored for an expression, or evaluates the expression.
    fn value(&mut self, handle: Handle<Expression>) -> Result<Value, Fault> {
        match self.values.get(&handle) {
            Some(value) => Ok(*value),
            None => self.evaluated(handle),
        }
    }

    fn evaluated(&mut self, handle: Handle<Expression>) -> Result<Value, Fault> {
        let expressions: &Arena<Expression> = &self.function.expressions;
        match expressions[handle] {
            Expression::Literal(literal) => of_literal(literal),
            Expression::Constant(constant) => self.of.global(self.of.module.constants[constant].init),
            Expression::Override(which) => self.of.of_override(which),
            Expression::ZeroValue(ty) => self.of.zero(ty),
            Expression::FunctionArgument(index) => {
                self.arguments.get(index as usize).map_or_else(|| unsupported("a missing argument"), |value| Ok(*value))
            }
            Expression::Load { pointer } => {
                let local = self.local(pointer)?;
                if let Some(value) = self.locals.get(&local) {
                    return Ok(*value);
                }
                let variable = &self.function.local_variables[local];
                variable.init.map_or_else(|| self.of.zero(variable.ty), |init| self.value(init))
            }
            Expression::Unary { op, expr } => unary(op, self.value(expr)?),
            Expression::Binary { op, left, right } => binary(op, self.value(left)?, self.value(right)?),
            Expression::Select { condition, accept, reject } => {
                if self.truth(condition)? {
                    self.value(accept)
                } else {
                    self.value(reject)
                }
            }
            Expression::Relational { fun, argument } => match (fun, self.value(argument)?) {
                (RelationalFunction::IsNan, Value::Float(number)) => Ok(Value::Truth(number.is_nan())),
                (RelationalFunction::IsInf, Value::Float(number)) => Ok(Value::Truth(number.is_infinite())),
                (_, value) => Ok(value),
            },
            Expression::Math { fun, arg, arg1, arg2, .. } => {
                let [second, third] = [arg1, arg2].map(|arg| arg.map(|arg| self.value(arg)).transpose());
                math(fun, self.value(arg)?, second?, third?)
            }
            Expression::As { expr, kind, convert: Some(1 | 4) } => converted(self.value(expr)?, kind),
            Expression::As { expr, kind, convert: None } => recast(self.value(expr)?, kind),
            _ => unsupported("vectors, arrays or memory"),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::gpu::sources::FILES;

    fn of(body: &str) -> Result<Evaluated, Fault> {
        Evaluated::new(&format!("override P: f32 = 2.0;\nconst C: f32 = 3.0;\n{body}"), "f", &[("P", 2.5)])
    }

    fn at(body: &str, x: f64) -> Result<f64, Fault> {
        of(&format!("fn f(x: f32) -> f32 {{ {body} }}")).unwrap().at(x)
    }

    #[test]
    fn numbers_branches_loops_and_calls_are_evaluated() {
        let cases: [(&str, f64, f64); 9] = [
            ("return P * x + C;", 2.0, 8.0),
            ("if (x > 1.0) { return 1.0; } return sqrt(x);", 0.25, 0.5),
            ("var sum = 0.0; for (var i = 0u; i < 5u; i++) { sum += x; } return sum;", 1.5, 7.5),
            ("var y = x; loop { y *= 0.5; if (y < 0.1) { break; } continue; } return y;", 1.0, 0.0625),
            (
                "switch (u32(x)) { case 1u: { return 10.0; } case 2u, 3u: { return 20.0; } default: { return 30.0; } }",
                3.0,
                20.0,
            ),
            ("return select(-x, x, x < 0.0 || !(x == 4.0));", 4.0, -4.0),
            ("return smoothstep(0.0, 1.0, x) + f32(i32(x * 8.0) % 3);", 0.5, 1.5),
            ("return clamp(pow(x, 3.0), 0.0, 1.0) * exp(0.0) + mix(1.0, 3.0, x);", 0.5, 2.125),
            ("let a = bitcast<u32>(x); return bitcast<f32>(a & 0x7fffffffu);", -2.0, 2.0),
        ];
        for (body, x, expected) in cases {
            assert_eq!(at(body, x), Ok(expected), "{body}");
        }
        let called = of("fn g(x: f32) -> f32 { return x * x; } fn f(x: f32) -> f32 { return g(x) + g(2.0); }");
        assert_eq!(called.unwrap().at(3.0), Ok(13.0));
    }

    #[test]
    fn loops_without_end_and_what_is_not_known_are_faults() {
        assert_eq!(at("var y = x; loop { y += 1.0; if (y < x) { break; } } return y;", 1.0), Err(Fault::Endless));
        assert!(matches!(at("return length(vec2<f32>(x, 1.0));", 1.0), Err(Fault::Unsupported(_))));
        let other = of("fn f(x: vec2<f32>) -> f32 { return x.x; }");
        assert!(other.err().unwrap().to_string().contains("no function f"));
        let fault = of("fn f(x: f32) -> f32 { return elsewhere(x); }").err().unwrap();
        assert!(matches!(&fault, Fault::Invalid(Some((3, _)), what) if what.contains("elsewhere")), "{fault:?}");
        // The parser leaves the number of arguments to the validator.
        let two = of("fn g(a: f32, b: f32) -> f32 { return a + b; } fn f(x: f32) -> f32 { return g(x); }");
        assert!(matches!(two.err().unwrap(), Fault::Invalid(..)));
        // Each function calls the next twice: no loop, but a million calls.
        let mut text = String::from("fn f20(x: f32) -> f32 { return x; }");
        (0..20).for_each(|k| text += &format!("fn f{k}(x: f32) -> f32 {{ return f{}(x) + f{}(x); }}", k + 1, k + 1));
        assert_eq!(
            of(&format!("{text} fn f(x: f32) -> f32 {{ return f0(x); }}")).unwrap().at(1.0),
            Err(Fault::Endless)
        );
        assert!(at("return pow(x, 2.0);", -1.0).unwrap().is_nan());
    }

    /// The evaluator gives built-in kernels the values of their hand-written twins.
    #[test]
    fn built_in_kernels_have_the_values_of_their_twins() {
        for text in
            ["gaussian:0.4", "ellipse:6,3", "ellipse:2,4,smooth", "ellipse:5,2.5", "cone:1.5", "cone:2.2", "constant"]
        {
            let kernel: crate::scene::Kernel = text.parse().unwrap();
            let (file, overrides) = crate::passes::footprint::kernel_file(kernel);
            let (_, source) = FILES.iter().find(|(name, _)| *name == file).unwrap();
            let evaluated = Evaluated::new(source, "kernel_weight", &overrides).unwrap();
            for step in 0..=100 {
                let rho2 = f64::from(step) / 100.0;
                let weight = evaluated.at(rho2).unwrap();
                // Overrides are f32.
                let error = (weight.max(kernel.floor()) - kernel.weight(rho2)).abs();
                assert!(error < 1e-6, "{text} at {rho2}: {weight}");
            }
        }
    }
}

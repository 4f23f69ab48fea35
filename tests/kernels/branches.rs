//! No kernel branches on uniforms alone. Mesa's lavapipe compiles such a kernel again for every
//! frame, with the values in the place of the uniforms, and keeps all versions: memory grew by 0.3
//! to 2 MB a frame.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common;

use std::collections::{BTreeSet, HashMap};

use common::modules;
use epsplat::low_level::gpu::interface::reflect;
use naga::{AddressSpace, Arena, Block, Expression, Function, Handle, LocalVariable, Module, Statement};

/// The sources that a value depends on; the greatest of its parts decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    /// Literals, constants and overrides.
    Constant,
    /// Uniforms too.
    Uniform,
    /// Anything else.
    Varying,
}

struct Analysis<'a> {
    module: &'a Module,
    function: &'a Function,
    /// The kinds of the local variables.
    locals: HashMap<Handle<LocalVariable>, Kind>,
    /// The kinds of returned values.
    returned: &'a HashMap<Handle<Function>, Kind>,
}

impl Analysis<'_> {
    fn expressions(&self) -> &Arena<Expression> {
        &self.function.expressions
    }

    /// The kind of the memory that a pointer leads to.
    fn loaded(&self, pointer: Handle<Expression>) -> Kind {
        match self.expressions()[pointer] {
            Expression::GlobalVariable(variable) => {
                let variable = &self.module.global_variables[variable];
                // Entry points store uniforms in private copies (layout.wgsl).
                let is_copy = variable.name.as_deref().is_some_and(|name| name.starts_with("held"));
                match variable.space {
                    AddressSpace::Uniform => Kind::Uniform,
                    AddressSpace::Private if is_copy => Kind::Uniform,
                    _ => Kind::Varying,
                }
            }
            Expression::LocalVariable(local) => self.locals[&local],
            Expression::Access { base, index } => self.loaded(base).max(self.kind(index)),
            Expression::AccessIndex { base, .. } => self.loaded(base),
            _ => Kind::Varying,
        }
    }

    fn kind(&self, expression: Handle<Expression>) -> Kind {
        let all = |parts: &[Handle<Expression>]| parts.iter().map(|part| self.kind(*part)).max();
        let joined = |parts: &[Handle<Expression>]| all(parts).unwrap_or(Kind::Constant);
        match &self.expressions()[expression] {
            Expression::Literal(_) | Expression::Constant(_) | Expression::Override(_) | Expression::ZeroValue(_) => {
                Kind::Constant
            }
            Expression::Load { pointer } => self.loaded(*pointer),
            Expression::CallResult(function) => self.returned.get(function).copied().unwrap_or(Kind::Varying),
            Expression::Compose { components, .. } => joined(components),
            Expression::Access { base, index } => joined(&[*base, *index]),
            Expression::AccessIndex { base, .. } => self.kind(*base),
            Expression::Splat { value, .. } => self.kind(*value),
            Expression::Swizzle { vector, .. } => self.kind(*vector),
            Expression::Unary { expr, .. } | Expression::As { expr, .. } => self.kind(*expr),
            Expression::Binary { left, right, .. } => joined(&[*left, *right]),
            Expression::Select { condition, accept, reject } => joined(&[*condition, *accept, *reject]),
            Expression::Relational { argument, .. } => self.kind(*argument),
            Expression::Math { arg, arg1, arg2, arg3, .. } => {
                let more: Vec<_> = [Some(*arg), *arg1, *arg2, *arg3].into_iter().flatten().collect();
                joined(&more)
            }
            _ => Kind::Varying,
        }
    }

    /// The variable that a pointer leads into.
    fn root(&self, pointer: Handle<Expression>) -> Option<Handle<LocalVariable>> {
        match self.expressions()[pointer] {
            Expression::LocalVariable(local) => Some(local),
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => self.root(base),
            _ => None,
        }
    }
}

/// Calls `visit` for each statement of a block and of the blocks in it.
fn each(block: &Block, visit: &mut dyn FnMut(&Statement)) {
    for statement in block {
        visit(statement);
        match statement {
            Statement::Block(inner) => each(inner, visit),
            Statement::If { accept, reject, .. } => [accept, reject].into_iter().for_each(|inner| each(inner, visit)),
            Statement::Switch { cases, .. } => cases.iter().for_each(|case| each(&case.body, visit)),
            Statement::Loop { body, continuing, .. } => {
                [body, continuing].into_iter().for_each(|inner| each(inner, visit));
            }
            _ => {}
        }
    }
}

/// Analyses a function: returns what its variables hold.
fn analysed<'a>(
    module: &'a Module,
    function: &'a Function,
    returned: &'a HashMap<Handle<Function>, Kind>,
) -> Analysis<'a> {
    let locals = function.local_variables.iter().map(|(local, _)| (local, Kind::Constant)).collect();
    let mut analysis = Analysis { module, function, locals, returned };
    loop {
        let mut stored: Vec<(Handle<LocalVariable>, Kind)> = function
            .local_variables
            .iter()
            .filter_map(|(local, variable)| Some((local, analysis.kind(variable.init?))))
            .collect();
        each(&function.body, &mut |statement| match statement {
            Statement::Store { pointer, value } => {
                stored.extend(analysis.root(*pointer).map(|local| (local, analysis.kind(*value))));
            }
            // A function may store anything through a pointer.
            Statement::Call { arguments, .. } => {
                stored.extend(arguments.iter().filter_map(|at| analysis.root(*at)).map(|local| (local, Kind::Varying)));
            }
            _ => {}
        });
        let mut grew = false;
        for (local, kind) in stored {
            let held = analysis.locals.get_mut(&local).unwrap();
            grew |= kind > *held;
            *held = kind.max(*held);
        }
        if !grew {
            return analysis;
        }
    }
}

/// The names of the functions that branch on uniforms alone.
fn branching(module: &Module) -> BTreeSet<String> {
    let mut returned = HashMap::new();
    let mut found = BTreeSet::new();
    let mut look = |function: &Function, returned: &HashMap<Handle<Function>, Kind>| {
        let analysis = analysed(module, function, returned);
        let mut result = None;
        each(&function.body, &mut |statement| {
            let condition = match statement {
                Statement::If { condition, .. } => Some(*condition),
                Statement::Switch { selector, .. } => Some(*selector),
                Statement::Loop { break_if, .. } => *break_if,
                Statement::Return { value: Some(value) } => {
                    result = result.max(Some(analysis.kind(*value)));
                    None
                }
                _ => None,
            };
            if condition.is_some_and(|condition| analysis.kind(condition) == Kind::Uniform) {
                found.insert(function.name.clone().unwrap_or_default());
            }
        });
        result.unwrap_or(Kind::Varying)
    };
    // Functions come after those that they call.
    for (handle, function) in module.functions.iter() {
        let kind = look(function, &returned);
        returned.insert(handle, kind);
    }
    for entry in &module.entry_points {
        look(&entry.function, &returned);
    }
    found
}

#[test]
fn no_kernel_branches_on_uniforms_alone() {
    let found: BTreeSet<String> =
        modules::different().iter().flat_map(|made| branching(&made.reflected().module)).collect();
    // Loops over rows, columns, roots and levels, which may hold barriers and so have to end by
    // uniforms. The driver keeps no versions of these.
    let known = ["fragments_of_rows", "reach_roots", "select_top", "start_pixels", "start_rows"];
    assert_eq!(found, known.into_iter().map(str::to_owned).collect());
}

#[test]
fn branches_on_uniforms_are_noticed() {
    let found = |body: &str| {
        let text = format!(
            "struct View {{ width: u32, lights: array<vec4<f32>, 4> }}
             @group(0) @binding(0) var<uniform> view: View;
             @group(0) @binding(1) var<storage, read_write> sums: array<u32>;
             var<private> held: View;
             override LIGHTS: u32 = 2u;
             fn wide() -> u32 {{ return held.width / 8u; }}
             @compute @workgroup_size(64) fn run(@builtin(global_invocation_id) at: vec3<u32>) {{
                 held = view;
                 {body}
             }}"
        );
        !branching(&reflect(&text).unwrap().0).is_empty()
    };
    for alone in [
        "if (held.width > 3u) { sums[0] = 1u; }",
        "for (var i = 0u; i < held.width; i++) { sums[i] = 1u; }",
        "for (var i = 0u; i < LIGHTS; i++) { if (held.lights[i].x == 0.0) { sums[i] = 1u; } }",
        "let most = wide() * 2u; if (most > 7u) { sums[0] = 1u; }",
        "switch (view.width) { case 1u: { sums[0] = 1u; } default: {} }",
    ] {
        assert!(found(alone), "{alone}");
    }
    for other in [
        "if (at.x < held.width) { sums[at.x] = 1u; }",
        "for (var i = 0u; i < LIGHTS; i++) { sums[i] = held.width; }",
        "if (sums[0] > held.width) { sums[1] = 1u; }",
        "for (var i = at.x; i < held.width; i++) { sums[i] = 1u; }",
        "sums[0] = select(1u, 2u, held.width > 3u);",
    ] {
        assert!(!found(other), "{other}");
    }
}

//! Replaces those operations of a module whose bits depend on the adapter by functions of
//! `wgsl/common/arithmetic.wgsl`, whose bits do not.
//!
//! Kernels say `a / b`, `sqrt(x)`, `exp(x)`. WGSL allows a driver 2.5 units in the last place for a
//! quotient, and more for powers. Every adapter gives the same bits for sums, differences and
//! products that are rounded one by one, for comparisons, and for integers. The functions are built
//! from these alone. The module is rewritten in the form in which `naga` holds it, so no kernel has
//! to name a function, and a kernel of a user gets the same arithmetic.
//!
//! Vulkan keeps sums and products apart by a decoration (`src/gpu/spirv.rs`). Other interfaces have
//! none. There, every result passes an exclusive or with a zero that the compiler does not know:
//! one integer instruction, and no compiler computes `a * b + c` or `(a + b) - a` across it.
//!
//! Operations that are left as they are: those whose results are exact (`abs`, `sign`, `floor`,
//! `ceil`, `round`, conversions of `i32`), and those that the built-in kernels do not use
//! ([`open`] lists them).

mod rewrite;

use std::collections::HashSet;
use std::sync::LazyLock;

use naga::valid::Capabilities;
use naga::{BinaryOperator, Expression, Function, Handle, MathFunction, Scalar, ScalarKind, TypeInner};

pub(super) use rewrite::settle;

use super::interface::Interface;
use super::sources::FILES;

/// The file of the functions, which is appended to every module.
pub(super) const ARITHMETIC: &str = "arithmetic.wgsl";

/// How a module is rewritten for an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Needs {
    /// Whether quotients and roots are replaced; processors round them correctly themselves.
    pub division: bool,
    /// Whether conversions from u32 are replaced; most processors round them correctly.
    pub integers: bool,
    /// Whether results of sums and products pass a barrier.
    pub barriers: bool,
}

/// The form that an operation takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    /// The function of this name computes it, component by component.
    Call(&'static str),
    /// A comparison chooses its result: it is `min`, `max` or `clamp`.
    ///
    /// WGSL lets them return either argument where one is NaN; now the bound comes out if `x` is
    /// NaN in `min(x, bound)`.
    Select(MathFunction),
    /// It is a sum, a difference or a product, or a quotient that the device rounds to nearest.
    Rounds,
    /// Its result is exact, or it is no operation on f32.
    Exact,
    /// Its bits depend on the adapter, and no function replaces it.
    Open,
}

/// Decides the form that an expression takes. `inner` returns the type of an operand.
fn fate<'a>(
    expression: &Expression,
    inner: impl Fn(Handle<Expression>) -> &'a TypeInner,
    Needs { division, integers, .. }: Needs,
) -> Fate {
    use {BinaryOperator as B, MathFunction as M};
    let is_float = |handle| inner(handle).scalar_kind() == Some(ScalarKind::Float);
    let divided = |name| if division { Fate::Call(name) } else { Fate::Rounds };
    match *expression {
        Expression::Binary { op, left, right } if is_float(left) => match op {
            B::Add | B::Subtract => Fate::Rounds,
            B::Multiply if [left, right].map(&inner).iter().any(|ty| matches!(ty, TypeInner::Matrix { .. })) => {
                Fate::Open
            }
            B::Multiply => Fate::Rounds,
            B::Divide => divided("f32_divide"),
            B::Modulo => Fate::Open,
            _ => Fate::Exact,
        },
        Expression::Math { fun, arg, .. } if is_float(arg) => match fun {
            M::Min | M::Max | M::Clamp => Fate::Select(fun),
            M::Mix => Fate::Call("f32_mix"),
            M::Fract => Fate::Call("f32_fract"),
            M::Sqrt => divided("f32_sqrt"),
            M::InverseSqrt if division => Fate::Call("f32_inverse_sqrt"),
            M::InverseSqrt => Fate::Call("f32_inverse_sqrt_native"),
            M::Exp => Fate::Call("f32_exp"),
            M::Exp2 => Fate::Call("f32_exp2"),
            M::Log => Fate::Call("f32_log"),
            M::Log2 => Fate::Call("f32_log2"),
            M::Pow => Fate::Call("f32_pow"),
            M::Abs | M::Sign | M::Floor | M::Ceil | M::Trunc | M::Round => Fate::Exact,
            _ => Fate::Open,
        },
        Expression::Math {
            fun: M::Unpack4x8snorm | M::Unpack4x8unorm | M::Unpack2x16snorm | M::Unpack2x16unorm | M::Unpack2x16float,
            ..
        } => Fate::Open,
        Expression::As { expr, kind: ScalarKind::Float, convert: Some(4) }
            if inner(expr).scalar() == Some(Scalar::U32) =>
        {
            if integers {
                Fate::Call("f32_of_u32")
            } else {
                Fate::Exact
            }
        }
        // Integers of 64 bits and floats of other sizes.
        Expression::As { expr, kind: ScalarKind::Float, convert: Some(width) }
            if width != 4 || inner(expr).scalar_width() == Some(8) =>
        {
            Fate::Open
        }
        Expression::Derivative { .. } | Expression::ImageSample { .. } => Fate::Open,
        _ => Fate::Exact,
    }
}

/// Whether a function is one of [`ARITHMETIC`].
fn is_own(function: &Function) -> bool {
    static NAMES: LazyLock<HashSet<&str>> = LazyLock::new(|| {
        let text = FILES.iter().find(|(name, _)| *name == ARITHMETIC).map_or("", |(_, text)| text);
        text.lines().filter_map(|line| line.strip_prefix("fn ")?.split('(').next()).collect()
    });
    function.name.as_deref().is_some_and(|name| NAMES.contains(name))
}

/// Lists what in a module may have other bits on another adapter, each with its function; empty if
/// nothing may.
///
/// These are operations that no function replaces, and entry points whose barriers lack the zero
/// because they call neither `hold` nor `hold_view` (`layout.wgsl`). The functions of
/// `arithmetic.wgsl` are left out: integers correct the quotients and roots there.
///
/// # Errors
/// A message if the text is not valid WGSL, or cannot be rewritten.
pub fn open(text: &str) -> Result<Vec<String>, String> {
    let text = super::sources::Text::alone(text).joined;
    let all = Capabilities::all();
    let interface = Interface::of(&text, all).map_err(|invalid| invalid.told(|line| Some(("line", line))))?;
    let (module, info) = (&interface.module, &interface.info);
    let needs = Needs { division: true, integers: true, barriers: true };
    let functions = module.functions.iter().filter(|(_, f)| !is_own(f)).map(|(handle, f)| (f, &info[handle]));
    let entries = module.entry_points.iter().enumerate().map(|(k, entry)| (&entry.function, info.get_entry_point(k)));
    let mut told = Vec::new();
    for (function, info) in functions.chain(entries) {
        let inner = |handle: Handle<Expression>| info[handle].ty.inner_with(&module.types);
        for (_, expression) in function.expressions.iter() {
            if fate(expression, inner, needs) == Fate::Open {
                told.push(format!("{}: {expression:?}", function.name.as_deref().unwrap_or("an entry point")));
            }
        }
    }
    let settled = interface.settled(all, needs)?;
    let variable = |name: &str| {
        let mut all = settled.module.global_variables.iter();
        all.find(|(_, variable)| variable.name.as_deref() == Some(name)).map(|(handle, _)| handle)
    };
    for (k, entry) in settled.module.entry_points.iter().enumerate() {
        let info = settled.info.get_entry_point(k);
        let uses = |name: &str| variable(name).is_some_and(|handle| !info[handle].is_empty());
        if uses("held") && !uses("view") {
            told.push(format!("{}: no zero is held", entry.name));
        }
    }
    Ok(told)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use naga::Module;

    const TEXT: &str = "
        struct View { zero: u32 }
        @group(0) @binding(0) var<uniform> view: View;
        @group(0) @binding(1) var<storage, read_write> numbers: array<vec3<f32>>;
        var<private> held: View;
        override BY: f32 = 3.0;
        fn turned(a: vec3<f32>, n: u32) -> vec3<f32> {
            var sum = vec3<f32>(0.5, 1.0, BY);
            for (var k = 0u; k < n; k++) {
                if (sum.x > 9.0) { continue; }
                switch (k % 3u) {
                    case 1u: { sum += max(a, vec3<f32>(0.0)) / f32(k + 1u); }
                    default: { sum *= clamp(sqrt(a), vec3<f32>(0.0), sum); }
                }
            }
            return sum;
        }
        @compute @workgroup_size(64)
        fn run(@builtin(global_invocation_id) id: vec3<u32>) {
            held = view;
            numbers[id.x] = turned(numbers[id.x], id.y) * (1.0 / BY) - 1.0;
        }";

    fn settled(text: &str, needs: Needs) -> Result<Module, String> {
        let (_, arithmetic) = FILES.iter().find(|(name, _)| *name == ARITHMETIC).unwrap();
        let interface = Interface::of(&format!("{text}\n{arithmetic}"), Capabilities::empty()).unwrap();
        settle(&interface.module, &interface.info, needs)
    }

    /// Names of the functions that a function of the module calls, in the order of the calls.
    fn calls(module: &Module, name: &str) -> Vec<String> {
        let (_, function) = module.functions.iter().find(|(_, f)| f.name.as_deref() == Some(name)).unwrap();
        let called = |(_, expression): (_, &Expression)| match expression {
            Expression::CallResult(handle) => module.functions[*handle].name.clone(),
            _ => None,
        };
        function.expressions.iter().filter_map(called).collect()
    }

    #[test]
    fn each_component_becomes_a_call_and_the_module_stays_valid() {
        let all = Needs { division: true, integers: true, barriers: false };
        let module = settled(TEXT, all).unwrap();
        Interface::validated(module.clone(), Capabilities::empty()).unwrap();
        let called = calls(&module, "turned");
        let count = |name: &str| called.iter().filter(|called| *called == name).count();
        assert_eq!(["f32_divide", "f32_of_u32", "f32_sqrt"].map(count), [3, 1, 3], "{called:?}");
        let native = settled(TEXT, Needs { division: false, integers: false, barriers: false }).unwrap();
        assert_eq!(calls(&native, "turned").len(), called.len() - 7);
    }

    #[test]
    fn every_sum_and_product_passes_a_barrier() {
        let ors = |needs| {
            let module = settled(TEXT, needs).unwrap();
            Interface::validated(module.clone(), Capabilities::empty()).unwrap();
            let (_, turned) = module.functions.iter().find(|(_, f)| f.name.as_deref() == Some("turned")).unwrap();
            let is_or = |e: &Expression| matches!(e, Expression::Binary { op: BinaryOperator::ExclusiveOr, .. });
            let of = |function: &Function| function.expressions.iter().filter(|(_, e)| is_or(e)).count();
            [of(turned), of(&module.entry_points[0].function)]
        };
        assert_eq!(ors(Needs { division: true, integers: true, barriers: false }), [0, 0]);
        // sum + ..., sum * ...; turned * ..., ... - 1; 1 / BY is a call.
        assert_eq!(ors(Needs { division: true, integers: true, barriers: true }), [2, 2]);
        // The quotients and roots, too.
        assert_eq!(ors(Needs { division: false, integers: true, barriers: true }), [4, 3]);
        let without = TEXT.replace("held", "kept");
        let message = settled(&without, Needs { division: true, integers: true, barriers: true }).unwrap_err();
        assert!(message.contains("held"), "{message}");
    }
}

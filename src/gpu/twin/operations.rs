//! Operations on scalars of 32 bits, as bits. A truth value is 0 or 1.

use naga::{BinaryOperator as B, MathFunction as M, ScalarKind, UnaryOperator};

/// A function of two scalars.
pub(super) type Two = fn(u32, u32) -> u32;

/// A function of as many scalars as it has arguments.
#[derive(Clone, Copy)]
pub(super) enum Math {
    One(fn(u32) -> u32),
    Two(Two),
    Three(fn(u32, u32, u32) -> u32),
}

/// Returns a binary operation on scalars of one kind.
pub(super) fn binary(op: B, kind: ScalarKind) -> Result<Two, String> {
    match kind {
        ScalarKind::Float => float(op),
        ScalarKind::Sint => Ok(signed(op).unwrap_or_else(|| integer(op))),
        _ => Ok(integer(op)),
    }
}

fn integer(op: B) -> Two {
    match op {
        B::Add => u32::wrapping_add,
        B::Subtract => u32::wrapping_sub,
        B::Multiply => u32::wrapping_mul,
        // WGSL: a division by zero gives the dividend, and a remainder 0.
        B::Divide => |a, b| a.checked_div(b).unwrap_or(a),
        B::Modulo => |a, b| a.checked_rem(b).unwrap_or(0),
        B::Equal => |a, b| u32::from(a == b),
        B::NotEqual => |a, b| u32::from(a != b),
        B::Less => |a, b| u32::from(a < b),
        B::LessEqual => |a, b| u32::from(a <= b),
        B::Greater => |a, b| u32::from(a > b),
        B::GreaterEqual => |a, b| u32::from(a >= b),
        B::And | B::LogicalAnd => |a, b| a & b,
        B::InclusiveOr | B::LogicalOr => |a, b| a | b,
        B::ExclusiveOr => |a, b| a ^ b,
        B::ShiftLeft => u32::wrapping_shl,
        B::ShiftRight => u32::wrapping_shr,
    }
}

/// Returns an operation on i32; `None` if it is the one on u32.
fn signed(op: B) -> Option<Two> {
    Some(match op {
        B::Divide => |a, b| if b == 0 { a } else { (a as i32).wrapping_div(b as i32) as u32 },
        B::Modulo => |a, b| if b == 0 { 0 } else { (a as i32).wrapping_rem(b as i32) as u32 },
        B::Less => |a, b| u32::from((a as i32) < b as i32),
        B::LessEqual => |a, b| u32::from(a as i32 <= b as i32),
        B::Greater => |a, b| u32::from(a as i32 > b as i32),
        B::GreaterEqual => |a, b| u32::from(a as i32 >= b as i32),
        B::ShiftRight => |a, b| (a as i32).wrapping_shr(b) as u32,
        _ => return None,
    })
}

fn float(op: B) -> Result<Two, String> {
    const fn of(bits: u32) -> f32 {
        f32::from_bits(bits)
    }
    Ok(match op {
        B::Add => |a, b| (of(a) + of(b)).to_bits(),
        B::Subtract => |a, b| (of(a) - of(b)).to_bits(),
        B::Multiply => |a, b| (of(a) * of(b)).to_bits(),
        B::Divide => |a, b| (of(a) / of(b)).to_bits(),
        B::Equal => |a, b| u32::from(of(a) == of(b)),
        B::NotEqual => |a, b| u32::from(of(a) != of(b)),
        B::Less => |a, b| u32::from(of(a) < of(b)),
        B::LessEqual => |a, b| u32::from(of(a) <= of(b)),
        B::Greater => |a, b| u32::from(of(a) > of(b)),
        B::GreaterEqual => |a, b| u32::from(of(a) >= of(b)),
        _ => return Err(format!("{op:?} of f32")),
    })
}

pub(super) fn unary(op: UnaryOperator, kind: ScalarKind) -> fn(u32) -> u32 {
    match (op, kind) {
        (UnaryOperator::Negate, ScalarKind::Float) => |a| (-f32::from_bits(a)).to_bits(),
        (UnaryOperator::Negate, _) => u32::wrapping_neg,
        (UnaryOperator::LogicalNot, _) => |a| u32::from(a == 0),
        (UnaryOperator::BitwiseNot, _) => |a| !a,
    }
}

/// Returns a function of scalars. Those whose bits depend on the adapter have been replaced
/// (`src/gpu/exact`), and so have `min`, `max` and `clamp` of f32.
pub(super) fn math(fun: M, kind: ScalarKind) -> Result<Math, String> {
    use ScalarKind::{Float, Sint, Uint};
    Ok(match (fun, kind) {
        (M::Abs, Float) => Math::One(|a| f32::from_bits(a).abs().to_bits()),
        (M::Floor, Float) => Math::One(|a| f32::from_bits(a).floor().to_bits()),
        (M::Ceil, Float) => Math::One(|a| f32::from_bits(a).ceil().to_bits()),
        (M::Trunc, Float) => Math::One(|a| f32::from_bits(a).trunc().to_bits()),
        (M::Round, Float) => Math::One(|a| f32::from_bits(a).round_ties_even().to_bits()),
        (M::Sqrt, Float) => Math::One(|a| f32::from_bits(a).sqrt().to_bits()),
        (M::Sign, Float) => Math::One(|a| {
            let x = f32::from_bits(a);
            if x == 0.0 || x.is_nan() { 0 } else { x.signum().to_bits() }
        }),
        (M::Abs, Sint) => Math::One(|a| (a as i32).unsigned_abs()),
        (M::Abs, Uint) => Math::One(|a| a),
        (M::Min, Sint) => Math::Two(|a, b| (a as i32).min(b as i32) as u32),
        (M::Max, Sint) => Math::Two(|a, b| (a as i32).max(b as i32) as u32),
        (M::Clamp, Sint) => Math::Three(|a, low, high| (a as i32).max(low as i32).min(high as i32) as u32),
        (M::Min, Uint) => Math::Two(u32::min),
        (M::Max, Uint) => Math::Two(u32::max),
        (M::Clamp, Uint) => Math::Three(|a, low, high| a.max(low).min(high)),
        (M::CountOneBits, Sint | Uint) => Math::One(u32::count_ones),
        (M::CountLeadingZeros, Sint | Uint) => Math::One(u32::leading_zeros),
        (M::CountTrailingZeros, Sint | Uint) => Math::One(u32::trailing_zeros),
        (M::FirstTrailingBit, Sint | Uint) => Math::One(|a| if a == 0 { u32::MAX } else { a.trailing_zeros() }),
        (M::FirstLeadingBit, Uint) => Math::One(|a| if a == 0 { u32::MAX } else { 31 - a.leading_zeros() }),
        (M::ReverseBits, Sint | Uint) => Math::One(u32::reverse_bits),
        _ => return Err(format!("{fun:?} of {kind:?}")),
    })
}

/// Returns the conversion of a scalar to another kind. Numbers out of the range become the nearest
/// that f32 holds, as with the translators.
pub(super) fn conversion(from: ScalarKind, to: ScalarKind) -> Result<fn(u32) -> u32, String> {
    use ScalarKind as K;
    Ok(match (from, to) {
        (K::Float, K::Uint) => |a| f32::from_bits(a).clamp(0.0, 4_294_967_040.0) as u32,
        (K::Float, K::Sint) => |a| f32::from_bits(a).clamp(-2_147_483_648.0, 2_147_483_520.0) as i32 as u32,
        (K::Float, K::Bool) => |a| u32::from(f32::from_bits(a) != 0.0),
        (_, K::Bool) => |a| u32::from(a != 0),
        (K::Bool | K::Uint, K::Float) => |a| (a as f32).to_bits(),
        (K::Sint, K::Float) => |a| (a as i32 as f32).to_bits(),
        (_, K::Float | K::Uint | K::Sint) => |a| a,
        _ => return Err(format!("a conversion from {from:?} to {to:?}")),
    })
}

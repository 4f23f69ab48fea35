//! Operations on scalars of 32 bits, as bits. A truth value is 0 or 1.

use naga::{BinaryOperator as B, MathFunction as M, ScalarKind, UnaryOperator};

/// Returns the value of a binary operation on scalars of one kind.
pub(super) fn binary(op: B, kind: ScalarKind, a: u32, b: u32) -> Result<u32, String> {
    if kind == ScalarKind::Float {
        return float(op, f32::from_bits(a), f32::from_bits(b));
    }
    let signed = kind == ScalarKind::Sint;
    let less = if signed { (a as i32) < b as i32 } else { a < b };
    Ok(match op {
        B::Add => a.wrapping_add(b),
        B::Subtract => a.wrapping_sub(b),
        B::Multiply => a.wrapping_mul(b),
        // WGSL: a division by zero gives the dividend, and a remainder 0.
        B::Divide if b == 0 => a,
        B::Modulo if b == 0 => 0,
        B::Divide if signed => (a as i32).wrapping_div(b as i32) as u32,
        B::Modulo if signed => (a as i32).wrapping_rem(b as i32) as u32,
        B::Divide => a / b,
        B::Modulo => a % b,
        B::Equal => u32::from(a == b),
        B::NotEqual => u32::from(a != b),
        B::Less => u32::from(less),
        B::LessEqual => u32::from(less || a == b),
        B::Greater => u32::from(!less && a != b),
        B::GreaterEqual => u32::from(!less),
        B::And | B::LogicalAnd => a & b,
        B::InclusiveOr | B::LogicalOr => a | b,
        B::ExclusiveOr => a ^ b,
        B::ShiftLeft => a.wrapping_shl(b),
        B::ShiftRight if signed => (a as i32).wrapping_shr(b) as u32,
        B::ShiftRight => a.wrapping_shr(b),
    })
}

fn float(op: B, a: f32, b: f32) -> Result<u32, String> {
    match op {
        B::Add => Ok((a + b).to_bits()),
        B::Subtract => Ok((a - b).to_bits()),
        B::Multiply => Ok((a * b).to_bits()),
        B::Divide => Ok((a / b).to_bits()),
        B::Equal => Ok(u32::from(a == b)),
        B::NotEqual => Ok(u32::from(a != b)),
        B::Less => Ok(u32::from(a < b)),
        B::LessEqual => Ok(u32::from(a <= b)),
        B::Greater => Ok(u32::from(a > b)),
        B::GreaterEqual => Ok(u32::from(a >= b)),
        _ => Err(format!("{op:?} of f32")),
    }
}

pub(super) fn unary(op: UnaryOperator, kind: ScalarKind, a: u32) -> u32 {
    match (op, kind) {
        (UnaryOperator::Negate, ScalarKind::Float) => (-f32::from_bits(a)).to_bits(),
        (UnaryOperator::Negate, _) => a.wrapping_neg(),
        (UnaryOperator::LogicalNot, _) => u32::from(a == 0),
        (UnaryOperator::BitwiseNot, _) => !a,
    }
}

/// Returns the value of a function of scalars. Those whose bits depend on the adapter have been
/// replaced (`src/gpu/exact`).
pub(super) fn math(fun: M, kind: ScalarKind, a: u32, b: u32, c: u32) -> Result<u32, String> {
    let x = f32::from_bits(a);
    let less = |a: u32, b: u32| binary(B::Less, kind, a, b).map(|less| less == 1);
    match (fun, kind) {
        (M::Abs, ScalarKind::Float) => Ok(x.abs().to_bits()),
        (M::Floor, _) => Ok(x.floor().to_bits()),
        (M::Ceil, _) => Ok(x.ceil().to_bits()),
        (M::Trunc, _) => Ok(x.trunc().to_bits()),
        (M::Round, _) => Ok(x.round_ties_even().to_bits()),
        (M::Sqrt, _) => Ok(x.sqrt().to_bits()),
        (M::Sign, ScalarKind::Float) if x == 0.0 || x.is_nan() => Ok(0),
        (M::Sign, ScalarKind::Float) => Ok(x.signum().to_bits()),
        (M::Abs, ScalarKind::Sint) => Ok((a as i32).unsigned_abs()),
        (M::Abs, _) => Ok(a),
        (M::Min, _) => Ok(if less(a, b)? { a } else { b }),
        (M::Max, _) => Ok(if less(a, b)? { b } else { a }),
        (M::Clamp, _) => {
            let raised = if less(a, b)? { b } else { a };
            Ok(if less(raised, c)? { raised } else { c })
        }
        (M::CountOneBits, _) => Ok(a.count_ones()),
        (M::CountLeadingZeros, _) => Ok(a.leading_zeros()),
        (M::CountTrailingZeros, _) => Ok(a.trailing_zeros()),
        (M::FirstTrailingBit, _) => Ok(if a == 0 { u32::MAX } else { a.trailing_zeros() }),
        (M::FirstLeadingBit, ScalarKind::Uint) => Ok(if a == 0 { u32::MAX } else { 31 - a.leading_zeros() }),
        (M::ReverseBits, _) => Ok(a.reverse_bits()),
        _ => Err(format!("{fun:?} of {kind:?}")),
    }
}

/// Converts a scalar to another kind. Numbers out of the range become the nearest that f32 holds,
/// as with the translators.
pub(super) fn converted(from: ScalarKind, to: ScalarKind, a: u32) -> Result<u32, String> {
    use ScalarKind as K;
    let x = f32::from_bits(a);
    Ok(match (from, to) {
        (K::Float, K::Float) => a,
        (K::Float, K::Uint) => x.clamp(0.0, 4_294_967_040.0) as u32,
        (K::Float, K::Sint) => x.clamp(-2_147_483_648.0, 2_147_483_520.0) as i32 as u32,
        (K::Float, K::Bool) => u32::from(x != 0.0),
        (_, K::Bool) => u32::from(a != 0),
        (K::Bool | K::Uint, K::Float) => (a as f32).to_bits(),
        (K::Sint, K::Float) => (a as i32 as f32).to_bits(),
        (_, K::Uint | K::Sint) => a,
        _ => return Err(format!("a conversion from {from:?} to {to:?}")),
    })
}

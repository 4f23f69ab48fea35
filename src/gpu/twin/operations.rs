//! Operations on scalars, as bits.

use naga::{BinaryOperator as B, MathFunction as M, Scalar, ScalarKind, UnaryOperator};

/// Returns the value of a binary operation on scalars of one kind. Words of 64 bits hold those of
/// 32 in their low half.
pub(super) fn binary(op: B, scalar: Scalar, a: u64, b: u64) -> Result<u64, String> {
    if scalar.kind == ScalarKind::Float {
        return float(op, f32::from_bits(a as u32), f32::from_bits(b as u32));
    }
    let mask = if scalar.width == 8 { u64::MAX } else { u64::from(u32::MAX) };
    let signed = scalar.kind == ScalarKind::Sint;
    let wide = |x: u64| if scalar.width == 8 { x as i64 } else { i64::from(x as u32 as i32) };
    let less = if signed { wide(a) < wide(b) } else { a < b };
    Ok(match op {
        B::Add => a.wrapping_add(b) & mask,
        B::Subtract => a.wrapping_sub(b) & mask,
        B::Multiply => a.wrapping_mul(b) & mask,
        // WGSL: a division by zero gives the dividend, and a remainder 0.
        B::Divide if b == 0 => a,
        B::Modulo if b == 0 => 0,
        B::Divide if signed => wide(a).wrapping_div(wide(b)) as u64 & mask,
        B::Modulo if signed => wide(a).wrapping_rem(wide(b)) as u64 & mask,
        B::Divide => a / b,
        B::Modulo => a % b,
        B::Equal => u64::from(a == b),
        B::NotEqual => u64::from(a != b),
        B::Less => u64::from(less),
        B::LessEqual => u64::from(less || a == b),
        B::Greater => u64::from(!less && a != b),
        B::GreaterEqual => u64::from(!less),
        B::And | B::LogicalAnd => a & b,
        B::InclusiveOr | B::LogicalOr => a | b,
        B::ExclusiveOr => a ^ b,
        B::ShiftLeft => a.wrapping_shl(b as u32 & (u32::from(scalar.width) * 8 - 1)) & mask,
        B::ShiftRight if signed => (wide(a) >> (b as u32 & (u32::from(scalar.width) * 8 - 1))) as u64 & mask,
        B::ShiftRight => a >> (b as u32 & (u32::from(scalar.width) * 8 - 1)),
    })
}

fn float(op: B, a: f32, b: f32) -> Result<u64, String> {
    let number = |x: f32| Ok(u64::from(x.to_bits()));
    let truth = |x: bool| Ok(u64::from(x));
    match op {
        B::Add => number(a + b),
        B::Subtract => number(a - b),
        B::Multiply => number(a * b),
        B::Divide => number(a / b),
        B::Equal => truth(a == b),
        B::NotEqual => truth(a != b),
        B::Less => truth(a < b),
        B::LessEqual => truth(a <= b),
        B::Greater => truth(a > b),
        B::GreaterEqual => truth(a >= b),
        _ => Err(format!("{op:?} of f32")),
    }
}

pub(super) fn unary(op: UnaryOperator, scalar: Scalar, a: u64) -> u64 {
    match (op, scalar.kind) {
        (UnaryOperator::Negate, ScalarKind::Float) => u64::from((-f32::from_bits(a as u32)).to_bits()),
        (UnaryOperator::Negate, _) if scalar.width == 8 => a.wrapping_neg(),
        (UnaryOperator::Negate, _) => u64::from((a as u32).wrapping_neg()),
        (UnaryOperator::LogicalNot, _) => u64::from(a == 0),
        (UnaryOperator::BitwiseNot, _) if scalar.width == 8 => !a,
        (UnaryOperator::BitwiseNot, _) => u64::from(!(a as u32)),
    }
}

/// Returns the value of a function of scalars. Those whose bits depend on the adapter have been
/// replaced ([`super::super::exact`]).
pub(super) fn math(fun: M, scalar: Scalar, a: u64, b: u64, c: u64) -> Result<u64, String> {
    let x = f32::from_bits(a as u32);
    let number = |x: f32| Ok(u64::from(x.to_bits()));
    let less = |a: u64, b: u64| binary(B::Less, scalar, a, b).map(|less| less == 1);
    match (fun, scalar.kind) {
        (M::Abs, ScalarKind::Float) => number(x.abs()),
        (M::Floor, _) => number(x.floor()),
        (M::Ceil, _) => number(x.ceil()),
        (M::Trunc, _) => number(x.trunc()),
        (M::Round, _) => number(x.round_ties_even()),
        (M::Sqrt, _) => number(x.sqrt()),
        (M::Sign, ScalarKind::Float) => number(if x > 0.0 {
            1.0
        } else if x < 0.0 {
            -1.0
        } else {
            0.0
        }),
        (M::Abs, ScalarKind::Sint) => Ok(u64::from((a as u32 as i32).unsigned_abs())),
        (M::Abs, _) => Ok(a),
        (M::Min, _) => Ok(if less(a, b)? { a } else { b }),
        (M::Max, _) => Ok(if less(a, b)? { b } else { a }),
        (M::Clamp, _) => {
            let raised = if less(a, b)? { b } else { a };
            Ok(if less(raised, c)? { raised } else { c })
        }
        (M::CountOneBits, _) => Ok(u64::from(a.count_ones())),
        (M::CountLeadingZeros, _) => Ok(u64::from((a as u32).leading_zeros())),
        (M::CountTrailingZeros, _) => Ok(u64::from((a as u32).trailing_zeros())),
        (M::FirstTrailingBit, _) => Ok(u64::from(if a == 0 { u32::MAX } else { (a as u32).trailing_zeros() })),
        (M::FirstLeadingBit, ScalarKind::Uint) => {
            Ok(u64::from(if a == 0 { u32::MAX } else { 31 - (a as u32).leading_zeros() }))
        }
        (M::ReverseBits, _) => Ok(u64::from((a as u32).reverse_bits())),
        _ => Err(format!("{fun:?} of {scalar:?}")),
    }
}

/// Converts a scalar to another kind.
pub(super) fn converted(from: Scalar, to: Scalar, a: u64) -> Result<u64, String> {
    let x = f32::from_bits(a as u32);
    let number = |x: f32| u64::from(x.to_bits());
    Ok(match (from.kind, to.kind, to.width) {
        (ScalarKind::Float, ScalarKind::Float, _) => a,
        // As the translators do: out of the range, the nearest number that f32 holds.
        (ScalarKind::Float, ScalarKind::Uint, 8) => x as u64,
        (ScalarKind::Float, ScalarKind::Uint, _) => x.clamp(0.0, 4_294_967_040.0) as u64,
        (ScalarKind::Float, ScalarKind::Sint, 4) => u64::from(x.clamp(-2_147_483_648.0, 2_147_483_520.0) as i32 as u32),
        (ScalarKind::Float, ScalarKind::Bool, _) => u64::from(x != 0.0),
        (_, ScalarKind::Bool, _) => u64::from(a != 0),
        (ScalarKind::Bool | ScalarKind::Uint, ScalarKind::Float, _) => number(a as f32),
        (ScalarKind::Sint, ScalarKind::Float, _) => number(a as u32 as i32 as f32),
        (ScalarKind::Sint, _, 8) => i64::from(a as u32 as i32) as u64,
        (_, _, 8) => a,
        (_, ScalarKind::Uint | ScalarKind::Sint, _) => u64::from(a as u32),
        _ => return Err(format!("a conversion from {from:?} to {to:?}")),
    })
}

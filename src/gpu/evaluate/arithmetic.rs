//! Operations on scalars as WGSL defines them, with f64 in place of f32.

use naga::{BinaryOperator, Literal, MathFunction, ScalarKind, UnaryOperator};

use super::{Fault, Value, unsupported};

pub(super) fn of_literal(literal: Literal) -> Result<Value, Fault> {
    Ok(match literal {
        Literal::F32(number) => Value::Float(number.into()),
        Literal::AbstractFloat(number) | Literal::F64(number) => Value::Float(number),
        Literal::I32(number) => Value::Signed(number),
        Literal::U32(number) => Value::Unsigned(number),
        Literal::AbstractInt(number) => Value::Signed(number as i32),
        Literal::Bool(truth) => Value::Truth(truth),
        _ => return unsupported("numbers of 16 or 64 bits"),
    })
}

pub(super) fn converted(value: Value, kind: ScalarKind) -> Result<Value, Fault> {
    let number = match value {
        Value::Float(number) => number,
        Value::Signed(number) => number.into(),
        Value::Unsigned(number) => number.into(),
        Value::Truth(truth) => f64::from(u8::from(truth)),
    };
    Ok(match kind {
        ScalarKind::Float | ScalarKind::AbstractFloat => Value::Float(number),
        // Conversions between integers keep the bits. From a float, `as` saturates as in WGSL.
        ScalarKind::Sint | ScalarKind::AbstractInt => match value {
            Value::Unsigned(bits) => Value::Signed(bits as i32),
            _ => Value::Signed(number as i32),
        },
        ScalarKind::Uint => match value {
            Value::Signed(bits) => Value::Unsigned(bits as u32),
            _ => Value::Unsigned(number as u32),
        },
        ScalarKind::Bool => Value::Truth(number != 0.0),
    })
}

pub(super) fn recast(value: Value, kind: ScalarKind) -> Result<Value, Fault> {
    let bits = match value {
        Value::Float(number) => (number as f32).to_bits(),
        Value::Signed(number) => number as u32,
        Value::Unsigned(number) => number,
        Value::Truth(_) => return unsupported("the bits of a truth value"),
    };
    Ok(match kind {
        ScalarKind::Float => Value::Float(f32::from_bits(bits).into()),
        ScalarKind::Sint => Value::Signed(bits as i32),
        ScalarKind::Uint => Value::Unsigned(bits),
        _ => return unsupported("the bits of a truth value"),
    })
}

pub(super) fn unary(op: UnaryOperator, value: Value) -> Result<Value, Fault> {
    Ok(match (op, value) {
        (UnaryOperator::Negate, Value::Float(number)) => Value::Float(-number),
        (UnaryOperator::Negate, Value::Signed(number)) => Value::Signed(number.wrapping_neg()),
        (UnaryOperator::LogicalNot, Value::Truth(truth)) => Value::Truth(!truth),
        (UnaryOperator::BitwiseNot, Value::Signed(number)) => Value::Signed(!number),
        (UnaryOperator::BitwiseNot, Value::Unsigned(number)) => Value::Unsigned(!number),
        _ => return unsupported("an operator on another type"),
    })
}

pub(super) fn binary(op: BinaryOperator, left: Value, right: Value) -> Result<Value, Fault> {
    use BinaryOperator as Op;
    let ordered = match (left, right) {
        (Value::Float(a), Value::Float(b)) => a.partial_cmp(&b),
        (Value::Signed(a), Value::Signed(b)) => Some(a.cmp(&b)),
        (Value::Unsigned(a), Value::Unsigned(b)) => Some(a.cmp(&b)),
        (Value::Truth(a), Value::Truth(b)) => Some(a.cmp(&b)),
        _ => None,
    };
    let compared = match op {
        Op::Equal => Some(ordered.is_some_and(|order| order.is_eq())),
        Op::NotEqual => Some(ordered.is_none_or(|order| order.is_ne())),
        Op::Less => Some(ordered.is_some_and(|order| order.is_lt())),
        Op::LessEqual => Some(ordered.is_some_and(|order| order.is_le())),
        Op::Greater => Some(ordered.is_some_and(|order| order.is_gt())),
        Op::GreaterEqual => Some(ordered.is_some_and(|order| order.is_ge())),
        _ => None,
    };
    if let Some(truth) = compared {
        return Ok(Value::Truth(truth));
    }
    Ok(match (left, right) {
        (Value::Float(a), Value::Float(b)) => Value::Float(match op {
            Op::Add => a + b,
            Op::Subtract => a - b,
            Op::Multiply => a * b,
            Op::Divide => a / b,
            Op::Modulo => a % b,
            _ => return unsupported("an operator on another type"),
        }),
        (Value::Truth(a), Value::Truth(b)) => Value::Truth(match op {
            Op::And | Op::LogicalAnd => a & b,
            Op::InclusiveOr | Op::LogicalOr => a | b,
            _ => return unsupported("an operator on another type"),
        }),
        (Value::Signed(a), Value::Unsigned(b)) => Value::Signed(match op {
            Op::ShiftLeft => a.wrapping_shl(b),
            Op::ShiftRight => a.wrapping_shr(b),
            _ => return unsupported("an operator on another type"),
        }),
        (Value::Signed(a), Value::Signed(b)) => Value::Signed(whole(op, a.into(), b.into())? as i32),
        (Value::Unsigned(a), Value::Unsigned(b)) => Value::Unsigned(match op {
            Op::ShiftLeft => a.wrapping_shl(b),
            Op::ShiftRight => a.wrapping_shr(b),
            _ => whole(op, a.into(), b.into())? as u32,
        }),
        _ => return unsupported("an operator on two types"),
    })
}

/// Applies an operator to 32-bit integers in i64 variables. The low 32 bits of the returned value
/// are the result.
fn whole(op: BinaryOperator, a: i64, b: i64) -> Result<i64, Fault> {
    use BinaryOperator as Op;
    Ok(match op {
        Op::Add => a + b,
        Op::Subtract => a - b,
        Op::Multiply => a.wrapping_mul(b),
        // As in WGSL, a division by 0 gives the dividend, with the remainder 0.
        Op::Divide => a.checked_div(b).unwrap_or(a),
        Op::Modulo => a.checked_rem(b).unwrap_or(0),
        Op::And => a & b,
        Op::InclusiveOr => a | b,
        Op::ExclusiveOr => a ^ b,
        _ => return unsupported("an operator on another type"),
    })
}

/// Evaluates a built-in function of one to three scalars.
pub(super) fn math(
    fun: MathFunction,
    first: Value,
    second: Option<Value>,
    third: Option<Value>,
) -> Result<Value, Fault> {
    match first {
        Value::Float(x) => match of_one(fun, x) {
            Some(value) => Ok(Value::Float(value)),
            None => of_several(fun, x, second, third).map(Value::Float),
        },
        Value::Signed(number) => Ok(Value::Signed(of_integers(fun, number.into(), second, third)? as i32)),
        Value::Unsigned(number) => Ok(Value::Unsigned(of_integers(fun, number.into(), second, third)? as u32)),
        Value::Truth(_) => unsupported("a function of truth values"),
    }
}

/// Evaluates a function of 32-bit integers, the first of which is given as i64. The low 32 bits of
/// the returned value are the result.
fn of_integers(fun: MathFunction, a: i64, second: Option<Value>, third: Option<Value>) -> Result<i64, Fault> {
    let number = |value: Option<Value>| match value {
        Some(Value::Signed(number)) => Ok(i64::from(number)),
        Some(Value::Unsigned(number)) => Ok(i64::from(number)),
        _ => unsupported("a function of two types"),
    };
    Ok(match fun {
        MathFunction::Abs => a.abs(),
        MathFunction::Sign => a.signum(),
        MathFunction::Min => a.min(number(second)?),
        MathFunction::Max => a.max(number(second)?),
        MathFunction::Clamp => a.max(number(second)?).min(number(third)?),
        _ => return unsupported(format!("the function {fun:?} of integers")),
    })
}

/// Evaluates a function of one number; None if the function takes several.
fn of_one(fun: MathFunction, x: f64) -> Option<f64> {
    Some(match fun {
        MathFunction::Abs => x.abs(),
        MathFunction::Saturate => {
            if x.is_nan() {
                0.0
            } else {
                x.clamp(0.0, 1.0)
            }
        }
        MathFunction::Cos => x.cos(),
        MathFunction::Sin => x.sin(),
        MathFunction::Tan => x.tan(),
        MathFunction::Cosh => x.cosh(),
        MathFunction::Sinh => x.sinh(),
        MathFunction::Tanh => x.tanh(),
        MathFunction::Acos => x.acos(),
        MathFunction::Asin => x.asin(),
        MathFunction::Atan => x.atan(),
        MathFunction::Asinh => x.asinh(),
        MathFunction::Acosh => x.acosh(),
        MathFunction::Atanh => x.atanh(),
        MathFunction::Radians => x.to_radians(),
        MathFunction::Degrees => x.to_degrees(),
        MathFunction::Length => x.abs(),
        MathFunction::Ceil => x.ceil(),
        MathFunction::Floor => x.floor(),
        MathFunction::Round => x.round_ties_even(),
        MathFunction::Fract => x - x.floor(),
        MathFunction::Trunc => x.trunc(),
        MathFunction::Exp => x.exp(),
        MathFunction::Exp2 => x.exp2(),
        MathFunction::Log => x.ln(),
        MathFunction::Log2 => x.log2(),
        MathFunction::Sign => {
            if x == 0.0 {
                0.0
            } else {
                x.signum()
            }
        }
        MathFunction::Sqrt => x.sqrt(),
        MathFunction::InverseSqrt => x.sqrt().recip(),
        _ => return None,
    })
}

/// Evaluates a function of two or three numbers.
fn of_several(fun: MathFunction, x: f64, second: Option<Value>, third: Option<Value>) -> Result<f64, Fault> {
    let float = |value: Option<Value>| match value {
        Some(Value::Float(number)) => Ok(number),
        _ => unsupported("a function of two types"),
    };
    Ok(match fun {
        MathFunction::Min => x.min(float(second)?),
        MathFunction::Max => x.max(float(second)?),
        MathFunction::Clamp => x.max(float(second)?).min(float(third)?),
        MathFunction::Distance => (x - float(second)?).abs(),
        MathFunction::Atan2 => x.atan2(float(second)?),
        // WGSL defines no power of a negative number; devices give NaN.
        MathFunction::Pow => {
            if x < 0.0 {
                f64::NAN
            } else {
                x.powf(float(second)?)
            }
        }
        MathFunction::Fma => x.mul_add(float(second)?, float(third)?),
        MathFunction::Mix => x + (float(second)? - x) * float(third)?,
        MathFunction::Step => f64::from(u8::from(float(second)? >= x)),
        MathFunction::SmoothStep => {
            let t = ((float(third)? - x) / (float(second)? - x)).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        }
        _ => return unsupported(format!("the function {fun:?}")),
    })
}

//! Deserialization of scene numbers with validation, so that errors have line and field.

use serde::{Deserialize, Deserializer, de::Error};

fn checked<'de, D: Deserializer<'de>>(
    deserializer: D,
    what: &str,
    right: impl Fn(f64) -> bool,
) -> Result<f64, D::Error> {
    let number = f64::deserialize(deserializer)?;
    if right(number) {
        Ok(number)
    } else {
        Err(D::Error::custom(format!("must be {what}, but is {number}")))
    }
}

pub fn any<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, "finite", f64::is_finite)
}

pub fn positive<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, "finite and above zero", |x| x > 0.0 && x.is_finite())
}

pub fn not_negative<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, "finite and at least zero", |x| x >= 0.0 && x.is_finite())
}

pub fn part<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, "in [0, 1]", |x| (0.0..=1.0).contains(&x))
}

pub fn signed_part<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, "in [-1, 1]", |x| (-1.0..=1.0).contains(&x))
}

pub fn half<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    checked(deserializer, "in [0, 0.5]", |x| (0.0..=0.5).contains(&x))
}

fn all<'de, D: Deserializer<'de>>(
    deserializer: D,
    what: &str,
    right: impl Fn([f64; 3]) -> bool,
) -> Result<[f64; 3], D::Error> {
    let [x, y, z] = <[f64; 3]>::deserialize(deserializer)?;
    if right([x, y, z]) {
        Ok([x, y, z])
    } else {
        Err(D::Error::custom(format!("must be {what}, but is ({x}, {y}, {z})")))
    }
}

pub fn vector<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
    all(deserializer, "finite", |v| v.iter().all(|x| x.is_finite()))
}

pub fn direction<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
    let right = |v: [f64; 3]| v.iter().all(|x| x.is_finite()) && v.iter().any(|x| *x != 0.0);
    all(deserializer, "finite and not zero", right)
}

pub fn sides<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
    all(deserializer, "finite and above zero", |v| v.iter().all(|x| *x > 0.0 && x.is_finite()))
}

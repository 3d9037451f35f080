//! Running error analysis: the exact result of a computation, and how far a device's f32 result may be from it.
//!
//! The rounding errors are those that Vulkan allows (specification, "Precision and Operation of SPIR-V Instructions"):
//! addition and multiplication are correctly rounded, division is off by up to 2.5 ulp, an inverse square root by 2 ulp, exp
//! by 3 + 2|x| ulp, and results below the smallest normal number may become zero.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Half an ulp of 1: the relative error of one correctly rounded operation in f32.
const UNIT: f64 = 1.0 / 16_777_216.0;

/// A number and a bound on the distance between it and what a device computes in f32.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bounded {
    /// The exact value, but for f64's rounding, which is 2²⁹ times finer than the bound.
    pub value: f64,
    /// Largest distance of the device's value, at least 0.
    pub error: f64,
}

impl Bounded {
    /// A value that the device holds exactly.
    pub fn exact(value: f32) -> Self {
        Self { value: f64::from(value), error: 0.0 }
    }

    /// This exact value after one more operation that is off by `ulps` at most, from operands whose errors have moved
    /// the exact result by `carried` at most.
    fn rounded(value: f64, carried: f64, ulps: f64) -> Self {
        let rounding = 2.0 * UNIT * ulps * (value.abs() + carried);
        Self { value, error: carried + rounding + f64::from(f32::MIN_POSITIVE) }
    }

    /// e to the power of this.
    pub fn exp(self) -> Self {
        let value = self.value.exp();
        // The ulps count at the value that the device really takes the exponential of.
        Self::rounded(value, value * self.error.exp_m1(), 3.0 + 2.0 * (self.value.abs() + self.error))
    }

    /// Its magnitude; taking it rounds nothing.
    pub fn abs(self) -> Self {
        Self { value: self.value.abs(), ..self }
    }

    /// The larger of two; choosing rounds nothing.
    pub fn max(self, other: Self) -> Self {
        Self { value: self.value.max(other.value), error: self.error.max(other.error) }
    }

    /// The smaller of two.
    pub fn min(self, other: Self) -> Self {
        -(-self).max(-other)
    }

    /// The square root of what is not negative; a device has it from a division by an inverse root.
    pub fn sqrt(self) -> Self {
        let root = |x: f64| x.max(0.0).sqrt();
        let value = root(self.value);
        let carried = (root(self.value + self.error) - value).max(value - root(self.value - self.error));
        Self::rounded(value, carried, 4.5)
    }

    /// Whether a device's value is as near as it has to be.
    pub fn allows(&self, device: f32) -> bool {
        (f64::from(device) - self.value).abs() <= self.error
    }

    /// Whether it is less than another on every device.
    pub fn surely_below(&self, other: &Self) -> bool {
        self.value + self.error < other.value - other.error
    }
}

impl Add for Bounded {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::rounded(self.value + other.value, self.error + other.error, 0.5)
    }
}

impl Sub for Bounded {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for Bounded {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, ..self }
    }
}

impl Mul for Bounded {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let carried = self.value.abs() * other.error + other.value.abs() * self.error + self.error * other.error;
        Self::rounded(self.value * other.value, carried, 0.5)
    }
}

/// The divisor must be known to differ from zero; if it is not, the error is infinite.
impl Div for Bounded {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let least = other.value.abs() - other.error;
        if least <= 0.0 {
            return Self { value: 0.0, error: f64::INFINITY };
        }
        let value = self.value / other.value;
        Self::rounded(value, (self.error + value.abs() * other.error) / least, 2.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn f32_stays_within_the_bound(a in -1e3_f32..1e3, b in -1e3_f32..1e3, c in 0.5_f32..1e3) {
            let (x, y, z) = (Bounded::exact(a), Bounded::exact(b), Bounded::exact(c));
            prop_assert!((x * y + y / z - x).allows(a * b + b / c - a));
            prop_assert!((x * y * y / z).allows(a * b * b / c));
            prop_assert!((-x.abs() / z).exp().allows((-a.abs() / c).exp()));
            prop_assert!((x * x + z).sqrt().allows((a * a + c).sqrt()));
            prop_assert!((x * y).max(y + z).min(x).allows((a * b).max(b + c).min(a)));
        }
    }

    #[test]
    fn a_wrong_value_is_outside() {
        let third = Bounded::exact(1.0) / Bounded::exact(3.0);
        assert!(third.allows(1.0 / 3.0));
        // 2.5 ulp of a third are 2.5 x 2^-25, and the bound takes an ulp at 2^-23 times the value: less than 4 ulp.
        assert!(!third.allows(1.0 / 3.0 + 4.0 * 2.0_f32.powi(-25)));
        assert!((Bounded::exact(1.0) / (third - third)).error.is_infinite());
        // 4.5 ulp of 4/3 are 4.5 x 2^-23, of which the bound takes 4/3.
        let root = (third + Bounded::exact(1.0)).sqrt();
        assert!(root.allows((4.0_f32 / 3.0).sqrt()) && !root.allows((4.0_f32 / 3.0).sqrt() + 9.0 * 2.0_f32.powi(-23)));
        assert_eq!(third.min(Bounded::exact(0.5)).value, third.value);
        assert_eq!(third.max(Bounded::exact(0.5)).value, 0.5);
    }
}

//! Floats side by side: the arithmetic that every path shares. All impls do the same IEEE operations, so that a formula
//! written once over [`Lanes`] gives the same bits for one float, for eight portable ones, and for AVX2.

/// One value an axis. As an array's own `map` would, but inlined for certain.
#[inline(always)]
pub(crate) fn per_axis<T>(mut of: impl FnMut(usize) -> T) -> [T; 3] {
    [of(0), of(1), of(2)]
}

/// One value a lane, likewise.
#[inline(always)]
pub(crate) fn per_lane<T>(mut of: impl FnMut(usize) -> T) -> [T; 8] {
    [of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)]
}

/// One or more floats that are computed together. Nothing is fused; `min` and `max` give the second operand where the
/// first is not less (not greater), as x86 does, so NaN and the sign of zero agree too.
pub(crate) trait Lanes: Copy {
    /// The same float in all lanes.
    fn splat(x: f32) -> Self;
    /// Sum.
    fn add(self, other: Self) -> Self;
    /// Difference.
    fn sub(self, other: Self) -> Self;
    /// Product.
    fn mul(self, other: Self) -> Self;
    /// Quotient.
    fn div(self, other: Self) -> Self;
    /// `self` where it is less, else `other`.
    fn min(self, other: Self) -> Self;
    /// `self` where it is greater, else `other`.
    fn max(self, other: Self) -> Self;
    /// Bit i tells whether lane i is less than or equal; false for NaN.
    fn le(self, other: Self) -> u32;
    /// Bit i tells whether lane i is less; false for NaN.
    fn lt(self, other: Self) -> u32;
}

/// Eight of them, to and from memory.
pub(crate) trait Lanes8: Lanes {
    /// From memory.
    fn load(from: &[f32; 8]) -> Self;
    /// To memory.
    fn store(self) -> [f32; 8];
    /// These bits, and those that differ in two others.
    fn or_differing(self, a: Self, b: Self) -> Self;
    /// Whether no bit is set.
    fn is_zero(self) -> bool;
    /// The next greater float; what is not finite stays. Like `f32::next_up`, but without branches.
    fn next_up(self) -> Self;
    /// The first three floats of eight rows side by side.
    fn transpose(rows: [&[f32; 4]; 8]) -> [Self; 3];
    /// The greatest lane of each; none of them NaN.
    fn greatest_of_each(of: [Self; 8]) -> Self;
}

/// What is computed in lanes of any width, always with the same answer.
pub(crate) trait InLanes {
    /// The answer.
    type Output;
    /// Computes it. To be inlined always.
    fn compute<L: Lanes8>(self) -> Self::Output;
}

/// What the floats of this machine come in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// Eight floats in an AVX2 register.
    Avx2,
    /// Eight floats in an array; the compiler makes of it what the target's baseline has.
    Portable,
}

impl Width {
    /// The widest that this machine has.
    pub fn detect() -> Self {
        Self::available()[0]
    }

    /// All that this machine has, the widest first.
    pub fn available() -> &'static [Self] {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return &[Self::Avx2, Self::Portable];
        }
        &[Self::Portable]
    }

    /// Computes in this width; portably where the machine lacks it.
    pub(crate) fn compute<T: InLanes>(self, what: T) -> T::Output {
        #[cfg(target_arch = "x86_64")]
        if self == Self::Avx2 && std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the feature was just found
            return unsafe { avx2::compute(what) };
        }
        what.compute::<Portable>()
    }
}

impl Lanes for f32 {
    #[inline(always)]
    fn splat(x: f32) -> Self {
        x
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self - other
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self * other
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self / other
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        u32::from(self <= other)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        u32::from(self < other)
    }
}

/// Eight floats in an array.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable([f32; 8]);

impl Portable {
    #[inline(always)]
    fn zip(mut self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        for (a, b) in self.0.iter_mut().zip(other.0) {
            *a = f(*a, b);
        }
        self
    }

    #[inline(always)]
    fn mask(self, other: Self, f: impl Fn(f32, f32) -> bool) -> u32 {
        self.0.iter().zip(other.0).enumerate().fold(0, |mask, (i, (&a, b))| mask | u32::from(f(a, b)) << i)
    }
}

impl Lanes for Portable {
    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([x; 8])
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, Lanes::min)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, Lanes::max)
    }
    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        self.mask(other, |a, b| a <= b)
    }
    #[inline(always)]
    fn lt(self, other: Self) -> u32 {
        self.mask(other, |a, b| a < b)
    }
}

impl Lanes8 for Portable {
    #[inline(always)]
    fn load(from: &[f32; 8]) -> Self {
        Self(*from)
    }
    #[inline(always)]
    fn store(self) -> [f32; 8] {
        self.0
    }
    #[inline(always)]
    fn or_differing(self, a: Self, b: Self) -> Self {
        let bits = |x: Self, i: usize| x.0[i].to_bits();
        Self(per_lane(|i| f32::from_bits(bits(self, i) | (bits(a, i) ^ bits(b, i)))))
    }
    #[inline(always)]
    fn is_zero(self) -> bool {
        self.0.iter().fold(0, |all, x| all | x.to_bits()) == 0
    }
    #[inline(always)]
    fn next_up(self) -> Self {
        Self(per_lane(|i| next_up(self.0[i])))
    }
    #[inline(always)]
    fn transpose(rows: [&[f32; 4]; 8]) -> [Self; 3] {
        per_axis(|k| Self(per_lane(|i| rows[i][k])))
    }
    #[inline(always)]
    fn greatest_of_each(of: [Self; 8]) -> Self {
        Self(per_lane(|i| of[i].0.into_iter().fold(f32::NEG_INFINITY, |all, x| Lanes::max(x, all))))
    }
}

/// The next greater float; what is not finite stays. Like `f32::next_up`, but without branches.
#[inline(always)]
pub(crate) fn next_up(x: f32) -> f32 {
    let bits = (x + 0.0).to_bits();
    let next = if bits >> 31 == 0 { bits + 1 } else { bits - 1 };
    if x.is_finite() { f32::from_bits(next) } else { x }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{InLanes, Lanes, Lanes8, per_lane};
    use std::arch::x86_64::{
        __m128, __m256, _CMP_LE_OQ, _CMP_LT_OQ, _mm256_add_epi32, _mm256_add_ps, _mm256_andnot_ps,
        _mm256_blendv_ps, _mm256_castps_si256, _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_div_ps,
        _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps, _mm256_mul_ps, _mm256_or_ps, _mm256_or_si256,
        _mm256_permute2f128_ps, _mm256_set_m128, _mm256_set1_epi32, _mm256_set1_ps, _mm256_shuffle_ps,
        _mm256_srai_epi32, _mm256_sub_ps, _mm256_testz_si256, _mm256_unpackhi_ps, _mm256_unpacklo_ps,
        _mm256_xor_ps,
    };

    #[inline]
    #[target_feature(enable = "avx2")]
    fn max_of_halves(a: __m256, b: __m256) -> __m256 {
        _mm256_max_ps(_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b))
    }

    #[target_feature(enable = "avx2")]
    pub(super) fn compute<T: InLanes>(what: T) -> T::Output {
        what.compute::<Avx2>()
    }

    /// Eight floats in an AVX register. Only functions that enable the feature instantiate formulas with it, and those
    /// are entered only where [`super::Width::detect`] found it: that is what every SAFETY comment below means by
    /// "the feature is there".
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct Avx2(__m256);

    impl Lanes for Avx2 {
        #[inline(always)]
        fn splat(x: f32) -> Self {
            // SAFETY: the feature is there
            Self(unsafe { _mm256_set1_ps(x) })
        }
        #[inline(always)]
        fn add(self, other: Self) -> Self {
            // SAFETY: the feature is there
            Self(unsafe { _mm256_add_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            // SAFETY: the feature is there
            Self(unsafe { _mm256_sub_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            // SAFETY: the feature is there
            Self(unsafe { _mm256_mul_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn div(self, other: Self) -> Self {
            // SAFETY: the feature is there
            Self(unsafe { _mm256_div_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: the feature is there
            Self(unsafe { _mm256_min_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: the feature is there
            Self(unsafe { _mm256_max_ps(self.0, other.0) })
        }
        #[inline(always)]
        fn le(self, other: Self) -> u32 {
            // SAFETY: the feature is there
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0)) as u32 }
        }
        #[inline(always)]
        fn lt(self, other: Self) -> u32 {
            // SAFETY: the feature is there
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0)) as u32 }
        }
    }

    impl Lanes8 for Avx2 {
        #[inline(always)]
        fn load(from: &[f32; 8]) -> Self {
            Self(bytemuck::cast(*from))
        }
        #[inline(always)]
        fn store(self) -> [f32; 8] {
            bytemuck::cast(self.0)
        }
        #[inline(always)]
        fn or_differing(self, a: Self, b: Self) -> Self {
            // SAFETY: the feature is there
            Self(unsafe { _mm256_or_ps(self.0, _mm256_xor_ps(a.0, b.0)) })
        }
        #[inline(always)]
        fn is_zero(self) -> bool {
            // SAFETY: the feature is there
            unsafe {
                let bits = _mm256_castps_si256(self.0);
                _mm256_testz_si256(bits, bits) == 1
            }
        }
        #[inline(always)]
        fn next_up(self) -> Self {
            // SAFETY: the feature is there
            Self(unsafe {
                // +0 for -0
                let bits = _mm256_castps_si256(_mm256_add_ps(self.0, _mm256_set1_ps(0.0)));
                let step = _mm256_or_si256(_mm256_srai_epi32::<31>(bits), _mm256_set1_epi32(1));
                let next = _mm256_castsi256_ps(_mm256_add_epi32(bits, step));
                let size = _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0);
                let is_finite = _mm256_cmp_ps::<_CMP_LT_OQ>(size, _mm256_set1_ps(f32::INFINITY));
                _mm256_blendv_ps(self.0, next, is_finite)
            })
        }
        #[inline(always)]
        fn transpose(rows: [&[f32; 4]; 8]) -> [Self; 3] {
            let [a, b, c, d, e, f, g, h] = per_lane(|i| bytemuck::cast::<_, __m128>(*rows[i]));
            // SAFETY: the feature is there
            unsafe {
                let [a, b, c, d] = [
                    _mm256_set_m128(e, a),
                    _mm256_set_m128(f, b),
                    _mm256_set_m128(g, c),
                    _mm256_set_m128(h, d),
                ];
                let (xy01, xy23) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
                let (z01, z23) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
                [
                    Self(_mm256_shuffle_ps::<0x44>(xy01, xy23)),
                    Self(_mm256_shuffle_ps::<0xee>(xy01, xy23)),
                    Self(_mm256_shuffle_ps::<0x44>(z01, z23)),
                ]
            }
        }
        #[inline(always)]
        fn greatest_of_each(of: [Self; 8]) -> Self {
            // SAFETY: the feature is there
            unsafe {
                // each step leaves half the lanes of two
                let [a, b, c, d] = [
                    max_of_halves(of[0].0, of[1].0),
                    max_of_halves(of[2].0, of[3].0),
                    max_of_halves(of[4].0, of[5].0),
                    max_of_halves(of[6].0, of[7].0),
                ];
                let a = _mm256_max_ps(_mm256_shuffle_ps::<0x44>(a, b), _mm256_shuffle_ps::<0xee>(a, b));
                let b = _mm256_max_ps(_mm256_shuffle_ps::<0x44>(c, d), _mm256_shuffle_ps::<0xee>(c, d));
                Self(_mm256_max_ps(
                    _mm256_permute2f128_ps::<0x20>(a, b),
                    _mm256_permute2f128_ps::<0x31>(a, b),
                ))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All that is more than arithmetic, as bits.
    struct Moves<'a>(&'a [[f32; 8]; 8]);

    impl InLanes for Moves<'_> {
        type Output = Vec<[u32; 8]>;

        #[inline(always)]
        fn compute<L: Lanes8>(self) -> Self::Output {
            let lanes = per_lane(|i| L::load(&self.0[i]));
            let rows = L::transpose(per_lane(|i| self.0[i].first_chunk().unwrap()));
            let all = lanes.iter().map(|x| x.next_up()).chain(rows).chain([L::greatest_of_each(lanes)]);
            let same = lanes.map(|x| u32::from(L::splat(0.0).or_differing(x, lanes[0]).is_zero()));
            all.map(|x| x.store().map(f32::to_bits)).chain([same]).collect()
        }
    }

    #[test]
    fn every_width_moves_lanes_alike() {
        let (up, down) = (f32::INFINITY, f32::NEG_INFINITY);
        let mut from: [[f32; 8]; 8] =
            std::array::from_fn(|i| std::array::from_fn(|k| (i * 37 + k * 11) as f32 % 17.0 - 8.0));
        from[3] = [0.0, -0.0, up, down, f32::MAX, f32::MIN, 1e-45, -1e-45];
        from[5] = [down; 8];
        from[7] = from[0];
        for width in Width::available() {
            assert_eq!(width.compute(Moves(&from)), Width::Portable.compute(Moves(&from)));
        }
        let moved = Width::detect().compute(Moves(&from));
        assert_eq!(moved[8], std::array::from_fn(|i| from[i][0].to_bits()));
        assert_eq!(moved[10], std::array::from_fn(|i| from[i][2].to_bits()));
        assert_eq!(moved[11].map(f32::from_bits)[3..6], [up, from[4].into_iter().fold(down, f32::max), down]);
        assert_eq!(moved[12], [1, 0, 0, 0, 0, 0, 0, 1]);
    }
}

//! 64 bytes of a text at a time: which of them are what, a bit a byte, and the values of digits. For processors with
//! AVX2, BMI1 and BMI2; who calls has asked for those.

use std::arch::x86_64::{
    __m256i, _mm256_add_epi8, _mm256_cmpeq_epi8, _mm256_cmpgt_epi8, _mm256_madd_epi16, _mm256_maddubs_epi16,
    _mm256_movemask_epi8, _mm256_packus_epi32, _mm256_set1_epi8, _mm256_set1_epi16, _mm256_set1_epi32,
};

/// Bytes looked at.
pub(super) const WINDOW: usize = 64;

/// Whether the processor has what all here needs.
#[inline]
pub(super) fn is_there() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi1") && is_x86_feature_detected!("bmi2")
}

/// 64 bytes.
#[derive(Clone, Copy)]
pub(super) struct Window([__m256i; 2]);

impl Window {
    /// The bytes as they are.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2")]
    pub(super) fn new(bytes: &[u8; WINDOW]) -> Self {
        Self(bytemuck::cast(*bytes))
    }

    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2")]
    fn mask(self, of: impl Fn(__m256i) -> __m256i) -> u64 {
        let [low, high] = self.0.map(|half| u64::from(_mm256_movemask_epi8(of(half)) as u32));
        low | high << 32
    }

    /// Where this byte stands.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2")]
    pub(super) fn of(self, byte: u8) -> u64 {
        let byte = _mm256_set1_epi8(byte as i8);
        self.mask(|half| _mm256_cmpeq_epi8(half, byte))
    }

    /// Where no digit stands.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2")]
    pub(super) fn others(self) -> u64 {
        // digits become the ten least of all signed bytes
        let (to_least, greatest) = (_mm256_set1_epi8((0x80 - b'0') as i8), _mm256_set1_epi8(i8::MIN + 9));
        self.mask(|half| _mm256_cmpgt_epi8(_mm256_add_epi8(half, to_least), greatest))
    }

    /// Where both have different bytes.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2")]
    pub(super) fn differs(self, other: Self) -> u64 {
        let [low, high] =
            [0, 1].map(|k| u64::from(_mm256_movemask_epi8(_mm256_cmpeq_epi8(self.0[k], other.0[k])) as u32));
        !(low | high << 32)
    }
}

/// The values of each eight digits, each byte from 0 to 9: of the first sixteen bytes of `a`, then of those of `b`, then
/// of the others of both.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
pub(super) fn eights(a: __m256i, b: __m256i) -> __m256i {
    // times 10 and 1, 100 and 1, 10,000 and 1
    let (tens, hundreds) = (_mm256_set1_epi16(0x010A), _mm256_set1_epi32(0x0001_0064));
    let fours = |digits| _mm256_madd_epi16(_mm256_maddubs_epi16(digits, tens), hundreds);
    _mm256_madd_epi16(_mm256_packus_epi32(fours(a), fours(b)), _mm256_set1_epi32(0x0001_2710))
}

/// The values of four times eight digits, each byte from 0 to 9, the first in the lowest.
#[inline]
#[target_feature(enable = "avx2,bmi1,bmi2")]
pub(super) fn four_values(words: [u64; 4]) -> [u32; 4] {
    let digits: __m256i = bytemuck::cast(words);
    let [a, b, _, _, c, d, _, _]: [u32; 8] = bytemuck::cast(eights(digits, digits));
    [a, b, c, d]
}

/// Bits up to the lowest of some, and that.
#[inline]
pub(super) fn through(lowest: u64) -> u64 {
    lowest ^ lowest.wrapping_sub(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_at_every_place() {
        if !is_there() {
            return;
        }
        for byte in 0..=255u8 {
            for place in 0..WINDOW {
                let (sevens, mut bytes) = ([b'7'; WINDOW], [b'7'; WINDOW]);
                bytes[place] = byte;
                // SAFETY: the processor has what is needed.
                let (others, slashes, differs) = unsafe {
                    let window = Window::new(&bytes);
                    (window.others(), window.of(b'/'), window.differs(Window::new(&sevens)))
                };
                let bit = |is: bool| u64::from(is) << place;
                assert_eq!(others, bit(!byte.is_ascii_digit()));
                assert_eq!(slashes, bit(byte == b'/'));
                assert_eq!(differs, bit(byte != b'7'));
            }
        }
    }

    #[test]
    fn four_times_eight_digits() {
        if !is_there() {
            return;
        }
        let numbers = [12_345_678, 99_999_999, 0, 10_000_007];
        let words = numbers.map(|n: u32| {
            let text = format!("{n:08}");
            u64::from_le_bytes(text.as_bytes().first_chunk().copied().unwrap()) ^ 0x3030_3030_3030_3030
        });
        // SAFETY: the processor has what is needed.
        assert_eq!(unsafe { four_values(words) }, numbers);
    }
}

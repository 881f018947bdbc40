//! Sizes as they are typed: pixels and bytes.

use std::ops::RangeInclusive;

/// `1280x720`, `hd` or `fullhd`.
pub(super) fn pixels(text: &str) -> Result<[u32; 2], String> {
    match text {
        "hd" => return Ok([1280, 720]),
        "fullhd" => return Ok([1920, 1080]),
        _ => {}
    }
    let (w, h) = text.split_once(['x', 'X']).ok_or("is written WxH, hd or fullhd")?;
    let side = |s: &str| s.parse::<u32>().ok().filter(|n| (1..=MAX_SIDE).contains(n));
    match (side(w), side(h)) {
        (Some(w), Some(h)) => Ok([w, h]),
        _ => Err(format!("is written WxH, both from 1 to {MAX_SIDE}")),
    }
}

/// Longest side of a picture.
const MAX_SIDE: u32 = 65_535;

/// A range of whole numbers.
pub(super) fn whole(range: &RangeInclusive<f64>) -> RangeInclusive<i64> {
    *range.start() as i64..=*range.end() as i64
}

/// `512M`, `4G`, `64K` or a number of bytes; powers of 1024.
pub(super) fn bytes(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let (digits, unit) = match text.char_indices().find(|(_, c)| !c.is_ascii_digit() && *c != '.') {
        Some((i, _)) => text.split_at(i),
        None => (text, ""),
    };
    let power = match unit.trim_end_matches(['b', 'B', 'i']).to_ascii_uppercase().as_str() {
        "" => 0,
        "K" => 1,
        "M" => 2,
        "G" => 3,
        "T" => 4,
        _ => return Err("is written 512M or 4G (powers of 1024)".to_string()),
    };
    let number: f64 = digits.parse().map_err(|_| "is written 512M or 4G (powers of 1024)".to_string())?;
    Ok((number * 1024_f64.powi(power)) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_powers_of_1024() {
        assert_eq!(bytes("512M"), Ok(512 << 20));
        assert_eq!(bytes("4G"), Ok(4 << 30));
        assert_eq!(bytes("1.5k"), Ok(1536));
        assert_eq!(bytes("64KiB"), Ok(64 << 10));
        assert_eq!(bytes("100"), Ok(100));
        assert!(bytes("4Q").is_err());
        assert!(bytes("").is_err());
    }

    #[test]
    fn pixels_are_bounded() {
        assert_eq!(pixels("hd"), Ok([1280, 720]));
        assert_eq!(pixels("64x36"), Ok([64, 36]));
        assert!(pixels("0x36").is_err());
        assert!(pixels("64").is_err());
        assert!(pixels("99999x1").is_err());
    }
}

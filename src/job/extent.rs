//! Which sizes of pictures a format can hold, so that one that it cannot is refused before anything is traced.

/// Bytes that formats with lengths of 32 bits hold.
const FOUR_GB: u64 = u32::MAX as u64;
/// What stands in a file of such a format beside its pixels, at most.
const HEADERS: u64 = 1 << 20;
/// Longest side of lossless WebP (RFC 9649: 14 bits, counted from 1).
const WEBP_SIDE: u32 = 1 << 14;
/// Most pixels of QOI, by its specification.
const QOI_PIXELS: u64 = 400_000_000;

/// Whether a format holds pictures of a size; else what is wrong, with the figures.
pub(super) fn check(format: &str, size: [u32; 2], bits: u8, alpha: bool) -> Result<(), String> {
    let [width, height] = size.map(u64::from);
    let refused = |limit: &str| {
        let [width, height] = size;
        Err(format!("{format} holds {limit}, not {width}x{height}; choose another size or format"))
    };
    let fits = |row_bytes: u64| row_bytes * height <= FOUR_GB - HEADERS;
    let bytes = format!("{FOUR_GB} bytes");
    match format {
        "webp" if size.iter().any(|&side| side > WEBP_SIDE) => refused(&format!("{WEBP_SIDE} pixels a side")),
        "qoi" if width * height > QOI_PIXELS => refused(&format!("{QOI_PIXELS} pixels")),
        "bmp" | "dib" if !fits((3 * width).next_multiple_of(4)) => refused(&bytes),
        "sr" | "ras" if !fits((3 * width).next_multiple_of(2)) => refused(&bytes),
        "tif" | "tiff" if !fits(width * (3 + u64::from(alpha)) * u64::from(bits / 8)) => refused(&bytes),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_that_a_format_does_not_hold_are_refused_with_the_figures() {
        let fits = |format: &str, size| check(format, size, 8, false).is_ok();
        assert!(fits("webp", [16384, 16384]) && !fits("webp", [16385, 1]) && !fits("webp", [1, 16385]));
        assert!(fits("qoi", [20_000, 20_000]) && !fits("qoi", [20_000, 20_001]));
        // 3 bytes a pixel: 37,000² · 3 = 4,107,000,000; 38,000² · 3 = 4,332,000,000
        for format in ["bmp", "dib", "sr", "ras", "tif", "tiff"] {
            assert!(fits(format, [37_000, 37_000]) && !fits(format, [38_000, 38_000]), "{format}");
        }
        assert!(check("tif", [30_000, 30_000], 16, false).is_err());
        assert!(check("tif", [33_000, 33_000], 8, false).is_ok());
        assert!(check("tif", [33_000, 33_000], 8, true).is_err());
        assert!(fits("png", [65_535, 65_535]) && fits("jpg", [65_535, 65_535]) && fits("tga", [65_535, 1]));
        let told = check("webp", [20_000, 16], 8, false).unwrap_err();
        assert!(told.starts_with("webp holds 16384 pixels a side, not 20000x16"), "{told}");
    }
}

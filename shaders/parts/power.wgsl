// Powers of floats. Twin of src/kernel/power.rs.

// x^y for x of 0 or more and finite y of 0 or more; x^0 is 1, also for 0.
fn powf(x: f32, y: f32) -> f32 {
    if (y == 0.0 || x == 1.0) {
        return 1.0;
    }
    if (x <= 0.0) {
        return 0.0;
    }
    let exponent = y * log2_of(x);
    if (exponent < -150.0) {
        return 0.0;
    }
    if (exponent >= 128.0) {
        return bitcast<f32>(INFINITY_BITS);
    }
    return exp2(exponent);
}

// log2 of a positive normal float, by x = 2^e·m and the series of artanh((m − 1)/(m + 1)): exact to a few ULP also near 1,
// where WGSL's has an absolute error that large exponents of highlights would multiply.
fn log2_of(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    // the bits of √½
    let e = bitcast<i32>(bits - 0x3f3504f3u) >> 23u;
    let m = bitcast<f32>(bits - (bitcast<u32>(e) << 23u));
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    let series = 1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0 + q * (1.0 / 11.0)))));
    // 2/ln 2
    return f32(e) + 2.88539008 * s * series;
}

// Floats by their bits, and sums of products that come out the same whatever a driver fuses.

// The bits of infinity; an exponent like its is that of what is not finite.
const INFINITE_BITS: u32 = 0x7f800000u;

// The next greater float; what is not finite stays.
fn next_up(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    if ((bits & 0x7f800000u) == 0x7f800000u) {
        return x;
    }
    if ((bits & 0x7fffffffu) == 0u) {
        return bitcast<f32>(1u);
    }
    return bitcast<f32>(select(bits + 1u, bits - 1u, (bits >> 31u) != 0u));
}

// a·b − c·d: the difference of two rounded products with the error of one of them added (Kahan's). Where fused operations
// are fused the sign is right; where they are not, it is the plain difference of the rounded products.
fn difference_of_products(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let cd = c * d;
    let error = fma(-c, d, cd);
    return fma(a, b, -cd) + error;
}

// Where a pixel's samples lie: one Owen-scrambled Sobol sequence a pixel, warped by the filter. Twin of src/kernel/sampler.rs.

// ShotConstants.pixel_filter.
const FILTER_BOX: u32 = 0u;
const FILTER_TRIANGLE: u32 = 1u;
const FILTER_GAUSSIAN: u32 = 2u;

// Half the gaussian filter's width in units of σ·√2: radius 1.5, σ 0.5.
const GAUSSIAN_REACH: f32 = 2.12132034;
// erf of GAUSSIAN_REACH.
const GAUSSIAN_WITHIN_REACH: f32 = 0.9973002;
// σ·√2, in pixels.
const GAUSSIAN_SCALE: f32 = 0.707106781;

// Where sample `index` of `count` lies, from the pixel's upper left corner, in pixels.
fn place_in_pixel(index: u32, count: u32, pixel: vec2<u32>, seed: u32) -> vec2<f32> {
    if (count == 1u) {
        return vec2<f32>(0.5);
    }
    return warp(unit_square(index, pixel, seed));
}

// Point `index` of a pixel's sequence in [0, 1)².
fn unit_square(index: u32, pixel: vec2<u32>, seed: u32) -> vec2<f32> {
    let pixel_seed = hash(pixel.x ^ hash(pixel.y ^ hash(seed)));
    let point = sobol(index);
    return vec2<f32>(
        unit(owen_scramble(point.x, hash(pixel_seed))),
        unit(owen_scramble(point.y, hash(pixel_seed ^ 1u))),
    );
}

// As unit_square, for a purpose other than the place in the pixel.
fn unit_square_for(purpose: u32, index: u32, pixel: vec2<u32>, seed: u32) -> vec2<f32> {
    let own = hash(seed ^ hash(purpose ^ 0x5bd1e995u));
    return unit_square(owen_scramble(index, hash(pixel.x ^ hash(pixel.y ^ own))), pixel, own);
}

// Warps [0, 1)² by the filter's inverse cumulative distribution, separately in x and y.
fn warp(uv: vec2<f32>) -> vec2<f32> {
    if (shot.pixel_filter == FILTER_TRIANGLE) {
        return vec2<f32>(0.5 + triangle(uv.x), 0.5 + triangle(uv.y));
    }
    if (shot.pixel_filter == FILTER_GAUSSIAN) {
        return vec2<f32>(0.5 + gaussian(uv.x), 0.5 + gaussian(uv.y));
    }
    return uv;
}

// The tent of radius 1: its distribution is (1 + x)²/2 left of 0.
fn triangle(u: f32) -> f32 {
    if (u < 0.5) {
        return sqrt(2.0 * u) - 1.0;
    }
    return 1.0 - sqrt(2.0 - 2.0 * u);
}

// The gaussian of σ 0.5, cut off at 1.5.
fn gaussian(u: f32) -> f32 {
    let x = inverse_erf((2.0 * u - 1.0) * GAUSSIAN_WITHIN_REACH);
    return GAUSSIAN_SCALE * clamp(x, -GAUSSIAN_REACH, GAUSSIAN_REACH);
}

// Mike Giles, "Approximating the erfinv function", 2011 (single precision).
fn inverse_erf(x: f32) -> f32 {
    // −ln
    let w = -0.693147181 * log2_of((1.0 - x) * (1.0 + x));
    if (w < 5.0) {
        let c = w - 2.5;
        var sum = 2.8102264e-8;
        sum = sum * c + 3.4327394e-7;
        sum = sum * c - 3.5233877e-6;
        sum = sum * c - 4.3915065e-6;
        sum = sum * c + 0.00021858087;
        sum = sum * c - 0.001253725;
        sum = sum * c - 0.0041776816;
        sum = sum * c + 0.24664073;
        return x * (sum * c + 1.5014094);
    }
    let t = sqrt(w) - 3.0;
    var sum = -0.00020021426;
    sum = sum * t + 0.00010095056;
    sum = sum * t + 0.0013493432;
    sum = sum * t - 0.0036734284;
    sum = sum * t + 0.0057395077;
    sum = sum * t - 0.007622461;
    sum = sum * t + 0.0094388705;
    sum = sum * t + 1.001674;
    return x * (sum * t + 2.8329768);
}

// The first two dimensions of the Sobol sequence: van der Corput's, and the one of Pascal's triangle modulo 2.
fn sobol(index: u32) -> vec2<u32> {
    var second = 0u;
    var direction = 0x80000000u;
    var bits = index;
    while (bits != 0u) {
        if ((bits & 1u) != 0u) {
            second ^= direction;
        }
        direction ^= direction >> 1u;
        bits >>= 1u;
    }
    return vec2<u32>(reverseBits(index), second);
}

// Flips each bit by a hash of the bits above it.
fn owen_scramble(point: u32, seed: u32) -> u32 {
    var x = reverseBits(point) + seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return reverseBits(x);
}

// The finaliser of MurmurHash3, moved off its fixed point 0.
fn hash(key: u32) -> u32 {
    var x = key + 0x9e3779b9u;
    x = (x ^ (x >> 16u)) * 0x85ebca6bu;
    x = (x ^ (x >> 13u)) * 0xc2b2ae35u;
    return x ^ (x >> 16u);
}

// The upper 24 bits as a float in [0, 1).
fn unit(x: u32) -> f32 {
    return f32(x >> 8u) / 16777216.0;
}

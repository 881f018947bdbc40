// Texels: bilinear within a level, linear between levels. Twin of src/kernel/texture.rs.

// One level of a texture.
struct Level {
    size: vec2<u32>,
    // The number of its first texel in the texture.
    first: u32,
    // Where the texture stands in `texels`.
    first_texel: u32,
    flags: u32,
}

// Two texels beside each other: the place of the first, which may lie outside, and how much the second counts for.
struct Axis {
    low: i32,
    share: f32,
}

// A texture at (u, v), v running up, at a level of any value; repeated or clamped. RGBA, linear.
fn trilinear(map: MapRecord, uv: vec2<f32>, at_level: f32, clamps: bool) -> vec4<f32> {
    let level = clamp(at_level, 0.0, f32(levels(map.size) - 1u));
    let lower = u32(level);
    let share = level - f32(lower);
    var sum = vec4<f32>(0.0);
    // a loop, so that a kernel has the code of a level once
    for (var i = 0u; i < 2u; i += 1u) {
        let counts_for = select(share, 1.0 - share, i == 0u);
        if (counts_for == 0.0) {
            continue;
        }
        let at = level_of(map, lower + i);
        sum += level_mix(at, axis(uv.x, at.size.x, clamps), axis(1.0 - uv.y, at.size.y, clamps), clamps) * counts_for;
    }
    return sum;
}

// A map at texture coordinates: its scale and offset before, its base and gain after.
fn map_at(map: MapRecord, uv: vec2<f32>, level: f32) -> vec4<f32> {
    return trilinear(map, map_coordinates(map, uv), level, map_clamps(map)) * map.base_gain.y + map.base_gain.x;
}

// As map_at at level 0, clamped whatever the map says.
fn map_clamped_at(map: MapRecord, uv: vec2<f32>) -> vec4<f32> {
    return trilinear(map, map_coordinates(map, uv), 0.0, true) * map.base_gain.y + map.base_gain.x;
}

// Texture coordinates scaled and moved as the map wants.
fn map_coordinates(map: MapRecord, uv: vec2<f32>) -> vec2<f32> {
    return uv * map.scale + map.offset;
}

fn map_clamps(map: MapRecord) -> bool {
    return (map.flags & MAP_CLAMP) != 0u;
}

// How many levels a texture of that size has.
fn levels(size: vec2<u32>) -> u32 {
    return 32u - countLeadingZeros(max(max(size.x, size.y), 1u));
}

fn level_size(size: vec2<u32>, level: u32) -> vec2<u32> {
    return max(size >> vec2<u32>(min(level, 31u)), vec2<u32>(1u));
}

// A level that the texture has.
fn level_of(map: MapRecord, level: u32) -> Level {
    var first = 0u;
    for (var i = 0u; i < level; i += 1u) {
        let size = level_size(map.size, i);
        first += size.x * size.y;
    }
    return Level(level_size(map.size, level), first, map.first_texel, map.flags);
}

fn axis(coordinate: f32, size: u32, clamps: bool) -> Axis {
    var u = 0.0;
    if (clamps) {
        u = clamped(coordinate);
    } else {
        u = fraction(coordinate);
    }
    // half a texel before the middle of the first one, so that the cast rounds down
    let x = u * f32(size) + 0.5;
    let up = i32(x);
    return Axis(up - 1, x - f32(up));
}

// Between the four texels of a column and a row.
fn level_mix(level: Level, column: Axis, row: Axis, clamps: bool) -> vec4<f32> {
    let x0 = texel_place(column.low, level.size.x, clamps);
    let x1 = texel_place(column.low + 1, level.size.x, clamps);
    let y0 = level.first + texel_place(row.low, level.size.y, clamps) * level.size.x;
    let y1 = level.first + texel_place(row.low + 1, level.size.y, clamps) * level.size.x;
    let upper = texel(level, y0 + x0) * (1.0 - column.share) + texel(level, y0 + x1) * column.share;
    let lower = texel(level, y1 + x0) * (1.0 - column.share) + texel(level, y1 + x1) * column.share;
    return upper * (1.0 - row.share) + lower * row.share;
}

fn texel(level: Level, number: u32) -> vec4<f32> {
    if ((level.flags & MAP_FLOAT) != 0u) {
        let at = level.first_texel + 4u * number;
        return bitcast<vec4<f32>>(vec4<u32>(texels[at], texels[at + 1u], texels[at + 2u], texels[at + 3u]));
    }
    let code = texels[level.first_texel + number];
    let shares = unpack4x8unorm(code);
    if ((level.flags & MAP_SRGB) == 0u) {
        return shares;
    }
    // their linear values stand first
    return vec4<f32>(
        bitcast<f32>(texels[code & 255u]),
        bitcast<f32>(texels[(code >> 8u) & 255u]),
        bitcast<f32>(texels[(code >> 16u) & 255u]),
        shares.w,
    );
}

// A place that may lie two texels outside, within a side.
fn texel_place(low: i32, side: u32, clamps: bool) -> u32 {
    let size = i32(side);
    var i = low;
    if (!clamps) {
        // twice, for a side of 1
        i += select(0, size, i < 0);
        i += select(0, size, i < 0);
        i -= select(0, size, i >= size);
        i -= select(0, size, i >= size);
    }
    return u32(clamp(i, 0, size - 1));
}

// Brought into [0, 1]; 0 for what is not a number.
fn clamped(u: f32) -> f32 {
    return select(0.0, select(u, 1.0, u > 1.0), u > 0.0);
}

// What is above the next lower integer; 0 where a float has no fraction or is not a number.
fn fraction(u: f32) -> f32 {
    if (abs(u) < 8388608.0) {
        let part = u - trunc(u);
        return select(part, part + 1.0, part < 0.0);
    }
    return 0.0;
}

// The inverse of the sRGB curve, of colours of vertices.
fn linear_from_srgb(x: f32) -> f32 {
    if (x <= 0.04045) {
        return x / 12.92;
    }
    return powf((x + 0.055) / 1.055, 2.4);
}

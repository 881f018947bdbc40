// The film: one thread takes some of a pixel's samples, the pixel's lanes are added up in the workgroup. Twin of
// src/kernel/tile.rs.

var<workgroup> lane_sums: array<vec4<f32>, GROUP>;
var<workgroup> lane_albedos: array<vec3<f32>, GROUP>;
// The words of the tile's pixels, row by row.
var<workgroup> tile_words: array<u32, 4u * GROUP>;

// Every other bit of a number of up to six, from the lowest on.
fn even_bits(number: u32) -> u32 {
    return (number & 1u) | ((number >> 1u) & 2u) | ((number >> 2u) & 4u);
}

// The code of linear light: how many of the least floats of codes are not above it. What is not a number has code 0. Floats
// of 0 and more stand in the order of their bits.
fn code_of(x: f32) -> u32 {
    if (!(x > 0.0)) {
        return 0u;
    }
    let bits = bitcast<u32>(min(x, 1.0));
    var code = 0u;
    for (var step = 128u; step > 0u; step /= 2u) {
        // of 255 steps the last one asked for is number 254
        if (tables[shot.code_steps + code + step - 1u] <= bits) {
            code += step;
        }
    }
    return code;
}

@compute @workgroup_size(GROUP)
fn trace(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    thread_in_group = local;
    if (HAS_BRANCHES) {
        waiting_thread = (group.y * groups.x + group.x) * GROUP + local;
        waiting_threads = groups.x * groups.y * GROUP;
    }
    // a group's pixels lie in Morton order in a tile that is as wide as high, or twice as wide
    let lanes = slice.lanes;
    let number = local / lanes;
    let bits = countTrailingZeros(GROUP / lanes);
    let pixel = vec2<u32>(
        (group.x << ((bits + 1u) / 2u)) + even_bits(number),
        slice.first_row + (group.y << (bits / 2u)) + even_bits(number >> 1u),
    );
    let is_inside = pixel.x < shot.size.x && pixel.y < min(shot.size.y, slice.end_row);
    if (is_inside) {
        add_samples(pixel, local % lanes, lanes);
    }
    lane_sums[local] = vec4<f32>(sum.rgb, sum.through);
    if (HAS_ALBEDO) {
        lane_albedos[local] = sum.albedo;
    }
    // its barriers are also those between what the lanes write above and what is read below
    add_counts(local, group.y * groups.x + group.x);
    if (is_inside && local % lanes == 0u) {
        let samples = f32(shot.samples);
        var total = lane_sums[local];
        for (var lane = 1u; lane < lanes; lane += 1u) {
            total += lane_sums[local + lane];
        }
        let mean = total / samples;
        // its place in the tile, row by row
        let in_tile = (even_bits(number >> 1u) << ((bits + 1u) / 2u)) + even_bits(number);
        let first = FILM_WORDS * in_tile;
        if (FILM_WORDS == 1u) {
            let shown = mean.xyz * shot.gain;
            tile_words[first] = code_of(shown.x) | (code_of(shown.y) << 8u) | (code_of(shown.z) << 16u);
        } else {
            tile_words[first] = bitcast<u32>(mean.x);
            tile_words[first + 1u] = bitcast<u32>(mean.y);
            tile_words[first + 2u] = bitcast<u32>(mean.z);
        }
        if (FILM_WORDS == 4u) {
            tile_words[first + 3u] = bitcast<u32>(mean.w);
        }
        if (HAS_ALBEDO) {
            var albedo = lane_albedos[local];
            for (var lane = 1u; lane < lanes; lane += 1u) {
                albedo += lane_albedos[local + lane];
            }
            let mean_albedo = bitcast<vec3<u32>>(albedo / samples);
            let place = pixel.y * shot.size.x + pixel.x;
            let albedo_first = FILM_WORDS * shot.size.x * shot.size.y + 3u * place;
            film[albedo_first] = mean_albedo.x;
            film[albedo_first + 1u] = mean_albedo.y;
            film[albedo_first + 2u] = mean_albedo.z;
        }
    }
    workgroupBarrier();
    // neighbours write words side by side: the film may lie beyond a bus that is slow for less
    let columns = 1u << ((bits + 1u) / 2u);
    let corner = vec2<u32>(group.x * columns, slice.first_row + (group.y << (bits / 2u)));
    let row_words = FILM_WORDS * columns;
    for (var word = local; word < FILM_WORDS * GROUP / lanes; word += GROUP) {
        let row = corner.y + word / row_words;
        let column_word = word % row_words;
        let is_in_row = corner.x + column_word / FILM_WORDS < shot.size.x;
        if (is_in_row && row < min(shot.size.y, slice.end_row)) {
            film[FILM_WORDS * (row * shot.size.x + corner.x) + column_word] = tile_words[word];
        }
    }
}

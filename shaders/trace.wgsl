// The film: one thread takes some of a pixel's samples, the pixel's lanes are added up in the workgroup. Twin of
// src/kernel/tile.rs.

// What each thread has, for others of its workgroup: in the memory of the stacks, once all have traced.
fn hand_over(thread: u32, row: vec4<u32>) {
    near_stack[2u * thread] = row.xy;
    near_stack[2u * thread + 1u] = row.zw;
}

fn handed_over(thread: u32) -> vec4<u32> {
    return vec4<u32>(near_stack[2u * thread], near_stack[2u * thread + 1u]);
}

// The sum over a pixel's lanes, for the first of them.
fn sum_of_lanes(local: u32, lanes: u32, own: vec4<f32>) -> vec4<f32> {
    if (lanes == 1u) {
        return own;
    }
    workgroupBarrier();
    hand_over(local, bitcast<vec4<u32>>(own));
    workgroupBarrier();
    var total = own;
    if (local % lanes == 0u) {
        for (var lane = 1u; lane < lanes; lane += 1u) {
            total += bitcast<vec4<f32>>(handed_over(local + lane));
        }
    }
    return total;
}

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
    add_counts(local, group.y * groups.x + group.x);
    let samples = f32(shot.samples);
    let mean = sum_of_lanes(local, lanes, vec4<f32>(sum.rgb, sum.through)) / samples;
    let has_pixel = is_inside && local % lanes == 0u;
    if (HAS_ALBEDO) {
        let mean_albedo = sum_of_lanes(local, lanes, vec4<f32>(sum.albedo, 0.0)) / samples;
        if (has_pixel) {
            let place = pixel.y * shot.size.x + pixel.x;
            let first = FILM_WORDS * shot.size.x * shot.size.y + 3u * place;
            film[first] = bitcast<u32>(mean_albedo.x);
            film[first + 1u] = bitcast<u32>(mean_albedo.y);
            film[first + 2u] = bitcast<u32>(mean_albedo.z);
        }
    }
    if (FILM_WORDS == 1u) {
        if (has_pixel) {
            let shown = mean.xyz * shot.gain;
            film[pixel.y * shot.size.x + pixel.x] =
                code_of(shown.x) | (code_of(shown.y) << 8u) | (code_of(shown.z) << 16u);
        }
        return;
    }
    // neighbours write words side by side: the film may lie beyond a bus that is slow for less
    workgroupBarrier();
    if (local % lanes == 0u) {
        // by the pixel's place in the tile, row by row
        let in_tile = (even_bits(number >> 1u) << ((bits + 1u) / 2u)) + even_bits(number);
        hand_over(in_tile, bitcast<vec4<u32>>(mean));
    }
    workgroupBarrier();
    let columns = 1u << ((bits + 1u) / 2u);
    let corner = vec2<u32>(group.x * columns, slice.first_row + (group.y << (bits / 2u)));
    let row_words = FILM_WORDS * columns;
    for (var word = local; word < FILM_WORDS * GROUP / lanes; word += GROUP) {
        let row = corner.y + word / row_words;
        let column_word = word % row_words;
        let is_in_row = corner.x + column_word / FILM_WORDS < shot.size.x;
        if (is_in_row && row < min(shot.size.y, slice.end_row)) {
            let place = handed_over(word / FILM_WORDS);
            film[FILM_WORDS * (row * shot.size.x + corner.x) + column_word] = place[word % FILM_WORDS];
        }
    }
}

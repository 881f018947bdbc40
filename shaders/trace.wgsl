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

// The pixels of a workgroup, of which so many threads share each: a tile that is as wide as high, or twice as wide, but of
// whole words of codes in each row. Twin of `tile` in src/device/gpu/cuts.rs.
fn tile_columns(lanes: u32) -> u32 {
    return max(1u << ((countTrailingZeros(GROUP / lanes) + 1u) / 2u), CODES);
}

fn tile_rows(lanes: u32) -> u32 {
    return GROUP / lanes / tile_columns(lanes);
}

// In Morton order where there is more than one row.
fn place_in_tile(number: u32, lanes: u32) -> vec2<u32> {
    if (tile_rows(lanes) == 1u) {
        return vec2<u32>(number, 0u);
    }
    return vec2<u32>(even_bits(number), even_bits(number >> 1u));
}

// Codes are packed: four pixels of three bytes in three words; a row begins with a new word.
const CODES: u32 = 4u;
const CODE_WORDS: u32 = 3u;

fn code_row_words() -> u32 {
    return (CODE_WORDS * shot.size.x + CODES - 1u) / CODES;
}

// A word of codes of a row of the tile, whose first pixel has that number.
fn code_word(first: u32, word: u32) -> u32 {
    let pixel = first + word + word / CODE_WORDS;
    let shift = 8u * (word % CODE_WORDS);
    return (near_stack[pixel].x >> shift) | (near_stack[pixel + 1u].x << (24u - shift));
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
    let lanes = slice.lanes;
    let number = local / lanes;
    let tile = slice.first_tile + group.x;
    let corner = vec2<u32>(tile * tile_columns(lanes), slice.first_row + group.y * tile_rows(lanes));
    let place = place_in_tile(number, lanes);
    let pixel = corner + place;
    let is_inside = pixel.x < shot.size.x && pixel.y < min(shot.size.y, slice.end_row);
    if (is_inside) {
        add_samples(pixel, local % lanes, lanes);
    }
    let samples = f32(shot.samples);
    let mean = sum_of_lanes(local, lanes, vec4<f32>(sum.rgb, sum.through)) / samples;
    let has_pixel = local % lanes == 0u;
    if (HAS_ALBEDO) {
        let mean_albedo = sum_of_lanes(local, lanes, vec4<f32>(sum.albedo, 0.0)) / samples;
        if (is_inside && has_pixel) {
            let first = FILM_WORDS * shot.size.x * shot.size.y + 3u * (pixel.y * shot.size.x + pixel.x);
            film[first] = bitcast<u32>(mean_albedo.x);
            film[first + 1u] = bitcast<u32>(mean_albedo.y);
            film[first + 2u] = bitcast<u32>(mean_albedo.z);
        }
    }
    clear_group_counts(local);
    workgroupBarrier();
    add_to_group_counts();
    if (has_pixel) {
        // row by row
        let in_tile = place.y * tile_columns(lanes) + place.x;
        if (FILM_WORDS == 1u) {
            let shown = mean.xyz * shot.gain;
            near_stack[in_tile].x = code_of(shown.x) | (code_of(shown.y) << 8u) | (code_of(shown.z) << 16u);
        } else {
            hand_over(in_tile, bitcast<vec4<u32>>(mean));
        }
    }
    workgroupBarrier();
    add_group_counts(local, group.y * groups.x + group.x);
    // neighbours write words side by side: the film may lie beyond a bus that is slow for less
    let columns = tile_columns(lanes);
    let words = select(FILM_WORDS * columns, CODE_WORDS * columns / CODES, FILM_WORDS == 1u);
    let row_words = select(FILM_WORDS * shot.size.x, code_row_words(), FILM_WORDS == 1u);
    let first = words * tile;
    for (var word = local; word < words * tile_rows(lanes); word += GROUP) {
        let row = corner.y + word / words;
        let in_row = word % words;
        if (first + in_row < row_words && row < min(shot.size.y, slice.end_row)) {
            let at = row * row_words + first + in_row;
            if (FILM_WORDS == 1u) {
                film[at] = code_word(word / words * columns, in_row);
            } else {
                film[at] = handed_over(word / FILM_WORDS)[word % FILM_WORDS];
            }
        }
    }
}

// Models 3 to 10: what their surfaces add, and where paths go from there. Twin of src/kernel/branch.rs.
//
// A mirrored ray is gone along at once, else the refracted one; what is left of the surface waits, the latest first. What
// waits at one time was left by surfaces of one path, each with more bounces than the one before, of which only those with
// fewer than `depth` leave anything, and each one entry: there are `depth` entries at most.

// Rows of an entry: 0 to 2 the path, 3 and 4 its media, 5 the surface's place and 6 to 9 with it the pane.
const WAITING_ROWS: u32 = 10u;

// A mirrored or refracted ray;
const WAITING_RAY: u32 = 0u;
// a ray that goes straight on from its surface;
const WAITING_STRAIGHT: u32 = 1u;
// a pane whose mirrored light is added up in a sum of its own.
const WAITING_PANE: u32 = 2u;

// The thread's number in the dispatch and how many there are, so that neighbours' rows lie side by side; and how much waits.
var<private> waiting_thread: u32;
var<private> waiting_threads: u32;
var<private> waiting_count: u32;

fn waiting_row(entry: u32, row: u32) -> u32 {
    return (entry * WAITING_ROWS + row) * waiting_threads + waiting_thread;
}

// A surface of model 4 or 9.
struct Glass {
    weight: vec3<f32>,
    // A + D + S.
    plain: vec3<f32>,
    specular: vec3<f32>,
    mirror: vec3<f32>,
    transparency: vec3<f32>,
}

// Adds its colour; gives what goes straight on counts for.
fn add_glass(glass: Glass, incoming: vec3<f32>) -> vec3<f32> {
    let mirrors = glass.mirror * incoming;
    let shine = min(element_sum(glass.specular + mirrors) / 3.0, 1.0);
    let opacity = max(1.0 - glass.transparency, vec3<f32>(shine));
    sum.rgb += glass.weight * opacity * (glass.plain + mirrors);
    return glass.weight * (1.0 - opacity);
}

// The densities on both sides of a surface, and what a ray is inside of behind it.
struct Border {
    // Where the ray comes from.
    n1: f32,
    // Behind the surface.
    n2: f32,
    behind: Media,
    // Whether the stack was full.
    is_too_deep: bool,
}

// The surface as met by the path.
fn border_of(surface: Surface) -> Border {
    var behind = media;
    let own = materials[surface.material].ni;
    if (surface.is_front) {
        let outside = media_density(&behind);
        let is_too_deep = !media_enter(&behind, surface.material);
        return Border(outside, own, behind, is_too_deep);
    }
    media_leave(&behind, surface.material);
    return Border(own, media_density(&behind), behind, false);
}

// Adds what a surface shows, by its model; true where the path goes on as a mirrored or refracted ray, else it goes straight
// on with the weight that it is left with.
fn settle(s: Shading) -> bool {
    let m = s.constants;
    if (m.illum == 10u) {
        path.weight += s.weight * (1.0 - shadow(s.sum));
        return false;
    }
    let plain = plain_color(s);
    let mirror = mirror_of(m);
    let away = mirrored(s.view, s.surface.n);
    if (m.illum == 8u || m.illum == 9u) {
        let seen = environment(s.surface.material, away);
        if (m.illum == 8u) {
            sum.rgb += s.weight * (plain + mirror * seen);
        } else {
            path.weight = add_glass(Glass(s.weight, plain, s.sum.specular, mirror, transparency(m)), seen);
        }
        return false;
    }
    if (m.illum == 4u) {
        return meet_pane(s, Glass(s.weight, plain, s.sum.specular, mirror, transparency(m)), away);
    }
    sum.rgb += s.weight * plain;
    if (path.used >= shot.depth) {
        return false;
    }
    var split = Split(mirror, away, false, vec3<f32>(0.0), vec3<f32>(0.0));
    if (m.illum == 5u) {
        split.mirror = schlick(mirror, dot(s.surface.n, s.view));
    }
    if (m.illum != 6u && m.illum != 7u) {
        return split_path(s, split, media);
    }
    let border = border_of(s.surface);
    let bent = refracted(s.view, s.surface.n, border.n1, border.n2);
    if (bent.is_total) {
        split.mirror = vec3<f32>(1.0);
        if (m.illum == 6u) {
            split.mirror = mirror + (1.0 - mirror) * m.tf;
        }
    } else {
        if (m.illum == 7u) {
            // leaving the denser side, the cosine is that on the thinner side
            split.mirror = schlick(mirror, select(dot(s.surface.n, s.view), bent.cosine, border.n1 > border.n2));
        }
        if (border.is_too_deep) {
            traced.media_ignored += 1u;
        }
        split.is_refracted = true;
        split.share = (1.0 - split.mirror) * m.tf;
        split.direction = bent.direction;
    }
    return split_path(s, split, border.behind);
}

// What models 8 and 9 mirror: the material's `refl` map, else the background.
fn environment(material: u32, direction: vec3<f32>) -> vec3<f32> {
    if (HAS_TEXTURES) {
        if (material_maps[material * MATERIAL_MAPS + REFLECTION] != REFLECTION_NONE) {
            return reflection(material, direction);
        }
    }
    return background(direction);
}

// What leaves a surface but for the straight ray.
struct Split {
    // What is mirrored, and where to.
    mirror: vec3<f32>,
    away: vec3<f32>,
    // What is refracted, and where to.
    is_refracted: bool,
    share: vec3<f32>,
    direction: vec3<f32>,
}

// Goes on with what is mirrored, else with what is refracted, which is then inside of `behind`; the others wait. False where
// neither counts.
fn split_path(s: Shading, split: Split, behind: Media) -> bool {
    let is_refracted = split.is_refracted && counts(s.weight * split.share * base);
    let is_mirrored = counts(s.weight * split.mirror * base);
    if (!is_refracted && !is_mirrored) {
        return false;
    }
    if (!is_zero(path.weight)) {
        push_path(WAITING_STRAIGHT, path, media);
    }
    let bent = leaving(s.surface, s.weight * split.share, split.direction);
    if (is_refracted) {
        traced.refracted += 1u;
        if (is_mirrored) {
            push_path(WAITING_RAY, bent, behind);
        }
    }
    if (is_mirrored) {
        traced.mirrored += 1u;
        path = leaving(s.surface, s.weight * split.mirror, split.away);
    } else {
        path = bent;
        media = behind;
    }
    return true;
}

// A surface of model 4. What it lets through depends on what it mirrors, which is therefore added up first.
fn meet_pane(s: Shading, glass: Glass, away: vec3<f32>) -> bool {
    let mirrored_base = glass.weight * glass.mirror * base;
    if (path.used >= shot.depth || !counts(mirrored_base)) {
        path.weight = add_glass(glass, vec3<f32>(0.0));
        return false;
    }
    traced.mirrored += 1u;
    push_pane(glass);
    path = leaving(s.surface, vec3<f32>(1.0), away);
    sum.rgb = vec3<f32>(0.0);
    base = mirrored_base;
    return true;
}

// A mirrored or refracted ray that leaves the surface, with what it counts for there.
fn leaving(surface: Surface, weight: vec3<f32>, direction: vec3<f32>) -> Path {
    let side = select(surface.ng, -surface.ng, dot(surface.ng, direction) < 0.0);
    let ray = Ray(offset_origin(surface.position, side, surface.magnitude), direction);
    return Path(ray, order_start(), weight, 0u, path.used + 1u, path.travelled + path.after.distance, false, false);
}

fn words_of(v: vec3<f32>, last: u32) -> vec4<u32> {
    return vec4<u32>(bitcast<vec3<u32>>(v), last);
}

fn floats_of(row: vec4<u32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(row.xyz);
}

// Lets a path wait, inside of what it is then inside of.
fn push_path(kind: u32, p: Path, inside: Media) {
    let entry = waiting_count;
    // never where the room is what it must be
    if (entry >= slice.waiting_each) {
        return;
    }
    waiting_count = entry + 1u;
    let flags = kind
        | select(0u, 4u, p.is_camera)
        | select(0u, 8u, p.sees_first)
        | (inside.depth << 4u)
        | (p.crossed << 8u);
    waiting[waiting_row(entry, 0u)] = words_of(p.ray.origin, flags);
    waiting[waiting_row(entry, 1u)] = words_of(p.ray.direction, p.used);
    waiting[waiting_row(entry, 2u)] = words_of(p.weight, bitcast<u32>(p.travelled));
    let m = inside.materials;
    if (inside.depth > 0u) {
        waiting[waiting_row(entry, 3u)] = vec4<u32>(m[0], m[1], m[2], m[3]);
    }
    if (inside.depth > 4u) {
        waiting[waiting_row(entry, 4u)] = vec4<u32>(m[4], m[5], m[6], m[7]);
    }
    if (kind == WAITING_STRAIGHT) {
        waiting[waiting_row(entry, 5u)] = vec4<u32>(bitcast<u32>(p.after.distance), p.after.primitive, 0u, 0u);
    }
}

// Lets a pane at the path's surface wait, with the sum so far and what it counts for. The path's weight is what the pane
// leaves later, so the pane's stands in its place.
fn push_pane(glass: Glass) {
    let entry = waiting_count;
    path.weight = glass.weight;
    push_path(WAITING_PANE, path, media);
    if (entry >= slice.waiting_each) {
        return;
    }
    let b = bitcast<vec3<u32>>(base);
    waiting[waiting_row(entry, 5u)] =
        vec4<u32>(bitcast<u32>(path.after.distance), path.after.primitive, b.x, b.y);
    let rgb = bitcast<vec3<u32>>(sum.rgb);
    let mirror = bitcast<vec3<u32>>(glass.mirror);
    waiting[waiting_row(entry, 6u)] = words_of(glass.plain, b.z);
    waiting[waiting_row(entry, 7u)] = words_of(glass.specular, rgb.x);
    waiting[waiting_row(entry, 8u)] = words_of(glass.transparency, rgb.y);
    waiting[waiting_row(entry, 9u)] = vec4<u32>(mirror, rgb.z);
}

// Takes what waits, the latest first, up to a ray that is worth tracing; false where there is none.
fn take_waiting() -> bool {
    while (waiting_count > 0u) {
        waiting_count -= 1u;
        let entry = waiting_count;
        let row0 = waiting[waiting_row(entry, 0u)];
        let row1 = waiting[waiting_row(entry, 1u)];
        let row2 = waiting[waiting_row(entry, 2u)];
        let kind = row0.w & 3u;
        path.ray = Ray(floats_of(row0), floats_of(row1));
        path.after = order_start();
        path.weight = floats_of(row2);
        path.crossed = row0.w >> 8u;
        path.used = row1.w;
        path.travelled = bitcast<f32>(row2.w);
        path.is_camera = (row0.w & 4u) != 0u;
        path.sees_first = (row0.w & 8u) != 0u;
        media.depth = (row0.w >> 4u) & 15u;
        if (media.depth > 0u) {
            let row3 = waiting[waiting_row(entry, 3u)];
            media.materials[0] = row3.x;
            media.materials[1] = row3.y;
            media.materials[2] = row3.z;
            media.materials[3] = row3.w;
        }
        if (media.depth > 4u) {
            let row4 = waiting[waiting_row(entry, 4u)];
            media.materials[4] = row4.x;
            media.materials[5] = row4.y;
            media.materials[6] = row4.z;
            media.materials[7] = row4.w;
        }
        if (kind == WAITING_RAY) {
            return true;
        }
        let row5 = waiting[waiting_row(entry, 5u)];
        path.after = HitOrder(bitcast<f32>(row5.x), row5.y);
        if (kind == WAITING_PANE) {
            let row6 = waiting[waiting_row(entry, 6u)];
            let row7 = waiting[waiting_row(entry, 7u)];
            let row8 = waiting[waiting_row(entry, 8u)];
            let row9 = waiting[waiting_row(entry, 9u)];
            let incoming = sum.rgb;
            sum.rgb = bitcast<vec3<f32>>(vec3<u32>(row7.w, row8.w, row9.w));
            base = bitcast<vec3<f32>>(vec3<u32>(row5.z, row5.w, row6.w));
            let glass = Glass(path.weight, floats_of(row6), floats_of(row7), floats_of(row9), floats_of(row8));
            path.weight = add_glass(glass, incoming);
        }
        if (go_straight_on()) {
            return true;
        }
    }
    return false;
}

// The share of light that a shadow catcher misses: mean of the channels, 0 where there would be none.
fn shadow(sum: Reflected) -> f32 {
    let missing = select(vec3<f32>(0.0), 1.0 - sum.diffuse / sum.specular, sum.specular > vec3<f32>(0.0));
    return clamp(element_sum(missing) / 3.0, 0.0, 1.0);
}

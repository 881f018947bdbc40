// Rays through packed trees (src/accel/packed.rs), and through the level above objects, whose leaves are objects.

// Whether the frame is one object that stands where its vertices say.
override SINGLE_TREE: bool = false;

// A group of children that wait: the first one's place and which of them were entered; the first entries of each thread's
// stack are in the workgroup's memory, the others in its own, which is cleared for each thread: as many as a frame's trees
// need, see `far` in src/device/gpu/shaders.rs. The less a workgroup has of its memory, the more of them run at once;
// trace.wgsl needs two entries a thread of it when all have traced.
const NEAR: u32 = 2u;
const FAR: u32 = 48u;
var<workgroup> near_stack: array<vec2<u32>, NEAR * GROUP>;
var<private> far_stack: array<vec2<u32>, FAR>;
// Set by each kernel before it traces.
var<private> thread_in_group: u32;

// A ray as trees want it.
struct TracedRay {
    origin: vec3<f32>,
    inverse: vec3<f32>,
    // For each axis whether the ray goes up: what slots are turned by, so that those in front come first.
    turn: u32,
    shear: ShearRay,
}

fn traced_ray(ray: Ray) -> TracedRay {
    let inverse = inverse_of_each(ray.direction);
    let up = select(vec3<u32>(0u), vec3<u32>(1u, 2u, 4u), inverse >= vec3<f32>(0.0));
    return TracedRay(ray.origin, inverse, up.x | up.y | up.z, shear_ray(ray));
}

// What is looked for along a ray: the first candidate strictly between two places of the order.
struct Search {
    after: HitOrder,
    before: HitOrder,
    // What was found: ABSENT while nothing was.
    object: u32,
    triangle: u32,
    place: u32,
    barycentric: vec2<f32>,
    // Whether a candidate was met that lets shadow rays through.
    is_clear: bool,
}

// The children of a node that a ray enters not after a distance.
struct Entered {
    // As on the stack: the first inner child, in the upper byte those that are entered, in the lower which there are.
    group: vec2<u32>,
    // The node's first triangle, and which of them and the others stand in leaves that are entered.
    leaves: vec2<u32>,
}

// Turns the slots of a mask: slot i becomes slot i ^ turn.
fn turned(mask: u32, turn: u32) -> u32 {
    var slots = mask;
    slots = select(slots, ((slots & 0x55u) << 1u) | ((slots >> 1u) & 0x55u), (turn & 1u) != 0u);
    slots = select(slots, ((slots & 0x33u) << 2u) | ((slots >> 2u) & 0x33u), (turn & 2u) != 0u);
    return select(slots, ((slots & 0x0fu) << 4u) | (slots >> 4u), (turn & 4u) != 0u);
}

// Those of a node's children whose slots are in a mask; the node's first two rows.
fn entered_children(head: vec4<u32>, links: vec4<u32>, mask: u32, turn: u32) -> Entered {
    let inner = head.w >> 24u;
    var in_leaves = 0u;
    for (var left = mask & ~inner; left != 0u; left &= left - 1u) {
        let slot = firstTrailingBit(left);
        let leaf = select(links.z, links.w, slot >= 4u) >> (8u * (slot & 3u));
        in_leaves |= ((leaf >> 5u) & 7u) << (leaf & 31u);
    }
    return Entered(vec2<u32>(links.x, (turned(mask & inner, turn) << 24u) | inner), vec2<u32>(links.y, in_leaves));
}

// Planes are taken as real numbers and widened by more than what the computation may be off, so that nothing inside a box is
// entered before it, nor met where it is missed. A plane's distance is byte·step + start: with u = 2^-24 start is off by 2u of
// itself, step is exact, the product and the sum add 2u of at most start and 256 steps, and an own box's plane is off by 2u of
// no more than that: 6u of both together. And a ray leaves a box later by the factor of slab.rs, 16u of the same. 32u are
// taken.
fn enter(node: u32, ray: TracedRay, distance: f32) -> Entered {
    let row = 5u * node;
    let head = nodes[row];
    let links = nodes[row + 1u];
    let low_xy = nodes[row + 2u];
    let low_z_high_x = nodes[row + 3u];
    let high_yz = nodes[row + 4u];
    // each of three bytes to where a float has its exponent
    let exponents = (vec3<u32>(head.w) << vec3<u32>(23u, 15u, 7u)) & vec3<u32>(INFINITE_BITS);
    let step = bitcast<vec3<f32>>(exponents) * ray.inverse;
    let start = (bitcast<vec3<f32>>(head.xyz) - ray.origin) * ray.inverse;
    let slack = fma(abs(step), vec3<f32>(256.0), abs(start)) * 0.0000019073486328125;
    let near = start - slack;
    let far = start + slack;
    let back = ray.inverse < vec3<f32>(0.0);
    let near_x = select(low_xy.xy, low_z_high_x.zw, back.x);
    let far_x = select(low_z_high_x.zw, low_xy.xy, back.x);
    let near_y = select(low_xy.zw, high_yz.xy, back.y);
    let far_y = select(high_yz.xy, low_xy.zw, back.y);
    let near_z = select(low_z_high_x.xy, high_yz.zw, back.z);
    let far_z = select(high_yz.zw, low_z_high_x.xy, back.z);
    let low_near = array<u32, 3>(near_x.x, near_y.x, near_z.x);
    let low_far = array<u32, 3>(far_x.x, far_y.x, far_z.x);
    let high_near = array<u32, 3>(near_x.y, near_y.y, near_z.y);
    let high_far = array<u32, 3>(far_x.y, far_y.y, far_z.y);
    let mask = entered_of_four(low_near, low_far, step, near, far, distance)
        | (entered_of_four(high_near, high_far, step, near, far, distance) << 4u);
    return entered_children(head, links, mask, ray.turn);
}

// Which of four children are entered; a slot without a child has no bits that come of it.
fn entered_of_four(
    near_bytes: array<u32, 3>,
    far_bytes: array<u32, 3>,
    step: vec3<f32>,
    near: vec3<f32>,
    far: vec3<f32>,
    distance: f32,
) -> u32 {
    let entry = max(
        max(planes(near_bytes[0], step.x, near.x), planes(near_bytes[1], step.y, near.y)),
        max(planes(near_bytes[2], step.z, near.z), vec4<f32>(0.0)),
    );
    let exit = min(
        min(planes(far_bytes[0], step.x, far.x), planes(far_bytes[1], step.y, far.y)),
        min(planes(far_bytes[2], step.z, far.z), vec4<f32>(distance)),
    );
    let slots = select(vec4<u32>(0u), vec4<u32>(1u, 2u, 4u, 8u), entry <= exit);
    return (slots.x | slots.y) | (slots.z | slots.w);
}

// Distances of four planes.
fn planes(bytes: u32, step: f32, start: f32) -> vec4<f32> {
    return fma(vec4<f32>(unpack4xU8(bytes)), vec4<f32>(step), vec4<f32>(start));
}

// Tests the triangle at a place; true where it is the first yet of those that are looked for. With `any` those that let shadow
// rays through are noted and passed by.
fn test_triangle(
    place: u32,
    ray: TracedRay,
    object: u32,
    first_primitive: u32,
    any: bool,
    search: ptr<function, Search>,
) -> bool {
    // the sheared axes are rows
    let row = 3u * place;
    let last = ray.shear.last;
    let row_x = triangles[row + select(last + 1u, 0u, last == 2u)];
    let row_y = triangles[row + select(last - 1u, 2u, last == 0u)];
    let row_z = triangles[row + last];
    let x = bitcast<vec3<f32>>(row_x.xyz);
    let y = bitcast<vec3<f32>>(row_y.xyz);
    let z = bitcast<vec3<f32>>(row_z.xyz);
    let origin = sheared_axes(last, ray.origin);
    let in_plane = hit_in_plane(origin, ray.shear.shear, x, y, z);
    if (!(in_plane.distance > 0.0 && in_plane.distance <= (*search).before.distance)) {
        return false;
    }
    // a box is the same in any order of the axes
    let own = own_box(vec3<f32>(x.x, y.x, z.x), vec3<f32>(x.y, y.y, z.y), vec3<f32>(x.z, y.z, z.z));
    let entry = box_entry(own, origin, sheared_axes(last, ray.inverse));
    if (entry < 0.0) {
        return false;
    }
    let candidate = HitOrder(max(in_plane.distance, entry), first_primitive + row_x.w);
    if (!precedes((*search).after, candidate) || !precedes(candidate, (*search).before)) {
        return false;
    }
    if (HAS_TRANSPARENCY && any) {
        if (is_clear(object, row_x.w)) {
            (*search).is_clear = true;
            return false;
        }
    }
    (*search).before = candidate;
    (*search).object = object;
    (*search).triangle = row_x.w;
    (*search).place = place;
    (*search).barycentric = in_plane.barycentric;
    return true;
}

// A root as if it were the only child that was entered.
fn root_group(root: u32) -> vec2<u32> {
    return vec2<u32>(root, 0x80000000u);
}

// The entries of a thread's stack by their place.
fn put_on_stack(place: u32, group: vec2<u32>) {
    if (place < NEAR) {
        near_stack[place * GROUP + thread_in_group] = group;
    } else {
        far_stack[min(place - NEAR, FAR - 1u)] = group;
    }
}

fn on_stack(place: u32) -> vec2<u32> {
    if (place < NEAR) {
        return near_stack[place * GROUP + thread_in_group];
    }
    return far_stack[min(place - NEAR, FAR - 1u)];
}

// Looks for a candidate; with `any` the first one found ends the search.
fn search_along(world: Ray, any: bool, search: ptr<function, Search>) {
    var size = 0u;
    // the stack's size where the object's tree begins
    var floor_of_object = 0u;
    var object = 0u;
    var first_primitive = 0u;
    var ray = traced_ray(world);
    var in_top = !SINGLE_TREE;
    var group: vec2<u32>;
    // a ray from farther away than the top level was made for enters all of its children
    var enters_all = false;
    if (SINGLE_TREE) {
        group = root_group(objects[0].root);
    } else {
        group = root_group(shot.top_node);
        let reach = abs(world.origin);
        let most = bitcast<f32>(tables[shot.top_reach]);
        enters_all = !(reach.x <= most && reach.y <= most && reach.z <= most);
    }
    if (shot.object_count == 0u || group.x == ABSENT) {
        return;
    }
    if (SINGLE_TREE && !any) {
        // before the root stands the box of all: most rays of many a picture end here
        let row = 5u * (group.x - 1u);
        let whole = Aabb(bitcast<vec3<f32>>(nodes[row].xyz), bitcast<vec3<f32>>(nodes[row + 1u].xyz));
        if (box_entry(whole, ray.origin, ray.inverse) < 0.0) {
            return;
        }
    }
    loop {
        var leaves = vec2<u32>(0u);
        if (group.y > 0x00ffffffu) {
            let bit = firstLeadingBit(group.y);
            group.y &= ~(1u << bit);
            if (group.y > 0x00ffffffu) {
                put_on_stack(size, group);
                size += 1u;
            }
            let slot = (bit - 24u) ^ ray.turn;
            let node = group.x + countOneBits(group.y & ((1u << slot) - 1u));
            var distance = (*search).before.distance;
            var entered = enter(node, ray, distance);
            if (!SINGLE_TREE && in_top && enters_all) {
                entered = entered_children(nodes[5u * node], nodes[5u * node + 1u], 0xffu, ray.turn);
            }
            group = entered.group;
            leaves = entered.leaves;
        } else {
            leaves = group;
            group = vec2<u32>(0u);
        }
        while (leaves.y != 0u) {
            let bit = firstLeadingBit(leaves.y);
            leaves.y &= ~(1u << bit);
            if (!SINGLE_TREE && in_top) {
                object = tables[shot.top_objects + leaves.x + bit];
                let entry = box_entry(object_box(object, ray.origin), ray.origin, ray.inverse);
                if (objects[object].root == ABSENT || entry < 0.0 || entry > (*search).before.distance) {
                    continue;
                }
                // what is left of this node waits
                if (group.y > 0x00ffffffu) {
                    put_on_stack(size, group);
                    size += 1u;
                }
                if (leaves.y != 0u) {
                    put_on_stack(size, leaves);
                    size += 1u;
                }
                floor_of_object = size;
                first_primitive = objects[object].first_primitive;
                if ((objects[object].flags & PLACED) != 0u) {
                    ray = traced_ray(object_ray(object, world));
                }
                in_top = false;
                group = root_group(objects[object].root);
                break;
            }
            if (test_triangle(leaves.x + bit, ray, object, first_primitive, any, search) && any) {
                return;
            }
        }
        if (group.y <= 0x00ffffffu) {
            if (!SINGLE_TREE && !in_top && size == floor_of_object) {
                in_top = true;
                ray = traced_ray(world);
            }
            if (size == 0u) {
                return;
            }
            size -= 1u;
            group = on_stack(size);
        }
    }
}

// What was found.
fn hit_of(search: Search) -> Hit {
    return Hit(search.before.distance, search.object, search.triangle, search.place, search.barycentric);
}

// The first candidate after a place of the order.
fn closest(ray: Ray, after: HitOrder) -> Hit {
    let end = HitOrder(bitcast<f32>(INFINITE_BITS), 0u);
    var search = Search(after, end, ABSENT, 0u, 0u, vec2<f32>(0.0), false);
    search_along(ray, false, &search);
    return hit_of(search);
}

// What a shadow ray meets: nothing, something that lets no light through, or else only what may let some through.
const MEETS_NOTHING: u32 = 0u;
const MEETS_OPAQUE: u32 = 1u;
const MEETS_CLEAR: u32 = 2u;

// What is met at a distance below `end`.
fn meets(ray: Ray, end: f32) -> u32 {
    var search = Search(order_start(), HitOrder(end, 0u), ABSENT, 0u, 0u, vec2<f32>(0.0), false);
    search_along(ray, true, &search);
    if (search.object != ABSENT) {
        return MEETS_OPAQUE;
    }
    return select(MEETS_NOTHING, MEETS_CLEAR, search.is_clear);
}

// The corners of the triangle that was hit, in its object's space.
fn corners_of(hit: Hit) -> array<vec3<f32>, 3> {
    let x = bitcast<vec4<f32>>(triangles[3u * hit.place]);
    let y = bitcast<vec4<f32>>(triangles[3u * hit.place + 1u]);
    let z = bitcast<vec4<f32>>(triangles[3u * hit.place + 2u]);
    return array<vec3<f32>, 3>(vec3<f32>(x.x, y.x, z.x), vec3<f32>(x.y, y.y, z.y), vec3<f32>(x.z, y.z, z.z));
}

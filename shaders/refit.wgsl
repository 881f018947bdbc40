// Fits packed trees (src/accel/packed.rs) to positions: corners into leaves, own boxes into nodes, from below. Eight
// threads take a node, one for each slot. The nodes of one height above the leaves are one dispatch; the upper part of a
// tree, which has few nodes, is one workgroup's, height after height.

// A tree, and where its parts are.
struct RefitTree {
    // Places of words in `words`: positions; the nodes by height; for each height its first node in that list, and the
    // list's end. And in rows of four: for each place of a leaf the triangle's vertices and its number.
    positions: u32,
    vertices: u32,
    by_height: u32,
    heights: u32,
    height_count: u32,
    // The height from which on one workgroup does it all.
    top_height: u32,
    // The first node in `nodes`, and the first triangle in `triangles`: numbers in `by_height` count from them.
    first_node: u32,
    first_triangle: u32,
    // The first box in `boxes`, in pairs of rows.
    first_box: u32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
}

// One dispatch: so many nodes of a tree's list.
struct RefitLevel {
    tree: u32,
    first: u32,
    // 0 where tops are fitted, of so many trees from the first one on.
    count: u32,
    trees: u32,
}

@group(0) @binding(0) var<storage, read> level: RefitLevel;
@group(0) @binding(1) var<storage, read> trees: array<RefitTree>;
@group(0) @binding(2) var<storage, read> words: array<u32>;
@group(0) @binding(3) var<storage, read_write> nodes: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> triangles: array<vec4<u32>>;
// For each node two rows: the least corner, and the half surfaces of all boxes below it; the greatest corner.
@group(0) @binding(5) var<storage, read_write> boxes: array<vec4<f32>>;
// For each tree its surface-area cost.
@group(0) @binding(6) var<storage, read_write> costs: array<f32>;
// The same as `words`, by rows of four.
@group(0) @binding(7) var<storage, read> rows: array<vec4<u32>>;

// Threads of a workgroup.
override GROUP: u32 = 64u;

// What threads hand over, first boxes and then bytes: the less a workgroup has of its memory, the more is left to caches.
var<workgroup> given: array<array<u32, 7>, GROUP>;

fn give_box(thread: u32, low: vec4<f32>, high: vec3<f32>) {
    let l = bitcast<vec4<u32>>(low);
    let h = bitcast<vec3<u32>>(high);
    given[thread] = array<u32, 7>(l.x, l.y, l.z, l.w, h.x, h.y, h.z);
}

fn given_low(thread: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(vec4<u32>(given[thread][0], given[thread][1], given[thread][2], given[thread][3]));
}

fn given_high(thread: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(vec3<u32>(given[thread][4], given[thread][5], given[thread][6]));
}

fn is_finite(v: vec3<f32>) -> bool {
    let exponents = bitcast<vec3<u32>>(v) & vec3<u32>(INFINITE_BITS);
    return all(exponents != vec3<u32>(INFINITE_BITS));
}

// Whether a triangle can be hit.
fn has_area(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> bool {
    if (!is_finite(a) || !is_finite(b) || !is_finite(c)) {
        return false;
    }
    let e = b * 0.5 - a * 0.5;
    let f = c * 0.5 - a * 0.5;
    // most have: the normal is far above its roundings and far within the range of f32
    let p = e.yzx * f.zxy;
    let q = e.zxy * f.yzx;
    let normal = abs(p - q);
    let terms = abs(p) + abs(q);
    let size = normal.x + normal.y + normal.z;
    if (size > (terms.x + terms.y + terms.z) * 0.00000095367431640625 && size > 1e-30 && size < 1e30) {
        return true;
    }
    // edges are scaled, so that neither tiny nor huge ones leave that range
    let size_e = max(abs(e.x), max(abs(e.y), abs(e.z)));
    let size_f = max(abs(f.x), max(abs(f.y), abs(f.z)));
    if (size_e == 0.0 || size_f == 0.0) {
        return false;
    }
    let g = e / size_e;
    let h = f / size_f;
    let n = vec3<f32>(
        difference_of_products(g.y, h.z, g.z, h.y),
        difference_of_products(g.z, h.x, g.x, h.z),
        difference_of_products(g.x, h.y, g.y, h.x),
    );
    return any(n != vec3<f32>(0.0));
}

fn position(tree: RefitTree, vertex: u32) -> vec3<f32> {
    let at = tree.positions + 3u * vertex;
    return bitcast<vec3<f32>>(vec3<u32>(words[at], words[at + 1u], words[at + 2u]));
}

fn half_area(box: Aabb) -> f32 {
    let s = box.high - box.low;
    return select(s.x * s.y + s.y * s.z + s.z * s.x, 0.0, box.low.x > box.high.x);
}

// Takes the corners of a triangle; gives its own box. One that cannot be hit has three equal corners and no box.
fn fit_triangle(tree: RefitTree, place: u32) -> Aabb {
    let vertices = rows[tree.vertices + place - tree.first_triangle];
    let number = vertices.w;
    var a = position(tree, vertices.x);
    var b = position(tree, vertices.y);
    var c = position(tree, vertices.z);
    let infinite = bitcast<f32>(INFINITE_BITS);
    var box = Aabb(vec3<f32>(infinite), vec3<f32>(-infinite));
    if (has_area(a, b, c)) {
        box = own_box(a, b, c);
    } else {
        a = vec3<f32>(0.0);
        b = a;
        c = a;
    }
    // by axes, so that a ray takes them in the order of its own
    triangles[3u * place] = vec4<u32>(bitcast<vec3<u32>>(vec3<f32>(a.x, b.x, c.x)), number);
    triangles[3u * place + 1u] = vec4<u32>(bitcast<vec3<u32>>(vec3<f32>(a.y, b.y, c.y)), number);
    triangles[3u * place + 2u] = vec4<u32>(bitcast<vec3<u32>>(vec3<f32>(a.z, b.z, c.z)), number);
    return box;
}

// The least exponent, with f32's bias, of a quantum of which 255 reach from the least to the greatest: what it is computed
// from is widened by more than its roundings. 1 at least, where quanta are normal floats.
fn exponent_for(low: f32, high: f32) -> u32 {
    let quantum = (0.5 * high - 0.5 * low) * (2.0 / 255.0) * 1.000003814697265625;
    let bits = bitcast<u32>(max(quantum, 0.0));
    return clamp((bits >> 23u) + select(0u, 1u, (bits & 0x007fffffu) != 0u), 1u, 254u);
}

// Quanta from the origin to a plane, rounded outwards: the difference's own rounding is taken off first.
fn quanta(origin: f32, plane: f32, exponent: u32, is_upper: bool) -> u32 {
    let half = 0.5 * plane - 0.5 * origin;
    // 2 over the quantum, a power of two
    let per_quantum = bitcast<f32>((255u - exponent) << 23u);
    if (is_upper) {
        return u32(clamp(ceil(half * 1.0000002384185791015625 * per_quantum), 0.0, 255.0));
    }
    return u32(clamp(floor(half * 0.99999976158142089843750 * per_quantum), 0.0, 255.0));
}

// A slot's byte of four words.
fn bytes_of(row: u32, word: u32, first_lane: u32) -> u32 {
    // rows 2 to 4 hold, by halves, the lesser x, y, z, the greater x, y, z
    let plane = (row - 2u) * 2u + word / 2u;
    let lane = first_lane + 4u * (word & 1u);
    let end = plane / 3u;
    let shift = 8u * (plane % 3u);
    let lanes = vec4<u32>(given[lane][end], given[lane + 1u][end], given[lane + 2u][end], given[lane + 3u][end]);
    let bytes = (lanes >> vec4<u32>(shift)) & vec4<u32>(0xffu);
    return bytes.x | (bytes.y << 8u) | (bytes.z << 16u) | (bytes.w << 24u);
}

// Fits a node with all threads of the workgroup present; `is_there` says whether this thread's node is one.
fn fit_node(tree: RefitTree, node: u32, is_there: bool, thread: u32) {
    let slot = thread & 7u;
    let first_lane = thread & ~7u;
    let infinite = bitcast<f32>(INFINITE_BITS);
    var box = Aabb(vec3<f32>(infinite), vec3<f32>(-infinite));
    var area_below = 0.0;
    var inner = 0u;
    if (is_there) {
        let links = nodes[5u * node + 1u];
        inner = nodes[5u * node].w >> 24u;
        let child_meta = (select(links.z, links.w, slot >= 4u) >> (8u * (slot & 3u))) & 0xffu;
        if (((inner >> slot) & 1u) != 0u) {
            let child = links.x + countOneBits(inner & ((1u << slot) - 1u));
            let at = 2u * (tree.first_box + child - tree.first_node);
            let low = boxes[at];
            box = Aabb(low.xyz, boxes[at + 1u].xyz);
            area_below = low.w;
        } else {
            let first = links.y + (child_meta & 31u);
            let count = countOneBits(child_meta >> 5u);
            for (var i = 0u; i < count; i++) {
                let own = fit_triangle(tree, first + i);
                box = Aabb(min(box.low, own.low), max(box.high, own.high));
            }
        }
    }
    give_box(thread, vec4<f32>(box.low, area_below + half_area(box)), box.high);
    workgroupBarrier();
    var low = given_low(first_lane);
    var high = given_high(first_lane);
    for (var i = 1u; i < 8u; i++) {
        let other = given_low(first_lane + i);
        low = vec4<f32>(min(low.xyz, other.xyz), low.w + other.w);
        high = max(high, given_high(first_lane + i));
    }
    workgroupBarrier();
    let is_empty = low.x > high.x;
    let origin = select(low.xyz, vec3<f32>(0.0), is_empty);
    let end = select(high, vec3<f32>(0.0), is_empty);
    let exponents = vec3<u32>(
        exponent_for(origin.x, end.x),
        exponent_for(origin.y, end.y),
        exponent_for(origin.z, end.z),
    );
    // an empty box has its lesser planes above its greater ones, which no ray enters
    var low_quanta = vec3<u32>(255u);
    var high_quanta = vec3<u32>(0u);
    if (box.low.x <= box.high.x) {
        low_quanta = vec3<u32>(
            quanta(origin.x, box.low.x, exponents.x, false),
            quanta(origin.y, box.low.y, exponents.y, false),
            quanta(origin.z, box.low.z, exponents.z, false),
        );
        high_quanta = vec3<u32>(
            quanta(origin.x, box.high.x, exponents.x, true),
            quanta(origin.y, box.high.y, exponents.y, true),
            quanta(origin.z, box.high.z, exponents.z, true),
        );
    }
    given[thread][0] = low_quanta.x | (low_quanta.y << 8u) | (low_quanta.z << 16u);
    given[thread][1] = high_quanta.x | (high_quanta.y << 8u) | (high_quanta.z << 16u);
    workgroupBarrier();
    if (is_there) {
        if (slot == 0u) {
            let packed = exponents.x | (exponents.y << 8u) | (exponents.z << 16u) | (inner << 24u);
            nodes[5u * node] = vec4<u32>(bitcast<vec3<u32>>(origin), packed);
        } else if (slot == 1u) {
            let at = 2u * (tree.first_box + node - tree.first_node);
            boxes[at] = low;
            boxes[at + 1u] = vec4<f32>(high, 0.0);
        } else if (slot < 5u) {
            nodes[5u * node + slot] = vec4<u32>(
                bytes_of(slot, 0u, first_lane),
                bytes_of(slot, 1u, first_lane),
                bytes_of(slot, 2u, first_lane),
                bytes_of(slot, 3u, first_lane),
            );
        }
    }
}

@compute @workgroup_size(GROUP)
fn refit_level(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = (group.y * groups.x + group.x) * (GROUP / 8u) + thread / 8u;
    let tree = trees[level.tree];
    let is_there = number < level.count;
    var node = 0u;
    if (is_there) {
        node = tree.first_node + words[tree.by_height + level.first + number];
    }
    fit_node(tree, node, is_there, thread);
}

@compute @workgroup_size(GROUP)
fn refit_top(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let top = group.y * groups.x + group.x;
    if (top >= level.trees) {
        return;
    }
    let tree = trees[level.tree + top];
    for (var height = tree.top_height; height < tree.height_count; height++) {
        let first = words[tree.heights + height];
        let count = words[tree.heights + height + 1u] - first;
        for (var start = 0u; start < count; start += GROUP / 8u) {
            let number = start + thread / 8u;
            let is_there = number < count;
            var node = 0u;
            if (is_there) {
                node = tree.first_node + words[tree.by_height + first + number];
            }
            fit_node(tree, node, is_there, thread);
            // what is shared may be written again only when all have read it
            workgroupBarrier();
        }
        storageBarrier();
    }
    if (thread == 0u) {
        let at = 2u * tree.first_box;
        let low = boxes[at];
        let whole = half_area(Aabb(low.xyz, boxes[at + 1u].xyz));
        costs[level.tree + top] = select(0.0, low.w / whole, whole > 0.0);
        // before the root stands the box of all
        let before = 5u * (tree.first_node - 1u);
        nodes[before] = vec4<u32>(bitcast<vec3<u32>>(low.xyz), 0u);
        nodes[before + 1u] = vec4<u32>(bitcast<vec3<u32>>(boxes[at + 1u].xyz), 0u);
    }
}

// Rays counted, by thread and then by workgroup. Twin of src/kernel/mod.rs.

// Surfaces that a ray crosses at most, straight on; beyond them it sees nothing.
const SURFACES_MAX: u32 = 256u;

struct RayCounts {
    camera: u32,
    shadow: u32,
    mirrored: u32,
    refracted: u32,
    media_ignored: u32,
}

// Those of this thread.
var<private> traced: RayCounts;

var<workgroup> group_counts: array<atomic<u32>, 5>;

// Rows of counters that workgroups take in turn: all would wait for one.
const COUNTER_ROWS: u32 = 256u;

// Adds the threads' counts to the frame's, in three steps with a barrier of the workgroup after each of the first two.
fn clear_group_counts(local: u32) {
    if (local < 5u) {
        atomicStore(&group_counts[local], 0u);
    }
}

fn add_to_group_counts() {
    add_count(0u, traced.camera);
    add_count(1u, traced.shadow);
    add_count(2u, traced.mirrored);
    add_count(3u, traced.refracted);
    add_count(4u, traced.media_ignored);
}

fn add_group_counts(local: u32, group: u32) {
    if (local < 5u) {
        let more = atomicLoad(&group_counts[local]);
        if (more != 0u) {
            atomicAdd(&counters[8u * (group % COUNTER_ROWS) + local], more);
        }
    }
}

fn add_count(kind: u32, rays: u32) {
    if (rays != 0u) {
        atomicAdd(&group_counts[kind], rays);
    }
}

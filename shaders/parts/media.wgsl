// What a ray is inside of: a stack of media. Twin of src/kernel/media.rs.

// Media that a ray is within at most; deeper ones are ignored.
const MEDIA_MAX: u32 = 8u;

// The materials that a ray has entered and not left, the latest last.
struct Media {
    materials: array<u32, MEDIA_MAX>,
    depth: u32,
}

// The density of the latest; 1 outside of all.
fn media_density(media: ptr<function, Media>) -> f32 {
    let depth = (*media).depth;
    if (depth == 0u) {
        return 1.0;
    }
    return materials[(*media).materials[depth - 1u]].ni;
}

// Enters a material; false where that is too deep and ignored.
fn media_enter(media: ptr<function, Media>, material: u32) -> bool {
    let depth = (*media).depth;
    if (depth >= MEDIA_MAX) {
        return false;
    }
    (*media).materials[depth] = material;
    (*media).depth = depth + 1u;
    return true;
}

// Leaves a material: its latest entry is removed, where there is one.
fn media_leave(media: ptr<function, Media>, material: u32) {
    let depth = (*media).depth;
    for (var place = depth; place > 0u; place -= 1u) {
        if ((*media).materials[place - 1u] == material) {
            for (var later = place; later < depth; later += 1u) {
                (*media).materials[later - 1u] = (*media).materials[later];
            }
            (*media).depth = depth - 1u;
            return;
        }
    }
}

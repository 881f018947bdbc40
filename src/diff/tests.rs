use super::*;
use crate::scene::{ABSENT, Corners, Faces, MaterialRuns, Positions, TexelSpace, Texels, Texture, Triangles};
use std::sync::Arc;

/// Two meshes of one triangle each over six positions, with normals.
fn frame(positions: [[f32; 3]; 6], second: [u32; 3], normals: [u32; 3], kd: f32) -> Frame {
    let triangles = vec![[0, 1, 2], second];
    let mesh = |i| Mesh { first_face: i, face_count: 1, first_triangle: i, triangle_count: 1 };
    let geometry = Geometry {
        positions: Part::new(Positions(positions.to_vec())),
        faces: Part::new(Faces { counts: vec![3, 3], corners: triangles.as_flattened().to_vec() }),
        triangles: Part::new(Triangles(triangles)),
        texcoords: None,
        normals: Some(Attribute {
            values: Part::new(Normals(vec![[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])),
            corners: Part::new(Corners(vec![[ABSENT; 3], normals])),
        }),
        colors: None,
        material_runs: Part::new(MaterialRuns(vec![[0, 0]])),
        materials: vec![Part::new(Material { kd: [kd; 3], ..Material::default() })],
        meshes: vec![mesh(0), mesh(1)],
    };
    Frame { objects: vec![Object { geometry: Arc::new(geometry), transform: None }] }
}

const AT_REST: [[f32; 3]; 6] =
    [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]];

fn rest() -> Frame {
    frame(AT_REST, [3, 4, 5], [0, 0, 0], 0.5)
}

#[test]
fn without_a_frame_before_everything_is_added() {
    assert_eq!(changes(None, &rest()), Change { added: 2, ..Change::default() });
    assert_eq!(changes(Some(&rest()), &Frame::default()), Change { removed: 2, ..Change::default() });
}

#[test]
fn a_moved_vertex_deforms_the_mesh_that_uses_it() {
    let mut moved = AT_REST;
    moved[4][0] = 1.5;
    let after = frame(moved, [3, 4, 5], [0, 0, 0], 0.5);
    assert_eq!(changes(Some(&rest()), &after), Change { same: 1, deformed: 1, ..Change::default() });
}

#[test]
fn other_faces_are_a_reshape_and_another_normal_index_is_not() {
    let faces = frame(AT_REST, [3, 5, 4], [0, 0, 0], 0.5);
    assert_eq!(changes(Some(&rest()), &faces), Change { same: 1, reshaped: 1, ..Change::default() });
    let normals = frame(AT_REST, [3, 4, 5], [2, 2, 2], 0.5);
    assert_eq!(changes(Some(&rest()), &normals), Change { same: 1, deformed: 1, ..Change::default() });
}

#[test]
fn a_colour_is_a_material_and_a_transform_is_rigid() {
    let kd = frame(AT_REST, [3, 4, 5], [0, 0, 0], 0.6);
    assert_eq!(changes(Some(&rest()), &kd), Change { same: 2, materials: 1, ..Change::default() });
    let mut moved = rest();
    moved.objects[0].transform = Some(crate::math::DAffine3::from_translation(glam::DVec3::X));
    assert_eq!(changes(Some(&rest()), &moved), Change { rigid: 2, ..Change::default() });
}

/// The frame at rest whose material has those maps: of Kd, and of bump with a factor.
fn textured(kd: Option<u8>, bump: Option<(u8, f32)>) -> Frame {
    let map = |texel: u8, bump_multiplier: f32| Map {
        texture: Part::new(Texture {
            size: [1, 1],
            space: TexelSpace::Linear,
            alpha_varies: false,
            texels: Texels::U8(vec![[texel; 4]]),
        }),
        scale: [1.0; 2],
        offset: [0.0; 2],
        clamp: false,
        base_gain: [0.0, 1.0],
        bump_multiplier,
        channel: None,
    };
    let textures = Textures {
        map_kd: kd.map(|texel| map(texel, 1.0)),
        bump: bump.map(|(texel, factor)| map(texel, factor)),
        ..Textures::default()
    };
    let mut frame = rest();
    let mut geometry = Geometry::clone(&frame.objects[0].geometry);
    geometry.materials = vec![Part::new(Material { textures, ..Material::clone(&geometry.materials[0]) })];
    frame.objects[0].geometry = Arc::new(geometry);
    frame
}

#[test]
fn textures_are_counted_apart_from_the_materials_that_use_them() {
    let counts = |before: &Frame, after: &Frame| {
        let change = changes(Some(before), after);
        (change.textures, change.materials)
    };
    let before = textured(Some(1), Some((2, 1.0)));
    assert_eq!(counts(&before, &before), (0, 0));
    assert_eq!(counts(&before, &textured(Some(3), Some((2, 1.0)))), (1, 0), "another content");
    assert_eq!(counts(&before, &textured(Some(3), Some((4, 1.0)))), (2, 0));
    assert_eq!(counts(&before, &textured(Some(1), None)), (1, 0), "it went");
    assert_eq!(counts(&textured(None, None), &before), (2, 0), "they came");
    assert_eq!(counts(&before, &textured(Some(1), Some((2, 0.5)))), (0, 1), "used otherwise");
    assert_eq!(counts(&before, &textured(Some(2), Some((1, 1.0)))), (0, 1), "both are still there");
    assert_eq!(changes(None, &before).textures, 2);
}

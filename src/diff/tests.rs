use super::*;
use crate::scene::{ABSENT, Corners, Faces, MaterialRuns, Positions, Triangles};
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

use super::*;
use crate::scene::{ABSENT, Material, Part};
use proptest::prelude::*;

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn library() -> Library {
    let material = |kd: f32| Part::new(Material { kd: [kd; 3], ..Material::default() });
    [("red", 0.1), ("rot", 0.1), ("blue", 0.2), ("a  b", 0.3), ("", 0.4)]
        .map(|(name, kd)| (name.as_bytes().to_vec(), material(kd)))
        .into_iter()
        .collect()
}

fn parse(obj: impl AsRef<[u8]>, lenient: bool) -> (Result<ParsedObj, String>, Vec<String>) {
    let options = ReadOptions { lenient, ..ReadOptions::default() };
    let mut warnings = Warnings::default();
    let parsed = parse_obj(obj.as_ref(), Path::new("a.obj"), &library(), &options, &mut warnings);
    (parsed.map_err(|e| e.to_string()), warnings.list().iter().map(ToString::to_string).collect())
}

/// Of an OBJ in which nothing is odd.
fn shape(obj: impl AsRef<[u8]>) -> Geometry {
    let (parsed, warnings) = parse(obj, false);
    assert_eq!(warnings, [""; 0]);
    parsed.unwrap().geometry
}

/// Of an OBJ with something odd, and the one warning.
fn odd(obj: impl AsRef<[u8]>) -> (Geometry, String) {
    let (parsed, mut warnings) = parse(obj, false);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    (parsed.unwrap().geometry, warnings.remove(0))
}

fn triangles(geometry: &Geometry) -> &[[u32; 3]] {
    &geometry.triangles.0
}

#[test]
fn positions_and_faces_stay_as_written() {
    let g = shape(format!("{SQUARE}v 9 9 9\nf 4 3 2 1\nf 1 2 3\n"));
    assert_eq!(g.positions.0.len(), 5, "the unused one too");
    assert_eq!((&g.faces.counts[..], &g.faces.corners[..]), (&[4, 3][..], &[3, 2, 1, 0, 0, 1, 2][..]));
    assert_eq!(triangles(&g), [[3, 2, 1], [3, 1, 0], [0, 1, 2]]);
    assert!(g.texcoords.is_none() && g.normals.is_none() && g.colors.is_none());
}

#[test]
fn layout_does_not_matter() {
    let plain = shape(format!("{SQUARE}f 1 2 3 4\n"));
    for obj in [
        format!("{SQUARE}f 1 2 3 4"),
        format!("{SQUARE}f 1 2 3 4\n").replace('\n', "\r\n"),
        format!("{SQUARE}f 1 2 3 4\n").replace('\n', "\r"),
        format!("{SQUARE}f 1 2 3 4\n").replace(' ', " \t  "),
        format!("{SQUARE}f 1 2 3 4\n").replace('\n', "  \n\n \t"),
        format!("{SQUARE}f 1 2 3 4\n").replace('\n', " # so\n"),
        format!("{SQUARE}f 1 2 3 4\n").replace('\n', "#so\n"),
        format!("# v 1 2 3\n{SQUARE}f \\\n1 2 \\\r\n 3 4\n"),
        format!("\u{feff}{SQUARE}f 1 2 3 4\n"),
        format!("f 1 2 3 4\n{SQUARE}"),
        format!("{SQUARE}f -4 -3 -2 -1\n"),
        format!("{SQUARE}f +1 2// 3/ 4\ng An f Three Other Things\n"),
        format!("{SQUARE}f 1 2 3 4\ns off\nvp 1\n").replace("vp 1\n", "vw 1 0.5\n"),
    ] {
        assert_eq!(shape(&obj), plain, "{obj:?}");
    }
}

#[test]
fn corners_of_each_form() {
    let g = shape(format!(
        "{SQUARE}vt 0 0\nvt 1 0 5\nvt 0.5\nvn 0 0 1\nvn 0 1 0\nf 1/1 2/2 3/3\nf 1//2 2//1 3//1\nf 1/1/1 2/2/2 3/-1/-1\n"
    ));
    let (texcoords, normals) = (g.texcoords.unwrap(), g.normals.unwrap());
    assert_eq!(texcoords.values.0, [[0.0, 0.0], [1.0, 0.0], [0.5, 0.0]]);
    assert_eq!(texcoords.corners.0, [[0, 1, 2], [ABSENT; 3], [0, 1, 2]]);
    assert_eq!(normals.corners.0, [[ABSENT; 3], [1, 0, 0], [0, 1, 1]]);
}

#[test]
fn attributes_follow_their_polygon() {
    // an arrow head whose notch, corner 2, must be an end of the cut
    let g = shape("v 0 0 0\nv 2 1 0\nv 4 0 0\nv 2 4 0\nvt 0 0\nvt 1 0\nvt 2 0\nvt 3 0\nf 1/4 2/3 3/2 4/1\n");
    let texcoords = &g.texcoords.as_ref().unwrap().corners.0;
    assert_eq!(triangles(&g).len(), 2);
    for (triangle, texcoord) in triangles(&g).iter().zip(texcoords) {
        assert_eq!(triangle.map(|corner| 3 - corner), *texcoord);
    }
}

#[test]
fn a_bad_face_fails_its_frame_by_line() {
    for (face, cause) in [
        ("f 1 2 9", "position index 9 is beyond the file's 4 vertices"),
        ("f 1 2 99999999999", "position index 99999999999 is beyond the file's 4 vertices"),
        ("f 0 1 2", "position index 0 is not one: they count from 1, or back from -1"),
        ("f -5 1 2", "position index -5 reaches back before the file's first vertex"),
        ("f 1 2 3.5", "`3.5` is no corner (position, position/texcoord, position//normal or all three)"),
        ("f 1 2 x", "`x` is no corner (position, position/texcoord, position//normal or all three)"),
        (
            "f 1 2 3/1/1/1",
            "`3/1/1/1` is no corner (position, position/texcoord, position//normal or all three)",
        ),
        ("f 1 2 /1", "`/1` is no corner (position, position/texcoord, position//normal or all three)"),
    ] {
        let (parsed, _) = parse(format!("{SQUARE}f 1\nf 1 \\\n2 3\n  {face}\nf 7 7 7\n"), false);
        let remedy = "the frame is not rendered (--lenient drops the face)";
        assert_eq!(parsed.unwrap_err(), format!("a.obj:8: {cause}; {remedy}"));
    }
    for vertex in
        ["v nan 0 0", "v 0 inf 0", "v 1 2", "v", "v 1 2 x", "v 3.1+e2 0 0", "v 1e39 0 0", "v 1.#IND 0 0"]
    {
        let obj = format!("{SQUARE}{vertex}\n");
        assert!(parse(format!("{obj}f 1 2 3\n"), false).0.is_ok(), "unused, it does no harm: {vertex}");
        let error = parse(format!("{obj}f 1 2 5\n"), false).0.unwrap_err();
        assert!(error.starts_with("a.obj:6: vertex 5 (line 5) is not three finite numbers;"), "{error}");
    }
}

#[test]
fn lenient_drops_bad_faces_and_keeps_the_rest_in_place() {
    let obj = format!(
        "{SQUARE}vt 0 0\nusemtl red\nf 1 2 9\nf 1/1 2/1 3/1\no a\nf 0 1 2 3\nusemtl blue\nf 1 3 4\no b\nf 1 2 3\n"
    );
    let (parsed, warnings) = parse(obj, true);
    let g = parsed.unwrap().geometry;
    let cause = "position index 9 is beyond the file's 4 vertices";
    assert_eq!(
        warnings,
        [format!("a.obj:7: faces with an unusable vertex are dropped, the first because {cause} (2 times)")]
    );
    assert_eq!(triangles(&g), [[0, 1, 2], [0, 2, 3], [0, 1, 2]]);
    assert_eq!(g.texcoords.unwrap().corners.0, [[0; 3], [ABSENT; 3], [ABSENT; 3]]);
    assert_eq!(g.material_runs.0, [[0, 0], [1, 1]]);
    assert_eq!(g.meshes.iter().map(|m| m.first_triangle).collect::<Vec<_>>(), [0, 1, 2]);
}

#[test]
fn indices_of_attributes_that_are_not_there_count_as_absent() {
    for (corner, kind) in [("1/0", "texcoord"), ("1/9", "texcoord"), ("1/-9", "texcoord"), ("1//9", "normal")]
    {
        let (g, warning) = odd(format!("{SQUARE}vt 0 0\nvn 0 0 1\nf {corner} 2 3\n"));
        assert!(g.texcoords.is_none() && g.normals.is_none(), "{corner}");
        assert_eq!(
            warning,
            format!("a.obj:7: a {kind} index is 0 or beyond the file's 1 {kind}; it counts as absent")
        );
    }
    for (normal, cause) in [
        ("vn 0 0 0", "a normal has length 0"),
        ("vn nan 0 1", "a normal is not three finite numbers"),
        ("vn 1e39 0 0", "a normal is not three finite numbers"),
    ] {
        let (g, warning) = odd(format!("{SQUARE}vn 0 0 1\n{normal}\nf 1//1 2//2 3//2\n"));
        assert_eq!(g.normals.unwrap().corners.0, [[0, ABSENT, ABSENT]], "{normal}");
        assert_eq!(
            warning,
            format!("a.obj:6: {cause}; where a corner names it, it counts as absent (2 times)")
        );
    }
    // faces that were dropped are not counted among the lines
    let (_, warnings) = parse(format!("{SQUARE}f 1 2 9\nf 1/1 2 3\n"), true);
    assert!(warnings.iter().any(|w| w.starts_with("a.obj: a texcoord index")), "{warnings:?}");
    let (g, _) = odd(format!("{SQUARE}vt nan 0\nf 1/1 2/1 3/1\n"));
    assert!(g.texcoords.is_none());
}

#[test]
fn what_is_something_else_is_refused() {
    let refused = |bytes: &[u8]| parse(bytes, true).0.err();
    assert_eq!(
        refused(b"# a\n\nsolid cube # of steel\nfacet normal 0 0 1\n").unwrap(),
        "a.obj:3: is no OBJ: none of its lines is a statement of one, the first is `solid cube # of steel`; export it again, or name an OBJ file"
    );
    assert!(refused(b"\x1f\x8b\x08\0\0abc").unwrap().starts_with("a.obj:1: is binary, not text"));
    assert!(refused(b"v 0 0 0\n# \0\n").unwrap().starts_with("a.obj:2: is binary"));
    // one statement of the format, whatever it does, and the others are left out
    for known in ["v 1 2 3", "v", "vt x", "f 1", "g a", "s off", "mtllib a", "usemtl b", "o", "p 1", "end"] {
        assert_eq!(refused(format!("ny 1\n{known}\n").as_bytes()), None, "{known}");
    }
    for nothing in ["", "\n \t\n", "# v\n#\n"] {
        assert_eq!(refused(nothing.as_bytes()), None, "{nothing:?}");
    }
}

#[test]
fn what_is_left_out_is_counted() {
    let warning = |lines: &str| odd(format!("{SQUARE}{lines}")).1;
    assert_eq!(
        warning("f\nf 1\nf 1 2\n"),
        "a.obj:5: a face has fewer than 3 corners and is dropped (3 times)"
    );
    assert_eq!(
        warning("f 1// 2//\nf 1// 2// 3//\n"),
        "a.obj:5: a face has fewer than 3 corners and is dropped"
    );
    assert_eq!(
        warning("p 1\nl 1 2\n"),
        "a.obj:5: points, lines, curves and surfaces are not rendered (2 times)"
    );
    assert_eq!(
        warning("ny 1\nnv 2\nvc 3\n"),
        "a.obj:5: unknown statements are skipped, the first is `ny` (3 times)"
    );
    assert_eq!(
        warning("usemtl green\nf 1 2 3\n"),
        "a.obj:5: material `green` is in no library; its faces get the default"
    );
    assert_eq!(
        warning("# usemtl green\ng usemtl green\nusemtl red\n usemtl\tgreen # so\nf 1 2 3\n"),
        "a.obj:8: material `green` is in no library; its faces get the default"
    );
    let empty = odd("");
    assert_eq!(empty.1, "a.obj: the file is empty; its frame shows the background");
    assert_eq!((triangles(&empty.0).len(), empty.0.meshes.len(), empty.0.material_runs.0.len()), (0, 0, 0));
    assert_eq!(shape("# nothing\n").positions.0.len(), 0);
}

#[test]
fn colours_of_vertices() {
    let g = shape("v 0 0 0 1 0.5 0\nv 1 0 0\nv 0 1 0 0 1 0 0.5\nv 0 0 1 2\nv 0 0 2 nan nan nan\nf 1 2 3\n");
    let colors = &g.colors.as_ref().unwrap().0;
    assert_eq!((colors[0], colors[2]), ([1.0, 0.5, 0.0], [0.0, 1.0, 0.0]));
    for none in [1, 3, 4] {
        assert!(colors[none].iter().all(|c| c.is_nan()));
    }
    assert_eq!(g.positions.0[3], [0.0, 0.0, 1.0], "w is not divided by");
    assert!(shape(format!("{SQUARE}v 0 0 0 nan nan nan\n")).colors.is_none());
}

#[test]
fn meshes_are_runs_between_objects() {
    let runs = |obj: &str| -> Vec<(u32, u32, u32, u32)> {
        let g = shape(format!("{SQUARE}{obj}"));
        g.meshes.iter().map(|m| (m.first_face, m.face_count, m.first_triangle, m.triangle_count)).collect()
    };
    assert_eq!(runs("f 1 2 3 4\ng a\nf 1 2 3\n"), [(0, 2, 0, 3)]);
    assert_eq!(runs("o a\nf 1 2 3 4\no b\no c\nf 1 2 3\no d\n"), [(0, 1, 0, 2), (1, 1, 2, 1)]);
    assert_eq!(runs("f 1 2 3 4\no a\nf 1 2 3\n"), [(0, 1, 0, 2), (1, 1, 2, 1)]);
    let many = |count| runs(&"o x\nf 1 2 3\n".repeat(count)).len();
    assert_eq!((many(4096), many(4097)), (4096, 1));
}

#[test]
fn materials_have_slots_by_content() {
    let obj = format!(
        "{SQUARE}f 1 2 3 4\nusemtl blue\nusemtl red\nf 1 2 3\nusemtl rot\nf 1 2 3\no x\nf 1 2 3\nusemtl  a  b  # c\nf 1 2 3 4\nusemtl red\nf 1 2 3\nusemtl\nf 1 2 3\nusemtl blue\n"
    );
    let parsed = parse(obj, false).0.unwrap();
    // red and rot are the same; blue has no face
    assert_eq!(parsed.geometry.material_runs.0, [[0, ABSENT], [2, 0], [5, 1], [7, 0], [8, 2]]);
    assert_eq!(parsed.material_names, [&b"red"[..], b"a  b", b""]);
    assert_eq!(parsed.geometry.materials.iter().map(|m| m.kd[0]).collect::<Vec<_>>(), [0.1, 0.3, 0.4]);
    assert!(parse(b"v 0 0 0\nusemtl \xE6\nf 1 1 1\n", false).0.is_ok(), "names are bytes");
}

#[test]
fn faces_that_are_all_transparent_are_told_of() {
    let ghost = Part::new(Material { d: 0.0, ..Material::default() });
    let library: Library = [(b"ghost".to_vec(), ghost)].into_iter().collect();
    let warned = |obj: &str| {
        let mut warnings = Warnings::default();
        let obj = format!("{SQUARE}{obj}");
        parse_obj(obj.as_bytes(), Path::new("a.obj"), &library, &ReadOptions::default(), &mut warnings)
            .unwrap();
        !warnings.is_empty()
    };
    assert!(warned("usemtl ghost\nf 1 2 3\n"));
    assert!(!warned("f 1 2 3\nusemtl ghost\nf 1 2 3\n") && !warned("usemtl ghost\n"));
}

#[test]
fn smoothing_groups_give_normals_where_there_are_none() {
    let tent = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\n";
    let flat = shape(format!("{tent}s off\nf 1 2 3 4\ns 0\nf 1 4 5\n"));
    assert!(flat.normals.is_none());
    let smooth = shape(format!("{tent}s 1\nf 1 2 3 4\nf 1 4 5\n")).normals.unwrap();
    let half = 0.5f32.sqrt();
    let at = |triangle: usize, corner: usize| smooth.values.0[smooth.corners.0[triangle][corner] as usize];
    // at 1 the square's 45° + 45° and the wall's 90°
    assert!((at(0, 0)[0] - half).abs() < 1e-6 && (at(0, 0)[2] - half).abs() < 1e-6);
    assert_eq!(at(0, 1), [0.0, 0.0, 1.0]);
    let apart = shape(format!("{tent}s 1\nf 1 2 3 4\ns 2\nf 1 4 5\n")).normals.unwrap();
    assert_eq!(apart.values.0[apart.corners.0[2][0] as usize], [1.0, 0.0, 0.0]);
    // vn comes first; a corner without keeps its place among the group's triangles
    let mixed = shape(format!("{tent}vn 0 1 0\ns 1\nf 1 2 3 4\nf 1//1 4 5//1\n")).normals.unwrap();
    assert_eq!((mixed.corners.0[2][0], mixed.corners.0[2][2]), (0, 0));
    let own = mixed.values.0[mixed.corners.0[0][0] as usize];
    assert!((own[0] - half).abs() < 1e-6, "{own:?}");
}

#[test]
fn an_angle_takes_the_place_of_groups() {
    let options = ReadOptions { smooth_angle_deg: Some(91.0), ..ReadOptions::default() };
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\ns off\nf 1 2 3\nf 1 3 4\n";
    let parsed =
        parse_obj(obj.as_bytes(), Path::new("a.obj"), &library(), &options, &mut Warnings::default());
    let normals = parsed.unwrap().geometry.normals.unwrap();
    let half = 0.5f32.sqrt();
    assert!((normals.values.0[normals.corners.0[0][0] as usize][0] - half).abs() < 1e-6);
}

#[test]
fn deformation_keeps_indices() {
    // the same faces over other positions: derived normals move, their indices do not
    let of = |z: &str| shape(format!("v 0 0 {z}\nv 1 0 0\nv 1 1 0\nv 0 1 0\ns 1\nf 1 2 3\nf 1 3 4\n"));
    let (a, b) = (of("0"), of("0.5"));
    assert_eq!(
        (a.faces, a.triangles, a.normals.unwrap().corners),
        (b.faces, b.triangles, b.normals.unwrap().corners)
    );
}

fn bounds(obj: &[u8]) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    add_to_bounds(&mut bounds, &Text::new(obj, Path::new("a.obj")).unwrap());
    bounds
}

#[test]
fn bounds_are_those_of_finite_positions() {
    let obj = "  v 1 2 3 1 0 0\nvn 9 9 9\nvt 8 8\n# v 7 7 7\no v 7 7 7\nv\t-1 5 0\nv nan 99 0\nv 9 9\rv 0 0 -4 v\nvw 5 5 5";
    assert_eq!(
        bounds(obj.as_bytes()),
        Bounds { min: DVec3::new(-1.0, 0.0, -4.0), max: DVec3::new(1.0, 5.0, 3.0) }
    );
    assert!(bounds(b"f 1 2 3").is_empty());
}

/// Small files with something of everything, to be damaged.
const SOUND: &str = "mtllib a.mtl\no a\nv -1.5 0 1e-2\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nv 0 1 .5\nvt 0 0\nvt 1 1 0\nvn 0 0 1\ns 1\n\
    usemtl red\nf 1/1/1 2/2/1 3/1/1 4/2/1\no b # c\nusemtl blue\nf -4 -3 -2\nf 1//1 \\\n2//1 3 4//1 1\nl 1 2\n";

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Whatever bytes change, there is a shape with valid indices or an error, and the box is that of the positions.
    #[test]
    fn no_bytes_do_harm(edits in prop::collection::vec((0usize..400, 0u8..3, any::<u8>(), 0usize..24), 1..12), lenient: bool) {
        const LIKELY: &[u8; 24] = b"0123456789.-+eEfvn /\n\r#\\";
        let mut obj = SOUND.as_bytes().to_vec();
        for (place, how, byte, likely) in edits {
            let place = place % obj.len();
            let byte = if byte < 32 { byte } else { LIKELY[likely] };
            match how {
                0 => obj[place] = byte,
                1 => obj.insert(place, byte),
                _ => { obj.remove(place); }
            }
        }
        let Ok(parsed) = parse(&obj, lenient).0 else { return Ok(()) };
        let g = parsed.geometry;
        let positions = &g.positions.0;
        prop_assert!(triangles(&g).iter().flatten().all(|&i| positions[i as usize].iter().all(|x| x.is_finite())));
        prop_assert_eq!(triangles(&g).len(), g.faces.corners.len() - 2 * g.faces.counts.len());
        prop_assert_eq!(triangles(&g).len() as u32, g.meshes.iter().map(|m| m.triangle_count).sum::<u32>());
        prop_assert!(g.material_runs.0.first().is_none_or(|run| run[0] == 0));
        for (corners, values) in [
            g.texcoords.as_ref().map(|a| (&a.corners.0, a.values.0.len())),
            g.normals.as_ref().map(|a| (&a.corners.0, a.values.0.len())),
        ].into_iter().flatten() {
            prop_assert_eq!(corners.len(), triangles(&g).len());
            prop_assert!(corners.iter().flatten().all(|&i| i == ABSENT || (i as usize) < values));
        }
        let mut expected = Bounds::EMPTY;
        for p in positions.iter().filter(|p| p.iter().all(|x| x.is_finite())) {
            expected.add(DVec3::from(p.map(f64::from)));
        }
        prop_assert_eq!(bounds(&obj), expected);
    }
}

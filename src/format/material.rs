//! From an MTL's statements to a material: what they say, the job's laid over, and the defaults of CONTRACT 5.

use super::mtl::{Given, MapSlot, MapStatement, Side};
use super::texture::TextureUse;
use crate::math::linear_from_srgb;
use crate::scene::{Map, Material, Part, Reflection, Texture, Textures};
use std::path::PathBuf;

/// A map statement and what its file was found to be.
#[derive(Debug)]
pub(super) struct FoundMap {
    /// What it is a map of.
    pub slot: MapSlot,
    /// What the statement says.
    pub statement: MapStatement,
    /// Where it stands.
    pub said_in: PathBuf,
    /// The file; None where there is none.
    pub path: Option<PathBuf>,
    /// The file's content; None where it cannot be had.
    pub texture: Option<Part<Texture>>,
}

impl MapSlot {
    /// What the numbers of such a map are.
    pub(super) fn texture_use(self) -> TextureUse {
        match self {
            Self::Ka | Self::Kd | Self::Ks | Self::Ke | Self::Refl(_) => TextureUse::Color,
            Self::Ns | Self::D | Self::Bump | Self::Norm => TextureUse::Data,
        }
    }
}

/// Makes a material of what an MTL says and what the job says on top of that. `warn` hears what is odd.
pub(super) fn material(
    mut given: Given,
    changes: Given,
    maps: Vec<FoundMap>,
    srgb: bool,
    warn: &mut dyn FnMut(&str),
) -> Material {
    let tf_of_job = changes.tf.is_some();
    given.lay_over(changes);
    if let (Some(d), Some(tr)) = (given.d, given.tr)
        && (d + tr - 1.0).abs() > 1e-3
    {
        warn("d and Tr disagree; d is used");
    }
    if given.ni.is_some_and(|ni| ni <= 0.0) {
        warn("Ni of 0 or less counts as 1");
        given.ni = Some(1.0);
    }
    let textures = textures(maps);
    if textures.map_kd.is_some() && given.kd == Some([0.0; 3]) {
        warn("Kd 0 0 0 beside map_Kd counts as 1 1 1, else the map would not be seen");
        given.kd = Some([1.0; 3]);
    }
    let tf_given = tf_of_job || given.tf.is_some_and(|tf| tf != [1.0; 3]);
    Material { tf_given, ..filled_in(&given, textures, srgb) }
}

/// What the statements say, and the defaults for what they do not: 1 for what has a map.
fn filled_in(given: &Given, textures: Textures, srgb: bool) -> Material {
    let color = |color: Option<[f32; 3]>, map: &Option<Map>, absent: f32| {
        let given = color.map(|c| if srgb { c.map(linear) } else { c });
        given.unwrap_or([if map.is_some() { 1.0 } else { absent }; 3])
    };
    let ks = color(given.ks, &textures.map_ks, 0.0);
    let shiny = ks.iter().any(|&channel| channel > 0.0);
    Material {
        ka: color(given.ka, &textures.map_ka, 0.0),
        kd: color(given.kd, &textures.map_kd, 0.8),
        ks,
        ke: color(given.ke, &textures.map_ke, 0.0),
        ns: given.ns.unwrap_or(if shiny && textures.map_ns.is_none() { 10.0 } else { 1.0 }),
        d: given.d.or(given.tr.map(|tr| 1.0 - tr)).unwrap_or(1.0),
        halo: given.halo,
        tf: color(given.tf, &None, 1.0),
        ni: given.ni.unwrap_or(1.0),
        illum: given.illum.unwrap_or(if shiny { 2 } else { 1 }),
        textures,
        ..Material::default()
    }
}

fn textures(maps: Vec<FoundMap>) -> Textures {
    let mut textures = Textures::default();
    for FoundMap { slot, statement, texture, .. } in maps {
        let Some(texture) = texture else { continue };
        let map = Map {
            texture,
            scale: statement.scale,
            offset: statement.offset,
            clamp: statement.clamp,
            base_gain: statement.base_gain,
            bump_multiplier: statement.bump_multiplier.unwrap_or(1.0),
            channel: statement.channel,
        };
        let place = match slot {
            MapSlot::Ka => &mut textures.map_ka,
            MapSlot::Kd => &mut textures.map_kd,
            MapSlot::Ks => &mut textures.map_ks,
            MapSlot::Ke => &mut textures.map_ke,
            MapSlot::Ns => &mut textures.map_ns,
            MapSlot::D => &mut textures.map_d,
            MapSlot::Bump => &mut textures.bump,
            MapSlot::Norm => &mut textures.norm,
            MapSlot::Refl(Side::Sphere) => {
                textures.refl = Some(Reflection::Sphere(map));
                continue;
            }
            MapSlot::Refl(Side::Face(face)) => {
                let mut faces = match textures.refl.take() {
                    Some(Reflection::Cube(faces)) => faces,
                    _ => Box::default(),
                };
                faces[usize::from(face)] = Some(map);
                textures.refl = Some(Reflection::Cube(faces));
                continue;
            }
        };
        *place = Some(map);
    }
    textures
}

/// What is above 1 has no place on the curve and stays.
fn linear(x: f32) -> f32 {
    if x < 1.0 { linear_from_srgb(f64::from(x)) as f32 } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{TexelSpace, Texels};

    fn given(statements: &[(&str, &str)]) -> Given {
        let mut given = Given::default();
        for (word, value) in statements {
            given.set(word.as_bytes(), value.as_bytes()).unwrap();
        }
        given
    }

    /// The material and what was said of it; every map is found, and a white texel.
    fn of(mtl: &[(&str, &str)], job: &[(&str, &str)]) -> (Material, Vec<String>) {
        let (mut given, mut changes) = (given(mtl), given(job));
        let white = Part::new(Texture {
            size: [1, 1],
            space: TexelSpace::Linear,
            alpha_varies: false,
            texels: Texels::U8(vec![[255; 4]]),
        });
        let statements = [std::mem::take(&mut given.maps), std::mem::take(&mut changes.maps)].concat();
        let found = |(slot, statement)| FoundMap {
            slot,
            statement,
            said_in: PathBuf::new(),
            path: None,
            texture: Some(white.clone()),
        };
        let maps = statements.into_iter().map(found);
        let mut said = Vec::new();
        let material =
            material(given, changes, maps.collect(), false, &mut |text| said.push(text.to_owned()));
        (material, said)
    }

    #[test]
    fn defaults_of_what_is_absent() {
        assert_eq!(of(&[], &[]), (Material::default(), Vec::new()));
        let (shiny, _) = of(&[("Ks", "0 0.5 0")], &[]);
        assert_eq!((shiny.ns, shiny.illum, shiny.kd), (10.0, 2, [0.8; 3]));
        let d = |d: &str, tr: &str| of(&[("d", d), ("Tr", tr)], &[]).0.d;
        assert_eq!((d("0.75", "0.5"), of(&[("Tr", "0.75")], &[]).0.d), (0.75, 0.25));
        assert_eq!(of(&[("d", "0.75"), ("Tr", "0.5")], &[]).1, ["d and Tr disagree; d is used"]);
    }

    #[test]
    fn what_has_a_map_is_one_where_it_is_absent() {
        let maps = ["map_Ka", "map_Kd", "map_Ks", "map_Ke", "map_Ns", "map_d"].map(|word| (word, "a.png"));
        let (m, said) = of(&maps, &[]);
        assert_eq!((m.ka, m.kd, m.ks, m.ke, m.ns, m.d), ([1.0; 3], [1.0; 3], [1.0; 3], [1.0; 3], 1.0, 1.0));
        assert_eq!((m.illum, said.len()), (2, 0));
        let (black, said) =
            of(&[("Kd", "0 0 0"), ("Ks", "0 0 0"), ("map_Kd", "a.png"), ("map_Ks", "a.png")], &[]);
        assert_eq!((black.kd, black.ks, said.len()), ([1.0; 3], [0.0; 3], 1));
        assert_eq!(of(&[("Kd", "0 0 0")], &[]).0.kd, [0.0; 3]);
    }

    #[test]
    fn a_filter_of_one_counts_only_where_the_job_gives_it() {
        let tf = |mtl: &[(&str, &str)], job: &[(&str, &str)]| {
            let (m, _) = of(mtl, job);
            (m.tf, m.tf_given)
        };
        assert_eq!(tf(&[], &[]), ([1.0; 3], false));
        assert_eq!(tf(&[("Tf", "1 1 1")], &[]), ([1.0; 3], false));
        assert_eq!(tf(&[("Kt", "0.5")], &[]), ([0.5; 3], true));
        assert_eq!(tf(&[("Tf", "0.5")], &[("Tf", "1 1 1")]), ([1.0; 3], true));
    }

    #[test]
    fn density_below_zero_counts_as_one() {
        assert_eq!(of(&[("Ni", "0.00")], &[]).1, ["Ni of 0 or less counts as 1"]);
        assert_eq!([("Ni", "0"), ("Ni", "-2"), ("Ni", "1.5")].map(|ni| of(&[ni], &[]).0.ni), [1.0, 1.0, 1.5]);
    }

    #[test]
    fn faces_make_a_cube() {
        let (m, _) = of(&[("refl", "-type cube_right a.png"), ("refl", "-type cube_front -s 2 b.png")], &[]);
        let Some(Reflection::Cube(faces)) = m.textures.refl else { panic!("no cube") };
        assert_eq!(faces.each_ref().map(Option::is_some), [false, true, false, false, false, true]);
        assert_eq!(faces[5].as_ref().unwrap().scale, [2.0, 1.0]);
    }

    #[test]
    fn srgb_is_undone_for_colours_given() {
        // 0.5 in sRGB is 0.21404 in linear light; 17 is brighter than the curve goes
        let given = Given { kd: Some([0.5, 0.0, 1.0]), ke: Some([17.0; 3]), ..Given::default() };
        let material = filled_in(&given, Textures::default(), true);
        assert!((material.kd[0] - 0.214_041_14).abs() < 1e-6);
        assert_eq!((material.kd[1], material.kd[2], material.ke), (0.0, 1.0, [17.0; 3]));
        assert_eq!(
            filled_in(&Given::default(), Textures::default(), true).kd,
            [0.8; 3],
            "a default is linear"
        );
    }
}

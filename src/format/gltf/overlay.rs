//! What a job says of materials by name, laid over those of a glTF. Maps are not: they stay the file's.

use crate::format::MaterialOverride;
use crate::format::error::FormatError;
use crate::format::mtl::Given;
use crate::format::text::shown;
use crate::scene::Material;
use std::collections::HashMap;

/// The statements for each name; later ones win.
pub(super) fn overlays(changes: &[MaterialOverride]) -> Result<HashMap<Vec<u8>, Given>, FormatError> {
    let mut overlays: HashMap<Vec<u8>, Given> = HashMap::new();
    for change in changes {
        let given = overlays.entry(change.name.clone()).or_default();
        for (word, value) in &change.words {
            given.set(word.as_bytes(), value.as_bytes()).map_err(|_| FormatError::BadOverride {
                name: shown(&change.name),
                word: word.clone(),
                value: value.clone(),
            })?;
        }
    }
    Ok(overlays)
}

/// The material with what is given instead of its own.
pub(super) fn laid_over(own: Material, given: &Given) -> Material {
    let d = given.d.or(given.tr.map(|tr| 1.0 - tr));
    Material {
        ka: given.ka.unwrap_or(own.ka),
        kd: given.kd.unwrap_or(own.kd),
        ks: given.ks.unwrap_or(own.ks),
        ke: given.ke.unwrap_or(own.ke),
        tf: given.tf.unwrap_or(own.tf),
        tf_given: own.tf_given || given.tf.is_some(),
        ns: given.ns.unwrap_or(own.ns),
        // as in an MTL
        ni: given.ni.map_or(own.ni, |ni| if ni > 0.0 { ni } else { 1.0 }),
        d: d.unwrap_or(own.d),
        halo: if d.is_some() { given.halo } else { own.halo },
        illum: given.illum.unwrap_or(own.illum),
        textures: own.textures,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    fn change(name: &str, word: &str, value: &str) -> MaterialOverride {
        MaterialOverride {
            name: name.as_bytes().to_vec(),
            words: vec![(word.to_owned(), value.to_owned())],
            said_in: PathBuf::new(),
        }
    }

    #[test]
    fn what_is_given_wins() {
        let all =
            overlays(&[change("a", "Ni", "2"), change("b", "Kd", "1"), change("a", "Tr", "0.25")]).unwrap();
        let made = laid_over(Material { ns: 7.0, ..Material::default() }, &all[&b"a"[..]]);
        assert_eq!((made.ni, made.d, made.ns, made.kd), (2.0, 0.75, 7.0, [0.8; 3]));
        assert!(matches!(overlays(&[change("a", "Ni", "x")]), Err(FormatError::BadOverride { .. })));
    }
}

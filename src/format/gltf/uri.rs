//! URIs of buffers and images: data within the JSON, or files beside it.

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

/// Padding need not be there: some exporters leave it out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// What a URI leads to.
#[derive(Debug, PartialEq)]
pub(super) enum Target {
    /// These bytes.
    Data(Vec<u8>),
    /// A file of that name, relative to the glTF.
    File(String),
}

/// Reads a URI; an error is what is wrong with it.
pub(super) fn target(uri: &str) -> Result<Target, String> {
    if let Some(rest) = uri.strip_prefix("data:") {
        let (kind, data) = rest.split_once(',').ok_or("a data URI has no data")?;
        if !kind.ends_with(";base64") {
            return Ok(Target::Data(unescaped(data)));
        }
        let bytes = BASE64.decode(data).map_err(|error| format!("a data URI is no base64: {error}"))?;
        return Ok(Target::Data(bytes));
    }
    let scheme = uri.split_once(':').map(|(scheme, _)| scheme);
    // one letter is a drive
    if let Some(scheme) = scheme.filter(|s| s.len() > 1 && s.bytes().all(|b| b.is_ascii_alphanumeric())) {
        return Err(format!("`{scheme}:` is not read; put the file beside the glTF"));
    }
    let name = String::from_utf8(unescaped(uri)).map_err(|_| "a file name is not UTF-8".to_owned())?;
    if name.is_empty() { Err("a uri is empty".to_owned()) } else { Ok(Target::File(name)) }
}

/// Turns `%20` and the like into bytes; what is no escape stands.
fn unescaped(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let digit = |at: usize| bytes.get(at).and_then(|&b| char::from(b).to_digit(16));
    let mut plain = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        match (bytes[at], digit(at + 1), digit(at + 2)) {
            (b'%', Some(high), Some(low)) => {
                plain.push((16 * high + low) as u8);
                at += 3;
            }
            (byte, _, _) => {
                plain.push(byte);
                at += 1;
            }
        }
    }
    plain
}

/// Any bytes as they stand in a data URI.
#[cfg(test)]
pub(super) fn escaped(bytes: &[u8]) -> String {
    bytes
        .iter()
        .flat_map(|byte| [b'%', byte >> 4, byte & 15])
        .map(|digit| match digit {
            b'%' => '%',
            digit => char::from_digit(digit.into(), 16).unwrap(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_and_files() {
        let data = |uri| match target(uri) {
            Ok(Target::Data(bytes)) => bytes,
            other => panic!("{other:?}"),
        };
        assert_eq!(data("data:application/octet-stream;base64,AQID/w=="), [1, 2, 3, 255]);
        assert_eq!(data("data:;base64,AQID/w"), [1, 2, 3, 255]);
        assert_eq!(data("data:,a%20b%"), b"a b%");
        let file = |uri| target(uri).unwrap();
        assert_eq!(file("a%20b/c%C3%A9.bin"), Target::File("a b/cé.bin".to_owned()));
        assert_eq!(file("100%.png"), Target::File("100%.png".to_owned()));
        for bad in ["", "data:;base64", "data:;base64,!", "http://x/y.bin", "%ff"] {
            assert!(target(bad).is_err(), "{bad}");
        }
    }
}

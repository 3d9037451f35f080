//! Bytes: files, URIs and the chunks of a `.glb`.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use crate::{Error, Result};

/// The largest file that is read: a `.glb` cannot be larger.
const MAX_FILE: u64 = u32::MAX as u64;

/// Exporters disagree on padding; both forms are unambiguous.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// A result whose error is a message, to which the caller adds the file.
pub(super) type OrMessage<T> = std::result::Result<T, String>;

/// The JSON text of a file, and the binary chunk if it is a `.glb` that has one.
pub(super) struct Container<'a> {
    pub json: &'a [u8],
    pub binary: Option<&'a [u8]>,
}

/// Reads a whole file; a device or a pipe, which might never end, is an error.
pub(super) fn read_regular_file(path: &Path) -> Result<Vec<u8>> {
    let io = |cause| Error::Io { path: path.to_owned(), cause };
    let refuse = |message: &str| io(std::io::Error::other(message.to_owned()));
    let meta = std::fs::metadata(path).map_err(io)?;
    if !meta.is_file() {
        return Err(refuse("not a regular file: give the file itself"));
    }
    if meta.len() > MAX_FILE {
        return Err(refuse("larger than 4 GiB: split it"));
    }
    let mut bytes = Vec::new();
    File::open(path).map_err(io)?.take(MAX_FILE).read_to_end(&mut bytes).map_err(io)?;
    Ok(bytes)
}

/// Splits a `.glb` into its chunks; anything else is taken for JSON text.
pub(super) fn split(bytes: &[u8]) -> OrMessage<Container<'_>> {
    if !bytes.starts_with(b"glTF") {
        let json = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes); // a byte order mark is common, if not allowed
        return Ok(Container { json, binary: None });
    }
    let (version, length) = match (word(bytes, 4), word(bytes, 8)) {
        (Some(version), Some(length)) => (version, length as usize),
        _ => return Err("the .glb header is truncated: export or copy the file again".to_owned()),
    };
    if version != 2 {
        return Err(format!("the .glb container has version {version}: only version 2 is known"));
    }
    let body = bytes.get(12..length).ok_or_else(|| {
        format!("the .glb header announces {length} bytes, but there are {}: copy the file again", bytes.len())
    })?;
    let (kind, json, rest) = chunk(body)?;
    if kind != *b"JSON" {
        return Err("the first chunk of the .glb is not JSON: export the file again".to_owned());
    }
    let binary = if rest.len() < 8 { None } else { Some(chunk(rest)?) };
    Ok(Container { json, binary: binary.filter(|(kind, ..)| kind == b"BIN\0").map(|(_, data, _)| data) })
}

type Chunk<'a> = ([u8; 4], &'a [u8], &'a [u8]);

/// The kind and data of the first chunk, and what follows it.
fn chunk(bytes: &[u8]) -> OrMessage<Chunk<'_>> {
    let truncated = || "a chunk of the .glb is truncated: export or copy the file again".to_owned();
    let length = word(bytes, 0).ok_or_else(truncated)? as usize;
    let kind = word(bytes, 4).ok_or_else(truncated)?.to_le_bytes();
    let (data, rest) = bytes[8..].split_at_checked(length).ok_or_else(truncated)?;
    Ok((kind, data, rest))
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?))
}

/// The bytes that a URI in the file stands for: a data URI, or a path relative to `folder`.
pub(super) fn resolve(uri: &str, folder: &Path) -> OrMessage<Vec<u8>> {
    if let Some(data) = strip_scheme(uri, "data:") {
        return decode_data_uri(data);
    }
    if let Some(scheme) = scheme(uri) {
        return Err(format!("'{}' is not a relative path ({scheme} is not fetched): put the file beside", short(uri)));
    }
    if uri.starts_with(['/', '\\']) {
        return Err(format!("'{}' is an absolute path, which glTF does not allow: make it relative", short(uri)));
    }
    read_regular_file(&relative_path(uri, folder)).map_err(|error| match error {
        Error::Io { cause, .. } => format!("cannot read '{}' ({cause}): put the file beside", short(uri)),
        other => other.to_string(),
    })
}

/// Where a relative URI points to. It should be percent-encoded, but files that have a bare `%` in their name exist.
fn relative_path(uri: &str, folder: &Path) -> PathBuf {
    let raw = folder.join(uri);
    match urlencoding::decode(uri) {
        Ok(decoded) if *decoded != *uri && !decoded.starts_with(['/', '\\']) => {
            let decoded = folder.join(&*decoded);
            if decoded.is_file() || !raw.is_file() { decoded } else { raw }
        }
        _ => raw,
    }
}

fn decode_data_uri(data: &str) -> OrMessage<Vec<u8>> {
    let Some((header, payload)) = data.split_once(',') else {
        return Err("a data URI without a comma: export the file again".to_owned());
    };
    if !header.ends_with(";base64") {
        return Ok(urlencoding::decode_binary(payload.as_bytes()).into_owned());
    }
    BASE64.decode(payload.trim_ascii()).map_err(|error| format!("a data URI is not base64 ({error}): export it again"))
}

fn strip_scheme<'a>(uri: &'a str, scheme: &str) -> Option<&'a str> {
    let head = uri.get(..scheme.len())?;
    head.eq_ignore_ascii_case(scheme).then(|| &uri[scheme.len()..])
}

/// The scheme of an absolute URI (RFC 3986, section 3.1). `C:\` is one, too.
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let letter = scheme.starts_with(|c: char| c.is_ascii_alphabetic());
    (letter && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))).then_some(scheme)
}

/// A URI for a message: long ones are cut.
fn short(uri: &str) -> String {
    if uri.chars().count() <= 80 { uri.to_owned() } else { uri.chars().take(77).chain("...".chars()).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_data_uri_is_decoded() {
        let here = Path::new(".");
        assert_eq!(resolve("data:application/octet-stream;base64,AQID", here).unwrap(), [1, 2, 3]);
        assert_eq!(resolve("DATA:;base64,AQI=", here).unwrap(), [1, 2]);
        assert_eq!(resolve("data:;base64,AQI", here).unwrap(), [1, 2], "padding may be missing");
        assert_eq!(resolve("data:,a%20b", here).unwrap(), b"a b");
        assert!(resolve("data:;base64,AQ*D", here).unwrap_err().contains("base64"));
        assert!(resolve("data:;base64", here).unwrap_err().contains("comma"));
    }

    #[test]
    fn absolute_uris_are_refused() {
        for uri in ["http://a.b/c.bin", "https://a", "file:///etc/hosts", "C:\\a.bin", "/etc/hosts", "\\\\host\\a"] {
            let message = resolve(uri, Path::new(".")).unwrap_err();
            assert!(message.contains("relative"), "{uri}: {message}");
        }
        assert_eq!(scheme("a b:c"), None, "a space ends no scheme");
    }

    #[test]
    fn names_are_percent_decoded_where_that_exists() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["a b.bin", "100%.bin", "ü.bin", "50%25.bin"] {
            std::fs::write(folder.path().join(name), name).unwrap();
        }
        let uris = [("a%20b.bin", "a b.bin"), ("a b.bin", "a b.bin"), ("100%.bin", "100%.bin")];
        for (uri, name) in
            uris.into_iter().chain([("%C3%BC.bin", "ü.bin"), ("ü.bin", "ü.bin"), ("50%25.bin", "50%25.bin")])
        {
            assert_eq!(resolve(uri, folder.path()).unwrap(), name.as_bytes(), "{uri}");
        }
        assert!(resolve("none.bin", folder.path()).unwrap_err().contains("'none.bin'"));
        assert!(resolve(".", folder.path()).unwrap_err().contains("regular file"));
        assert!(resolve("a\0b", folder.path()).is_err());
    }

    #[test]
    fn a_glb_is_split_and_truncation_is_noticed() {
        let mut glb = b"glTF\x02\0\0\0".to_vec();
        glb.extend(36u32.to_le_bytes());
        glb.extend([4, 0, 0, 0]);
        glb.extend(b"JSON{}  ");
        glb.extend([4, 0, 0, 0]);
        glb.extend(b"BIN\0abcd");
        let whole = split(&glb).unwrap();
        assert_eq!((whole.json, whole.binary), (&b"{}  "[..], Some(&b"abcd"[..])));
        for length in 4..glb.len() {
            assert!(split(&glb[..length]).is_err(), "{length} bytes");
        }
        glb[8] = 11; // an announced length shorter than the header itself
        assert!(split(&glb).is_err());
    }
}

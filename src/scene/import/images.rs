//! PNG and JPEG images of the file, decoded to 8-bit RGBA.

use std::io::Cursor;

use gltf::json;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use rayon::prelude::*;

use super::container::OrMessage;
use super::document::{Document, label, name_or};
use crate::scene::Image;
use crate::{Error, Result};

/// The most texels across or down: what any Vulkan device of today takes.
const MAX_SIZE: u32 = 16384;
/// The most texels of all images together: a few kilobytes of PNG can claim a gigabyte of them.
const MAX_TEXELS: u64 = 1 << 28;

/// Decodes the given images of the file, in parallel. Returns them in order; what was approximated is appended to
/// `notices`.
pub(super) fn decode(document: &Document, indices: &[usize], notices: &mut Vec<String>) -> Result<Vec<Image>> {
    let mut encoded = Vec::with_capacity(indices.len());
    let mut texels = 0u64;
    for &index in indices {
        let image = Encoded::read(document, index)?;
        texels += u64::from(image.width) * u64::from(image.height);
        if texels > MAX_TEXELS {
            return Err(document.bad(format!("more than {MAX_TEXELS} texels in all images: scale them down")));
        }
        encoded.push(image);
    }
    // Collected before looking for errors, so that the first one is reported whatever the threads do.
    let decoded: Vec<OrMessage<(Image, bool)>> = encoded.par_iter().map(Encoded::decode).collect();
    let mut images = Vec::with_capacity(decoded.len());
    for (result, encoded) in decoded.into_iter().zip(&encoded) {
        let (image, reduced) = result.map_err(|message| document.bad(message))?;
        if reduced {
            notices.push(format!("{} is reduced from 16 to 8 bits a channel", encoded.place));
        }
        images.push(image);
    }
    Ok(images)
}

struct Encoded {
    place: String,
    name: String,
    format: ImageFormat,
    bytes: Vec<u8>,
    width: u32,
    height: u32,
}

impl Encoded {
    fn read(document: &Document, index: usize) -> Result<Self> {
        let missing = || document.bad(format!("image {index} does not exist: export the file again"));
        let image = document.root.images.get(index).ok_or_else(missing)?;
        let own_name = image.name.as_deref().or(image.uri.as_deref().filter(|uri| !uri.starts_with("data:")));
        let place = label("image", index, own_name);
        let bytes = source(document, image, &place)?;
        let Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) = image::guess_format(&bytes) else {
            return Err(unknown_format(document, image, &bytes, place));
        };
        let mut encoded = Self { place, name: name_or("image", index, own_name), format, bytes, width: 0, height: 0 };
        let (width, height) = encoded.decoder().map_err(|message| document.bad(message))?.dimensions();
        if width == 0 || height == 0 || width > MAX_SIZE || height > MAX_SIZE {
            let place = &encoded.place;
            return Err(document.bad(format!(
                "{place} has {width} x {height} texels; between 1 and {MAX_SIZE} a side are read: scale it"
            )));
        }
        (encoded.width, encoded.height) = (width, height);
        Ok(encoded)
    }

    fn decoder(&self) -> OrMessage<impl ImageDecoder + '_> {
        let mut reader = ImageReader::with_format(Cursor::new(&self.bytes[..]), self.format);
        let mut limits = Limits::default();
        limits.max_alloc = Some(8 * MAX_TEXELS); // 16-bit RGBA
        reader.limits(limits);
        reader.into_decoder().map_err(|error| self.broken(&error))
    }

    /// The image, and whether it had more than 8 bits.
    fn decode(&self) -> OrMessage<(Image, bool)> {
        let decoded = DynamicImage::from_decoder(self.decoder()?).map_err(|error| self.broken(&error))?;
        let deep = !matches!(decoded.color(), ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8);
        let rgba = decoded.into_rgba8();
        let (width, height) = rgba.dimensions();
        let texels = rgba.as_raw().as_chunks::<4>().0.to_vec();
        Ok((Image { name: self.name.clone(), width, height, texels }, deep))
    }

    fn broken(&self, error: &image::ImageError) -> String {
        format!("{} cannot be decoded ({error}): save it again", self.place)
    }
}

fn source(document: &Document, image: &json::Image, place: &str) -> Result<Vec<u8>> {
    match (&image.uri, image.buffer_view) {
        (Some(uri), _) => document.resolve(uri, place),
        (None, Some(view)) => Ok(document.view(view.value(), place)?.0.to_vec()),
        (None, None) => Err(document.bad(format!("{place} has neither a URI nor a buffer view: export it again"))),
    }
}

fn unknown_format(document: &Document, image: &json::Image, bytes: &[u8], place: String) -> Error {
    let mime = image.mime_type.as_ref().map_or("", |mime| mime.0.as_str());
    let format = match bytes {
        [0xab, b'K', b'T', b'X', ..] => "KTX2",
        [b'R', b'I', b'F', b'F', ..] => "WebP",
        [b'D', b'D', b'S', b' ', ..] => "DDS",
        _ if mime != "image/png" && mime != "image/jpeg" && !mime.is_empty() => mime,
        _ => return document.bad(format!("{place} is neither PNG nor JPEG, or is damaged: save it again")),
    };
    document.unsupported(place, format, "convert it to PNG or JPEG")
}

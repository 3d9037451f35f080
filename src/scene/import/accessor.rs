//! Typed arrays out of buffers: every range is checked before anything is read or allocated.

use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::validation::Checked;

use super::document::Document;
use crate::Result;

/// The most elements of an accessor that has no buffer view (all zeros but for its sparse ones): nothing in the file
/// bounds it.
const MAX_ZEROS: u64 = 1 << 22;

/// Which encodings an array may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// 32-bit floats only.
    Float,
    /// Floats, or 8- and 16-bit integers that stand for 0..1 or -1..1.
    Normalized,
    /// Floats, or any 8- and 16-bit integers (`KHR_mesh_quantization`).
    Quantized,
}

/// A checked view of the elements of an accessor.
struct Elements<'a> {
    data: Option<Strided<'a>>,
    count: usize,
    component: ComponentType,
    components: usize,
    normalized: bool,
    sparse: Option<Sparse<'a>>,
}

/// `count` elements at multiples of `stride`; the last one ends within `bytes`.
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
}

/// Elements that replace some others.
struct Sparse<'a> {
    count: usize,
    indices: Strided<'a>,
    index_component: ComponentType,
    values: Strided<'a>,
}

impl<'a> Strided<'a> {
    fn element(&self, index: usize) -> &'a [u8] {
        &self.bytes[index * self.stride..][..self.size]
    }
}

/// The number of elements that an accessor claims to have. Reading it checks that they are there.
pub(super) fn count(document: &Document, index: usize, place: &str) -> Result<u64> {
    Ok(accessor(document, index, place)?.count.0)
}

/// Reads scalars, vectors or 4×4 matrices of `N` components as floats, all finite. `place` names the array in messages.
pub(super) fn read_floats<const N: usize>(
    document: &Document,
    index: usize,
    encoding: Encoding,
    place: &str,
) -> Result<Vec<[f32; N]>> {
    let elements = open(document, index, place)?;
    let wanted = match (elements.component, encoding) {
        (ComponentType::F32, _) => true,
        (ComponentType::U32, _) | (_, Encoding::Float) => false,
        (_, Encoding::Normalized) => elements.normalized,
        (_, Encoding::Quantized) => true,
    };
    if elements.components != N || !wanted {
        let (kind, normal) = (elements.component, if elements.normalized { " normalised" } else { "" });
        return Err(document.bad(format!(
            "{place} (accessor {index}) has {} components of{normal} {kind:?}, which glTF does not allow there: export it again",
            elements.components
        )));
    }
    let mut out = vec![[0.0; N]; elements.count];
    if let Some(data) = &elements.data {
        for (i, out) in out.iter_mut().enumerate() {
            decode(data.element(i), elements.component, elements.normalized, out);
        }
    }
    if let Some(sparse) = &elements.sparse {
        for i in 0..sparse.count {
            let at = sparse_index(document, sparse, i, elements.count, place)?;
            decode(sparse.values.element(i), elements.component, elements.normalized, &mut out[at]);
        }
    }
    if let Some(at) = out.iter().position(|element| !element.iter().all(|x| x.is_finite())) {
        return Err(document.bad(format!("{place} (accessor {index}), element {at}, is not finite: repair the model")));
    }
    Ok(out)
}

/// Reads unsigned scalars. `place` names the array in messages.
pub(super) fn read_indices(document: &Document, index: usize, place: &str) -> Result<Vec<u32>> {
    let indices = read_unsigned::<1>(document, index, place, "unsigned scalars", true)?;
    Ok(indices.into_iter().map(|[index]| index).collect())
}

/// Reads vectors of four 8- or 16-bit integers, which name joints. `place` names the array in messages.
pub(super) fn read_joints(document: &Document, index: usize, place: &str) -> Result<Vec<[u16; 4]>> {
    let joints = read_unsigned::<4>(document, index, place, "vectors of four 8- or 16-bit integers", false)?;
    Ok(joints.into_iter().map(|joints| joints.map(|joint| joint as u16)).collect())
}

fn read_unsigned<const N: usize>(
    document: &Document,
    index: usize,
    place: &str,
    wanted: &str,
    wide: bool,
) -> Result<Vec<[u32; N]>> {
    let elements = open(document, index, place)?;
    let component = elements.component;
    let unsigned =
        matches!(component, ComponentType::U8 | ComponentType::U16) || wide && component == ComponentType::U32;
    if elements.components != N || !unsigned || elements.normalized {
        return Err(document.bad(format!("{place} (accessor {index}) are not {wanted}: export it again")));
    }
    let mut out = vec![[0; N]; elements.count];
    if let Some(data) = &elements.data {
        for (i, out) in out.iter_mut().enumerate() {
            *out = decode_integers(data.element(i), component);
        }
    }
    if let Some(sparse) = &elements.sparse {
        for i in 0..sparse.count {
            let at = sparse_index(document, sparse, i, elements.count, place)?;
            out[at] = decode_integers(sparse.values.element(i), component);
        }
    }
    Ok(out)
}

fn decode_integers<const N: usize>(bytes: &[u8], component: ComponentType) -> [u32; N] {
    let size = component.size();
    std::array::from_fn(|i| decode_index(&bytes[i * size..][..size], component))
}

fn accessor<'a>(document: &'a Document, index: usize, place: &str) -> Result<&'a Accessor> {
    let missing = || document.bad(format!("{place} is accessor {index}, which does not exist: export it again"));
    document.root.accessors.get(index).ok_or_else(missing)
}

fn open<'a>(document: &'a Document, index: usize, place: &str) -> Result<Elements<'a>> {
    let place = &format!("{place} (accessor {index})");
    let accessor = accessor(document, index, place)?;
    let (Checked::Valid(component), Checked::Valid(kind)) = (accessor.component_type, accessor.type_) else {
        return Err(document.bad(format!("{place} has an unknown type: export it again")));
    };
    let (component, components) = (component.0, components(kind));
    let size = component.size() * components;
    let offset = accessor.byte_offset.unwrap_or_default().0;
    let data = match accessor.buffer_view {
        Some(view) => Some(strided(document, view.value(), offset, accessor.count.0, size, place)?),
        None if accessor.sparse.is_none() => {
            return Err(document.bad(format!("{place} has no data (is it compressed?): export it uncompressed")));
        }
        None if accessor.count.0 > MAX_ZEROS => {
            return Err(document.bad(format!("{place} has {} zeros: at most {MAX_ZEROS} are read", accessor.count.0)));
        }
        None => None,
    };
    let sparse = match &accessor.sparse {
        None => None,
        Some(sparse) => {
            let Checked::Valid(index_component) = sparse.indices.component_type else {
                return Err(document.bad(format!("{place} has sparse indices of an unknown type: export it again")));
            };
            let (count, index_component) = (sparse.count.0, index_component.0);
            let (indices, values) = (&sparse.indices, &sparse.values);
            let index_size = index_component.size();
            Some(Sparse {
                count: count as usize, // fits: `strided` finds as many bytes
                indices: strided(
                    document,
                    indices.buffer_view.value(),
                    indices.byte_offset.0,
                    count,
                    index_size,
                    place,
                )?,
                index_component,
                values: strided(document, values.buffer_view.value(), values.byte_offset.0, count, size, place)?,
            })
        }
    };
    let count = accessor.count.0 as usize; // fits: see above
    Ok(Elements { data, count, component, components, normalized: accessor.normalized, sparse })
}

/// Small matrices, whose columns are padded, hold nothing that is read; as 0 components they fit nothing.
fn components(kind: Type) -> usize {
    match kind {
        Type::Scalar => 1,
        Type::Vec2 => 2,
        Type::Vec3 => 3,
        Type::Vec4 => 4,
        Type::Mat4 => 16,
        Type::Mat2 | Type::Mat3 => 0,
    }
}

/// `count` elements of `size` bytes from `offset` of a buffer view, or an error if they are not all within it.
fn strided<'a>(
    document: &'a Document,
    view: usize,
    offset: u64,
    count: u64,
    size: usize,
    place: &str,
) -> Result<Strided<'a>> {
    let (bytes, stride) = document.view(view, place)?;
    let stride = stride.filter(|&stride| stride != 0).unwrap_or(size);
    // A stride below the size would let a file claim more elements than it has bytes.
    if stride < size {
        return Err(document.bad(format!("{place} has elements of {size} bytes, {stride} apart: export it again")));
    }
    let last = count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride as u64)?.checked_add(size as u64));
    let end = last.and_then(|length| length.checked_add(offset));
    match end.and_then(|end| usize::try_from(end).ok()).filter(|&end| end <= bytes.len()) {
        Some(_) => Ok(Strided { bytes: bytes.get(offset as usize..).unwrap_or(&[]), stride, size }),
        None => Err(document.bad(format!(
            "{place} has {count} elements of {size} bytes, {stride} apart, from byte {offset} of buffer view {view}, \
             which has {} bytes: export it again",
            bytes.len()
        ))),
    }
}

fn sparse_index(document: &Document, sparse: &Sparse, i: usize, count: usize, place: &str) -> Result<usize> {
    let at = decode_index(sparse.indices.element(i), sparse.index_component) as usize;
    if at < count {
        return Ok(at);
    }
    Err(document.bad(format!("{place}: sparse index {at} is not below the count of {count}: export it again")))
}

/// Decodes as many components as `out` has. Integers are normalised by section 3.6.2.2 of the specification.
fn decode(bytes: &[u8], component: ComponentType, normalized: bool, out: &mut [f32]) {
    for (bytes, out) in bytes.chunks_exact(component.size()).zip(out) {
        let (value, largest) = match (component, bytes) {
            (ComponentType::I8, &[a]) => (f32::from(a as i8), 127.0),
            (ComponentType::U8, &[a]) => (f32::from(a), 255.0),
            (ComponentType::I16, &[a, b]) => (f32::from(i16::from_le_bytes([a, b])), 32767.0),
            (ComponentType::U16, &[a, b]) => (f32::from(u16::from_le_bytes([a, b])), 65535.0),
            (ComponentType::F32, &[a, b, c, d]) => (f32::from_le_bytes([a, b, c, d]), 1.0),
            _ => (0.0, 1.0), // 32-bit integers are refused before
        };
        let integer = component != ComponentType::F32;
        *out = if integer && normalized { (value / largest).max(-1.0) } else { value };
    }
}

fn decode_index(bytes: &[u8], component: ComponentType) -> u32 {
    match (component, bytes) {
        (ComponentType::U8, &[a]) => u32::from(a),
        (ComponentType::U16, &[a, b]) => u32::from(u16::from_le_bytes([a, b])),
        (_, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]),
        _ => u32::MAX, // signed ones are refused before
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_are_normalised_as_the_specification_says() {
        let mut out = [0.0; 2];
        decode(&[127, 128], ComponentType::I8, true, &mut out);
        assert_eq!(out, [1.0, -1.0], "-128 and -127 both stand for -1");
        decode(&[255, 51], ComponentType::U8, true, &mut out);
        assert_eq!(out, [1.0, 0.2]);
        decode(&[0xff, 0x7f, 0x01, 0x80], ComponentType::I16, true, &mut out);
        assert_eq!(out, [1.0, -1.0]);
        decode(&[0xff, 0xff, 0, 0], ComponentType::U16, true, &mut out);
        assert_eq!(out, [1.0, 0.0]);
        decode(&[0x01, 0x80, 2, 0], ComponentType::I16, false, &mut out);
        assert_eq!(out, [-32767.0, 2.0]);
    }
}

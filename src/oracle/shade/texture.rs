//! Twin of `glsl/include/texture.glsl`: texture sampling. Which texels are read is exact.

use crate::scene::atlas::{Atlas, srgb_table};
use crate::shaders::TextureSlot;
use glam::DVec4;

/// The flag of a slot that is read at its nearest texel.
const NEAREST: u32 = 16;

/// All images of a scene, as the shader sees them.
#[derive(Debug)]
pub struct Textures {
    atlas: Atlas,
    srgb: Vec<f32>,
    /// Set in the flags of every slot.
    forced: u32,
}

impl Textures {
    /// Images to sample from.
    pub fn new(atlas: Atlas) -> Self {
        Self { atlas, srgb: srgb_table(), forced: 0 }
    }

    /// The same, all read as those that ask for their nearest texel.
    pub fn nearest(atlas: Atlas) -> Self {
        Self { forced: NEAREST, ..Self::new(atlas) }
    }

    fn fetch(&self, slot: &TextureSlot, x: u32, y: u32, is_srgb: bool) -> DVec4 {
        let (left, top) = (slot.texel_origin & 0xffff, slot.texel_origin >> 16);
        let [r, g, b, a] = self.atlas.texel(slot.page, left + x, top + y);
        let decode = |c: u8| if is_srgb { f64::from(self.srgb[c as usize]) } else { f64::from(c) / 255.0 };
        DVec4::new(decode(r), decode(g), decode(b), f64::from(a) / 255.0)
    }

    /// The texture of `slot`, which has one, at the vertex's texture coordinates.
    pub fn sample(&self, slot: &TextureSlot, uv0: [f32; 2], uv1: [f32; 2], is_srgb: bool) -> DVec4 {
        let slot = &TextureSlot { flags: slot.flags | self.forced, ..*slot };
        let taps = taps(slot, if slot.flags & 32 != 0 { uv1 } else { uv0 });
        let [x, y] = taps.weight.map(f64::from);
        let texel = |i: usize, j: usize| self.fetch(slot, taps.columns[i], taps.rows[j], is_srgb);
        let top = texel(0, 0).lerp(texel(1, 0), x);
        let bottom = texel(0, 1).lerp(texel(1, 1), x);
        top.lerp(bottom, y)
    }
}

/// Which texels of an image are read, and how the second ones weigh (0 for nearest).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Taps {
    /// Columns in 0..width.
    pub columns: [u32; 2],
    /// Rows in 0..height.
    pub rows: [u32; 2],
    /// Weights of the second column and row, in [0, 1).
    pub weight: [f32; 2],
}

/// The texels that a slot reads at texture coordinates, before the slot's transform.
pub fn taps(slot: &TextureSlot, uv: [f32; 2]) -> Taps {
    let size = [slot.texel_size & 0xffff, slot.texel_size >> 16];
    let nearest = slot.flags & NEAREST != 0;
    let [a, b, c, d] = slot.transform;
    let at = [(a * uv[0] + b * uv[1]) + slot.offset[0], (c * uv[0] + d * uv[1]) + slot.offset[1]];
    let axis = |k: usize| {
        let at = guard_texel(at[k] * size[k] as f32 - if nearest { 0.0 } else { 0.5 });
        let mode = (slot.flags >> (2 * k)) & 3;
        let i = at.floor() as i32;
        let second = if nearest { i } else { i + 1 };
        let texels = [i, second].map(|i| wrap_texel(i, size[k], mode));
        (texels, if nearest { 0.0 } else { at - at.floor() })
    };
    let ((columns, x), (rows, y)) = (axis(0), axis(1));
    Taps { columns, rows, weight: [x, y] }
}

fn guard_texel(x: f32) -> f32 {
    if x.abs() < 1_073_741_824.0 { x } else { 0.0 }
}

/// The texel in `0..n` that coordinate `i` shows; `mode` is 0 for repeat, 1 for mirror and 2 for clamp.
pub fn wrap_texel(i: i32, n: u32, mode: u32) -> u32 {
    let n = n as i32;
    match mode {
        0 => i.rem_euclid(n) as u32,
        1 => i.rem_euclid(2 * n).min(2 * n - 1 - i.rem_euclid(2 * n)) as u32,
        _ => i.clamp(0, n - 1) as u32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Image;
    use proptest::prelude::*;

    /// glTF's definition, literally: the line of texels is laid out copy by copy and read off.
    fn laid_out(i: i32, n: u32, mode: u32) -> u32 {
        let forward: Vec<u32> = (0..n).collect();
        let backward: Vec<u32> = (0..n).rev().collect();
        let copy = (f64::from(i) / f64::from(n)).floor() as i64;
        let tile = if mode == 1 && copy % 2 != 0 { backward } else { forward };
        match mode {
            2 if i < 0 => 0,
            2 if i >= n as i32 => n - 1,
            _ => tile[(i64::from(i) - copy * i64::from(n)) as usize],
        }
    }

    #[test]
    fn wrap_modes_are_as_laid_out() {
        for mode in 0..3 {
            for n in [1, 2, 3, 7, 256, 32768] {
                for i in (-1000..1000).chain([-(1 << 30), (1 << 30) - 1, 123_456_789, -987_654_321]) {
                    assert_eq!(wrap_texel(i, n, mode), laid_out(i, n, mode), "{i} in {n}, mode {mode}");
                }
            }
        }
    }

    fn slot(width: u32, height: u32, flags: u32) -> TextureSlot {
        let transform = [1.0, 0.0, 0.0, 1.0];
        TextureSlot { transform, texel_size: width | height << 16, flags, ..Default::default() }
    }

    proptest! {
        // Exact arithmetic on the f32 product, against the f32 code.
        #[test]
        fn texels_are_exact_for_all_coordinates(u in -1e6f32..1e6, n in 1u32..5000, mode in 0u32..2) {
            let taps = taps(&slot(n, 1, mode | 16), [u, 0.0]);
            let texel = f64::from(u * n as f32).floor();
            prop_assume!(texel.abs() < 1_073_741_824.0);
            prop_assert_eq!(taps.columns[0], laid_out(texel as i32, n, mode));
        }

        #[test]
        fn nothing_is_read_outside_the_image(u in any::<f32>(), v in any::<f32>(), w in 1u32..99, h in 1u32..99, flags in 0u32..32) {
            prop_assume!(flags & 3 != 3 && (flags >> 2) & 3 != 3);
            let taps = taps(&slot(w, h, flags), [u, v]);
            prop_assert!(taps.columns.iter().all(|x| *x < w) && taps.rows.iter().all(|y| *y < h));
            prop_assert!(taps.weight.iter().all(|t| (0.0..=1.0).contains(t)));
        }
    }

    fn gradient() -> Textures {
        let texels = vec![[0, 0, 0, 255], [255, 0, 0, 255], [0, 255, 0, 0], [255, 255, 0, 0]];
        let image = Image { name: "gradient".to_owned(), width: 2, height: 2, texels };
        Textures::new(Atlas::pack(&[image], 16, 1).unwrap())
    }

    #[test]
    fn bilinear_meets_texels_in_their_middles() {
        let textures = gradient();
        let at = |u: f32, v: f32| textures.sample(&slot(2, 2, 0), [u, v], [0.0; 2], false);
        assert_eq!(at(0.25, 0.25), DVec4::new(0.0, 0.0, 0.0, 1.0));
        assert_eq!(at(0.75, 0.25), DVec4::new(1.0, 0.0, 0.0, 1.0));
        assert_eq!(at(0.5, 0.5), DVec4::new(0.5, 0.5, 0.0, 0.5));
        // Across the border: repeat blends with the other side, clamp does not.
        assert_eq!(at(0.0, 0.25).x, 0.5);
        assert_eq!(textures.sample(&slot(2, 2, 2 | 2 << 2), [0.0, 0.25], [0.0; 2], false).x, 0.0);
    }

    #[test]
    fn colours_are_decoded_before_they_are_filtered() {
        let textures = gradient();
        let half = textures.sample(&slot(2, 2, 0), [0.5, 0.25], [0.0; 2], true).x;
        assert_eq!(half, 0.5, "linear light, not the 0.21 of a decoded average");
        assert_eq!(textures.sample(&slot(2, 2, 0), [0.5, 0.5], [0.0; 2], true).w, 0.5, "alpha is linear");
    }

    #[test]
    fn the_second_set_and_the_transform_are_used() {
        let textures = gradient();
        let turned = TextureSlot { transform: [0.0, 1.0, 1.0, 0.0], offset: [0.5, 0.0], ..slot(2, 2, 16 | 32) };
        // u' = v + 0.5, v' = u of the second set.
        assert_eq!(textures.sample(&turned, [9.0, 9.0], [0.25, 0.25], false).x, 1.0);
    }
}

//! Points on triangles. Twin of `glsl/include/triangle.glsl`.

/// Corners of a triangle slot: the shader holds 36 bytes a triangle in two buffers, 8 floats in `corners` and the last
/// one in `rest`.
pub fn corners_of(corners: &[[f32; 4]], rest: &[f32], slot: usize) -> [[f32; 3]; 3] {
    let [ax, ay, az, bx] = corners[2 * slot];
    let [by, bz, cx, cy] = corners[2 * slot + 1];
    [[ax, ay, az], [bx, by, bz], [cx, cy, rest[slot]]]
}

/// The point with barycentric weights u of the second corner and v of the third, in f32 and in the shader's order:
/// agrees to the bit.
pub fn triangle_point([a, b, c]: [[f32; 3]; 3], u: f32, v: f32) -> [f32; 3] {
    [0, 1, 2].map(|i| a[i] + (u * (b[i] - a[i]) + v * (c[i] - a[i])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_and_middle() {
        let triangle = [[1.0, 2.0, 3.0], [4.0, 5.0, 7.0], [-2.0, 0.0, 1.0]];
        assert_eq!(triangle_point(triangle, 0.0, 0.0), triangle[0]);
        assert_eq!(triangle_point(triangle, 1.0, 0.0), triangle[1]);
        assert_eq!(triangle_point(triangle, 0.0, 1.0), triangle[2]);
        assert_eq!(triangle_point(triangle, 0.25, 0.25), [1.0, 2.25, 3.5]);
    }

    #[test]
    fn the_layout_is_a_bx_by_bz_cx_cy_then_cz() {
        let corners = [[9.0; 4], [9.0; 4], [0.0, 1.0, 2.0, 3.0], [4.0, 5.0, 6.0, 7.0]];
        assert_eq!(corners_of(&corners, &[9.0, 8.0], 1), [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]]);
    }
}

//! The shading model obeys physics and glTF: energy, reciprocity, the fits of its integrals, transforms of normals.

use glam::{DMat3, DVec3, Mat3, Vec2, Vec3, Vec4};
use std::f64::consts::{PI, TAU};
use stillray::oracle::shade::brdf::{Reflector, lobe_albedo};
use stillray::oracle::shade::material::{Spot, Surface, surface_at};
use stillray::oracle::shade::texture::Textures;
use stillray::scene::atlas::{Atlas, material_records};
use stillray::scene::{Image, Material, Scene, Texture, TextureRef, Wrap};
use stillray::shaders::{INSTANCE_FLIPPED, Instance, Vertex};

const WHITE: DVec3 = DVec3::ONE;

fn metal(roughness: f64) -> Reflector {
    Reflector { base_color: WHITE, metallic: 1.0, roughness, ..Reflector::default() }
}

fn plastic(roughness: f64) -> Reflector {
    Reflector { base_color: WHITE, metallic: 0.0, roughness, ..Reflector::default() }
}

fn at_cosine(c: f64) -> DVec3 {
    DVec3::new((1.0 - c * c).max(0.0).sqrt(), 0.0, c)
}

/// Points of an n x n grid over the unit square, in the middles of its cells.
fn grid(n: usize) -> impl Iterator<Item = (f64, f64)> {
    let at = move |i: usize| (i as f64 + 0.5) / n as f64;
    (0..n * n).map(move |i| (at(i % n), at(i / n)))
}

/// Integral of `f` over the directions above a plane with normal +z, of functions like the BRDF of roughness `r` seen from
/// `view`: half of the points follow the cosine, half the lobe, weighted by the balance heuristic.
fn hemisphere(view: DVec3, r: f64, f: impl Fn(DVec3) -> f64) -> f64 {
    let a2 = (r * r).max(1.0 / 1024.0).powi(2);
    let lobe_density = |l: DVec3| {
        let h = (view + l).normalize();
        let q = h.z * h.z * (a2 - 1.0) + 1.0;
        a2 / (PI * q * q) * h.z / (4.0 * view.dot(h).max(1e-9))
    };
    let weighted = |l: DVec3| if l.z > 0.0 { f(l) / (l.z / PI + lobe_density(l)) } else { 0.0 };
    let n = 160;
    let sum: f64 = grid(n)
        .map(|(u, v)| {
            let turn = |c2: f64| {
                let s = (1.0 - c2).max(0.0).sqrt();
                DVec3::new(s * (TAU * v).cos(), s * (TAU * v).sin(), c2.sqrt())
            };
            let h = turn((1.0 - u) / (1.0 + (a2 - 1.0) * u));
            weighted(turn(1.0 - u)) + weighted(2.0 * view.dot(h) * h - view)
        })
        .sum();
    sum / (n * n) as f64
}

/// What of uniform light the BRDF reflects to a view at this cosine.
fn albedo(reflector: Reflector, cosine: f64) -> f64 {
    let view = at_cosine(cosine);
    hemisphere(view, reflector.roughness, |l| reflector.reflect_light(DVec3::Z, view, l).x)
}

/// Error of the quadrature above, as seen against closed forms: alpha = 1 here, and 1 for a smooth white metal below.
const QUADRATURE: f64 = 3e-3;

#[test]
fn a_rough_white_metal_reflects_what_the_closed_form_says() {
    // With alpha = 1, D = 1 / pi and V = 1 / (2 (nl + nv)): the integral is 1 - nv ln((1 + nv) / nv).
    for c in [0.1, 0.3, 0.6, 1.0_f64] {
        let exact = 1.0 - c * ((1.0 + c) / c).ln();
        assert!((albedo(metal(1.0), c) - exact).abs() < QUADRATURE, "at {c}");
    }
    assert!((albedo(metal(0.9), 1.0) - (1.0 - 2f64.ln())).abs() > QUADRATURE, "the comparison can fail");
}

#[test]
fn no_energy_is_gained_and_the_loss_is_known() {
    for c in [0.05, 0.2, 0.5, 0.8, 1.0] {
        for r in [0.0, 0.2, 0.4, 0.6, 0.8, 1.0] {
            let e = albedo(metal(r), c);
            // Single scattering loses at most what it does for alpha = 1 at normal incidence, ln 2.
            assert!(e <= 1.0 + QUADRATURE && e >= 1.0 - 2f64.ln() - QUADRATURE, "metal {c} {r}: {e}");
            let e = albedo(plastic(r), c);
            assert!((e - 1.0).abs() < PLASTIC_ERROR + QUADRATURE, "plastic {c} {r}: {e}");
        }
    }
}

/// White plastic reflects all of the light, but for the fits of the lobe's albedo: that of f0 = 0.04 is off by up to
/// e = 0.016 + 0.04 * 0.018, once for the view, and for the lights once in 1 - mean, at least 0.9, with the mean's own 0.001.
const PLASTIC_ERROR: f64 = 0.0168 + (0.0168 + 0.001) / 0.9;

#[test]
fn the_fits_are_as_good_as_they_say() {
    let mut worst = 0.0_f64;
    for c in [0.03, 0.06, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 1.0] {
        for r in [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0] {
            // The albedo is affine in f0: with black and with white metal both parts are known.
            let whole = albedo(metal(r), c);
            let black = Reflector { base_color: DVec3::ZERO, ..metal(r) };
            let schlick = albedo(black, c);
            let [w, s] = lobe_albedo(c, r);
            worst = worst.max((w - whole).abs()).max((s - schlick).abs());
        }
    }
    assert!(worst < 0.018 + QUADRATURE, "{worst}");
    let [w, _] = lobe_albedo(0.5, 1.0);
    assert!((w - albedo(metal(0.7), 0.5)).abs() > 0.018 + QUADRATURE, "the comparison can fail");
}

#[test]
fn a_white_surface_in_a_furnace_is_invisible() {
    for c in [-1.0, -0.1, 0.0, 1e-6, 0.01, 0.3, 0.7, 1.0] {
        for r in [0.0, 0.03, 0.3, 0.77, 1.0] {
            for m in [0.0, 0.25, 1.0] {
                let white = Reflector { base_color: WHITE, metallic: m, roughness: r, ..Reflector::default() };
                let e = white.reflect_uniform(DVec3::Z, at_cosine(c));
                // A few roundings of numbers up to 1, whatever the fits are worth. Mixtures of metal and plastic are white
                // as well: the diffuse layer gets what is left, less what a metal absorbs.
                let expected = if m == 0.0 || m == 1.0 { 1.0 } else { e.x.min(1.0) };
                assert!((e - expected).abs().max_element() < 8.0 * f64::EPSILON, "{c} {r} {m}: {e}");
            }
        }
    }
    let grey = Reflector { base_color: WHITE * 0.5, metallic: 0.0, roughness: 0.5, ..Reflector::default() };
    assert!(grey.reflect_uniform(DVec3::Z, DVec3::Z).x < 0.6, "grey is seen");
}

#[test]
fn light_and_view_can_be_exchanged() {
    let colored =
        Reflector { base_color: DVec3::new(0.9, 0.4, 0.1), metallic: 0.3, roughness: 0.4, ..Reflector::default() };
    let mut asymmetry = 0.0_f64;
    for (u, v) in grid(40) {
        let a = DVec3::new(0.9 * u.sqrt() * (TAU * v).cos(), 0.9 * u.sqrt() * (TAU * v).sin(), 0.0);
        let a = a.with_z((1.0 - a.length_squared()).sqrt());
        let b = at_cosine(0.05 + 0.9 * (7.0 * u + 3.0 * v).fract());
        let there = colored.reflect_light(DVec3::Z, a, b) / b.z;
        let back = colored.reflect_light(DVec3::Z, b, a) / a.z;
        // Some ten operations in f64, each good to 2^-53.
        assert!(((there - back) / there).abs().max_element() < 32.0 * f64::EPSILON);
        asymmetry = asymmetry.max((there * b.z - back * a.z).abs().max_element());
    }
    assert!(asymmetry > 0.01, "with the cosine it is not symmetric: the comparison can fail");
}

#[test]
fn no_direction_and_no_material_gives_what_is_not_a_number() {
    let directions = [
        DVec3::Z,
        -DVec3::Z,
        DVec3::X,
        -DVec3::X,
        DVec3::ZERO,
        at_cosine(1e-7),
        at_cosine(-1e-7),
        at_cosine(1e-300),
        DVec3::new(-1.0, 0.0, 1e-12).normalize(),
    ];
    for roughness in [0.0, 1e-30, 0.5, 1.0] {
        for metallic in [0.0, 1.0] {
            for base_color in [DVec3::ZERO, DVec3::ONE] {
                let reflector = Reflector { base_color, metallic, roughness, ..Reflector::default() };
                for (v, l) in directions.iter().flat_map(|v| directions.iter().map(move |l| (*v, *l))) {
                    let f = reflector.reflect_light(DVec3::Z, v, l);
                    assert!(f.is_finite() && f.min_element() >= 0.0, "{reflector:?} {v} {l}: {f}");
                    // D <= 1 / (pi alpha^2) and V nl <= 1 / (2 alpha): with light cut off at 2^60 no f32 overflows.
                    assert!(f.max_element() <= 2f64.powi(30) / TAU + 1.0);
                    let e = reflector.reflect_uniform(DVec3::Z, v);
                    assert!(e.min_element() >= 0.0 && e.max_element() <= 1.0);
                }
            }
        }
    }
}

// --- From hits to surfaces ---

/// Octahedral code of an axis-aligned or diagonal direction, exact to the code's step.
fn code(v: Vec3) -> u32 {
    let p = v / (v.x.abs() + v.y.abs() + v.z.abs());
    let fold = |a: f32, b: f32| if p.z >= 0.0 { a } else { (1.0 - b.abs()) * a.signum() };
    let snorm = |x: f32| u32::from((x * 32767.0).round() as i16 as u16);
    snorm(fold(p.x, p.y)) | snorm(fold(p.y, p.x)) << 16
}

fn vertex(normal: Vec3, tangent: Vec4, uv: Vec2) -> Vertex {
    let t = code(tangent.truncate());
    let y = u32::from((((t >> 16) as u16 as i16) / 2) as u16 & 0x7fff);
    Vertex {
        normal: code(normal),
        tangent: (t & 0xffff) | y << 16 | u32::from(tangent.w < 0.0) << 31,
        uv0: uv.to_array(),
        uv1: [0.0; 2],
        color_rg: !0,
        color_ba: !0,
    }
}

fn instance(matrix: Mat3) -> Instance {
    let rows = |m: Mat3| [0, 1, 2].map(|i| m.row(i).extend(0.0).to_array());
    let flags = if matrix.determinant() < 0.0 { INSTANCE_FLIPPED } else { 0 };
    Instance { to_relative: rows(matrix), to_object: rows(inverse(matrix)), flags, ..Instance::default() }
}

/// In f64: the determinant of a small matrix is no f32.
fn inverse(matrix: Mat3) -> Mat3 {
    matrix.as_dmat3().inverse().as_mat3()
}

/// A scene of one material that has a one-texel normal map, if `normal` is given.
fn textured(material: Material, normal: Option<[u8; 4]>) -> (Scene, Textures) {
    let mut scene = Scene::default();
    let mut material = material;
    if let Some(texel) = normal {
        scene.images.push(Image { name: "normal".to_owned(), width: 1, height: 1, texels: vec![texel] });
        scene.textures.push(Texture { image: 0, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, nearest: false });
        let transform = glam::Affine2::IDENTITY;
        material.normal_texture = Some(TextureRef { texture: 0, uv_set: 0, transform });
    }
    scene.materials.push(material);
    let atlas = Atlas::pack(&scene.images, 16, 1).unwrap_or_else(|e| panic!("{e}"));
    (scene, Textures::new(atlas))
}

fn surface(matrix: Mat3, normal: Vec3, tangent: Vec4, view: DVec3, map: Option<[u8; 4]>) -> Surface {
    let (scene, textures) = textured(Material::default(), map);
    let atlas = Atlas::pack(&scene.images, 16, 1).unwrap_or_else(|e| panic!("{e}"));
    let material = material_records(&scene, &atlas)[0];
    let v = vertex(normal, tangent, Vec2::ZERO);
    let instance = instance(matrix);
    // The triangle lies in the object's xy plane.
    let geometric = (inverse(matrix).transpose() * Vec3::Z).as_dvec3().normalize();
    let spot = Spot { vertices: [&v; 3], u: 0.3, v: 0.3 };
    surface_at(&material, &instance, &spot, geometric, view, &textures)
}

const TANGENT: Vec4 = Vec4::new(1.0, 0.0, 0.0, 1.0);

fn close(a: DVec3, b: DVec3) -> bool {
    // The codes' error (1e-4 radians), doubled for the 15-bit axis that is truncated above.
    a.distance(b) < 2e-4
}

#[test]
fn normals_stay_perpendicular_under_unequal_scales() {
    let matrix = Mat3::from_diagonal(Vec3::new(1.0, 1.0, 4.0));
    let s = surface(matrix, Vec3::new(1.0, 0.0, 1.0).normalize(), TANGENT, DVec3::Z, None);
    assert!(close(s.normal, DVec3::new(1.0, 0.0, 0.25).normalize()));
    assert!(!close(s.normal, DVec3::new(1.0, 0.0, 4.0).normalize()), "not as a direction");
}

#[test]
fn the_far_side_is_shaded_with_both_normals_turned_around() {
    let s = surface(Mat3::IDENTITY, Vec3::Z, TANGENT, DVec3::new(0.3, 0.0, -1.0).normalize(), None);
    assert!(close(s.normal, -DVec3::Z) && close(s.geometric, -DVec3::Z));
}

#[test]
fn a_mirrored_instance_is_the_mirror_image() {
    // A bump towards +x and +y: mirrored in x it leans towards -x and +y.
    let map = Some([192, 160, 220, 255]);
    let plain = surface(Mat3::IDENTITY, Vec3::Z, TANGENT, DVec3::Z, map).normal;
    let mirrored = surface(Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)), Vec3::Z, TANGENT, DVec3::Z, map).normal;
    assert!(plain.x > 0.1 && plain.y > 0.1);
    assert!(close(mirrored, plain * DVec3::new(-1.0, 1.0, 1.0)));
    let turned = surface(Mat3::from_diagonal(Vec3::new(-1.0, -1.0, 1.0)), Vec3::Z, TANGENT, DVec3::Z, map).normal;
    assert!(close(turned, plain * DVec3::new(-1.0, -1.0, 1.0)), "two mirrors are a rotation");
    let handed = surface(Mat3::IDENTITY, Vec3::Z, Vec4::new(1.0, 0.0, 0.0, -1.0), DVec3::Z, map).normal;
    assert!(close(handed, plain * DVec3::new(1.0, -1.0, 1.0)), "handedness turns the bitangent");
}

#[test]
fn rotations_rotate_mapped_normals() {
    let map = Some([192, 160, 220, 255]);
    let plain = surface(Mat3::IDENTITY, Vec3::Z, TANGENT, DVec3::Z, map).normal;
    for scale in [1e-15, 1.0, 1e15] {
        let rotation = Mat3::from_rotation_y(0.7) * Mat3::from_rotation_x(-0.4);
        let back = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(-0.4);
        let s = surface(rotation * scale, Vec3::Z, TANGENT, back * DVec3::Z, map);
        assert!(close(s.normal, back * plain), "scale {scale}");
    }
}

#[test]
fn without_a_direction_the_geometric_normal_stands_in() {
    let (scene, textures) = textured(Material::default(), None);
    let atlas = Atlas::pack(&scene.images, 16, 1).unwrap();
    let material = material_records(&scene, &atlas)[0];
    let [up, down] = [Vec3::Y, Vec3::NEG_Y].map(|n| vertex(n, TANGENT, Vec2::ZERO));
    let spot = Spot { vertices: [&up, &down, &down], u: 0.5, v: 0.0 };
    let s = surface_at(&material, &instance(Mat3::IDENTITY), &spot, DVec3::Z, DVec3::Z, &textures);
    assert_eq!(s.normal, DVec3::Z);
    // A tangent along the normal makes no frame: the map is left out.
    let s = surface(Mat3::IDENTITY, Vec3::X, TANGENT, DVec3::Z, Some([192, 160, 220, 255]));
    assert!(close(s.normal, DVec3::X));
}

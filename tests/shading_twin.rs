//! The shading includes on the device agree with their CPU twins: exactly where they decide, within derived bounds where
//! they measure.
//!
//! In bounds, `U` = 2^-24 is f32's unit roundoff. An addition or multiplication errs by 1 U of its result, Vulkan allows a
//! division 2.5 ulp = 5 U, and an inverse square root 2 ulp = 4 U; a square root is one of those and a division, 9 U.
#![allow(clippy::expect_used, clippy::print_stdout)] // a panic in a test's helper is a failing test

mod support;

use bytemuck::{Pod, Zeroable, cast_slice, pod_collect_to_vec};
use glam::{DVec3, Mat3, Vec3, Vec4};
use half::f16;
use stillray::gpu::image::Sampler;
use stillray::gpu::kernel::{self, Argument};
use stillray::gpu::{Context, Image, ImageDesc};
use stillray::oracle::random::{hash_combine, unit_float};
use stillray::oracle::shade::alpha::alpha_threshold;
use stillray::oracle::shade::brdf::{COSINE_MIN, Reflector};
use stillray::oracle::shade::light::light_at;
use stillray::oracle::shade::lobe::{Bounce, Scatterer, scatter};
use stillray::oracle::shade::material::{Spot, surface_at};
use stillray::oracle::shade::pack;
use stillray::oracle::shade::texture::Textures;
use stillray::report::tonemap::tone_map;
use stillray::scene::atlas::{Atlas, srgb_table};
use stillray::scene::color::linear_to_srgb;
use stillray::shaders::{
    Access, Binding, INSTANCE_FLIPPED, Instance, Kind, Light, MATERIAL_BLEND, Material, Shaded, Shader, TextureSlot,
    Vertex,
};
use stillray::{scene, shaders};

const U: f64 = 1.0 / (1 << 24) as f64;

// --- Asking the device ---

/// The probe with one question defined.
fn probe(question: &str, textured: bool) -> &'static Shader {
    let binding = |name, index, kind, access| Binding { name, index, kind, access };
    let mut bindings = vec![
        binding("questions", 0, Kind::StorageBuffer, Access::Read),
        binding("answers", 1, Kind::StorageBuffer, Access::Write),
    ];
    let mut macros = vec![question];
    if textured {
        macros.push("TEXTURED");
        bindings.push(binding("atlas", 2, Kind::SampledImage, Access::Read));
        bindings.push(binding("srgb", 3, Kind::StorageBuffer, Access::Read));
    }
    support::probe::compile("shading.comp", &macros, bindings)
}

fn ask<Q: Pod, A: Pod>(question: &str, questions: &[Q], atlas: Option<&Atlas>) -> Vec<A> {
    let context = support::validated_context();
    let shader = probe(question, atlas.is_some());
    let mut asked: Vec<u8> = cast_slice(questions).to_vec();
    let mut answers = vec![0u8; questions.len() * size_of::<A>()];
    let mut table = pod_collect_to_vec::<f32, u8>(&srgb_table());
    let mut arguments = vec![Argument::Buffer(&mut asked), Argument::Buffer(&mut answers)];
    let image = atlas.map(|a| upload(&context, a));
    let sampler = Sampler::new(&context).expect("a sampler");
    if let Some(image) = &image {
        arguments.push(Argument::Texture(image, &sampler));
        arguments.push(Argument::Buffer(&mut table));
    }
    kernel::run(&context, shader, &mut arguments, &[], [questions.len() as u32, 1, 1]).expect("the probe runs");
    support::assert_clean(&context);
    pod_collect_to_vec(&answers)
}

fn upload(context: &Context, atlas: &Atlas) -> Image {
    let desc = ImageDesc {
        format: ash::vk::Format::R8G8B8A8_UNORM,
        extent: atlas.size,
        layers: atlas.layers,
        array: true,
        usage: ash::vk::ImageUsageFlags::SAMPLED,
    };
    let image = Image::new(context, "probe textures", desc).expect("an image");
    image.upload(context, cast_slice(&atlas.texels)).expect("an upload");
    image
}

/// A seeded stream of numbers.
struct Stream(u32);

impl Stream {
    fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(1);
        hash_combine(self.0, 77)
    }

    fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * unit_float(self.next())
    }

    fn vector(&mut self, low: f32, high: f32) -> Vec3 {
        Vec3::new(self.range(low, high), self.range(low, high), self.range(low, high))
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.vector(-1.0, 1.0);
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    /// A positive number of any size between these powers of ten.
    fn size(&mut self, low: f32, high: f32) -> f32 {
        10f32.powf(self.range(low, high))
    }
}

/// How many times its bound a difference is; what passes is at most 1. Not finite never passes.
fn excess(got: f32, expected: f64, bound: f64) -> f64 {
    let difference = (f64::from(got) - expected).abs();
    if difference == 0.0 {
        0.0
    } else if difference.is_finite() {
        difference / bound
    } else {
        f64::INFINITY
    }
}

fn worst(excesses: impl Iterator<Item = f64>) -> f64 {
    excesses.fold(0.0, f64::max)
}

fn excess3(got: [f32; 4], expected: DVec3, bound: impl Fn(usize) -> f64) -> f64 {
    worst((0..3).map(|i| excess(got[i], expected[i], bound(i))))
}

// --- Hashed alpha ---

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct AlphaQuestion {
    position: [f32; 3],
    cell: f32,
    seed: u32,
    padding: [u32; 3],
}

#[test]
fn alpha_thresholds_are_the_same_bits() {
    let mut s = Stream(1);
    let mut questions: Vec<AlphaQuestion> = (0..4096)
        .map(|_| {
            let position = (s.vector(-1.0, 1.0) * s.size(-3.0, 8.0)).to_array();
            AlphaQuestion { position, cell: s.size(-6.0, 2.0), seed: s.next(), padding: [0; 3] }
        })
        .collect();
    questions[0] = AlphaQuestion { position: [-0.0, 0.0, 1.0], cell: 1.0, seed: 0, padding: [0; 3] };
    let answers: Vec<f32> = ask("ASK_ALPHA", &questions, None);
    let same = |seed: u32| {
        let equal = |(q, a): (&AlphaQuestion, &f32)| alpha_threshold(q.position, q.cell, q.seed ^ seed) == *a;
        questions.iter().zip(&answers).filter(|p| equal(*p)).count()
    };
    assert_eq!(same(0), questions.len());
    assert!(same(1) < 10, "the comparison can fail");
}

// --- Packing ---

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PackQuestion {
    color: [f32; 3],
    depth: f32,
    offset: [f32; 2],
    motion: [f32; 2],
    codes: [u32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct PackAnswer {
    normal: [f32; 4],
    tangent: [f32; 4],
    color: [f32; 4],
    shaded: Shaded,
}

/// Whether two halves are equal or neighbours.
fn adjacent(a: u32, b: u32) -> bool {
    let ordered = |h: u32| {
        let bits = (h & 0xffff) as i32;
        if bits & 0x8000 != 0 { 0x8000 - bits } else { bits }
    };
    (ordered(a) - ordered(b)).abs() <= 1
}

#[test]
fn packing_agrees_with_its_twin() {
    let mut s = Stream(2);
    let mut questions: Vec<PackQuestion> = (0..4096)
        .map(|_| PackQuestion {
            color: (s.vector(0.0, 1.0) * s.size(-9.0, 7.0)).to_array(),
            depth: s.size(-9.0, 9.0),
            offset: [s.range(-0.1, 1.1), s.range(-0.1, 1.1)],
            motion: [s.range(-1.0, 1.0) * s.size(-6.0, 6.0), s.range(-500.0, 500.0)],
            codes: [s.next(), s.next(), s.next(), s.next()],
        })
        .collect();
    questions[0].color = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    questions[0].motion = [f32::NAN, f32::INFINITY];
    questions[1].codes = [0x8000_8000, 0x8000_8000, 0, !0];
    let answers: Vec<PackAnswer> = ask("ASK_PACK", &questions, None);
    // Codes decode within 5 U of 1; z takes both and two more roundings, folding and normalising (which scales by up to
    // sqrt(3)) the rest: below 48 U. A step of the code is 512 U.
    let bound = 48.0 * U;
    let decoded = |flip: u32| {
        worst(questions.iter().zip(&answers).map(|(q, a)| {
            let [n, t, rg, ba] = [q.codes[0] ^ flip, q.codes[1] ^ flip, q.codes[2] ^ flip, q.codes[3]];
            let color = pack::decode_color(rg, ba);
            let tangent = pack::decode_tangent(t);
            excess3(a.normal, pack::decode_normal(n), |_| bound)
                .max(excess3(a.tangent, tangent.truncate(), |_| bound))
                .max(excess(a.tangent[3], tangent.w, 1e-30))
                .max(worst((0..4).map(|i| excess(a.color[i], color[i], 6.0 * U))))
        }))
    };
    assert!(decoded(0) <= 1.0, "{} times the bound", decoded(0));
    assert!(decoded(1) > 1.0, "one step of a code is seen");
    for (q, a) in questions.iter().zip(&answers) {
        let (got, want) = (a.shaded, pack::pack_shaded(q.color, q.offset, q.motion, q.depth));
        assert_eq!(got.depth, want.depth);
        assert_eq!(got.color_b_offset >> 16, want.color_b_offset >> 16, "position {:?}", q.offset);
        let pairs = [(got.color_rg, want.color_rg), (got.motion, want.motion)];
        assert!(pairs.iter().all(|(g, w)| adjacent(*g, *w) && adjacent(g >> 16, w >> 16)), "{:?}", q.color);
        assert!(adjacent(got.color_b_offset, want.color_b_offset));
        let halves = [got.color_rg, got.color_rg >> 16, got.color_b_offset, got.motion, got.motion >> 16];
        assert!(halves.iter().all(|h| f16::from_bits(*h as u16).is_finite()));
    }
    assert!(!adjacent(0x3c00, 0x3c02) && adjacent(0x8000, 0x0000), "neighbours are told apart");
}

// --- Textures ---

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct TextureQuestion {
    slot: TextureSlot,
    uv: [[f32; 2]; 2],
    is_srgb: u32,
    padding: [u32; 3],
}

/// Images of random texels, packed.
fn atlas(s: &mut Stream) -> (Vec<scene::Image>, Atlas) {
    let image = |(width, height): (u32, u32)| scene::Image {
        name: format!("{width} x {height}"),
        width,
        height,
        texels: (0..width * height).map(|_| s.next().to_le_bytes()).collect(),
    };
    let images: Vec<scene::Image> = [(1, 1), (2, 3), (7, 5), (64, 16), (33, 1), (48, 48)].map(image).into();
    let atlas = Atlas::pack(&images, 64, 8).expect("they fit");
    (images, atlas)
}

fn slot(s: &mut Stream, images: &[scene::Image], atlas: &Atlas) -> TextureSlot {
    let i = s.next() as usize % images.len();
    let (image, place) = (&images[i], atlas.places[i]);
    let flags = (s.next() % 3) | ((s.next() % 3) << 2) | ((s.next() & 3) << 4);
    TextureSlot {
        transform: [s.range(-3.0, 3.0), s.range(-1.0, 1.0), s.range(-1.0, 1.0), s.range(-3.0, 3.0)],
        offset: [s.range(-1.0, 1.0), s.range(-1.0, 1.0)],
        texel_origin: place.x | place.y << 16,
        texel_size: image.width | image.height << 16,
        page: place.layer,
        flags,
        ..TextureSlot::zeroed()
    }
}

#[test]
fn textures_agree_with_their_twin() {
    let mut s = Stream(3);
    let (images, atlas) = atlas(&mut s);
    assert!(atlas.layers > 1, "more than one layer is tried");
    let mut questions: Vec<TextureQuestion> = (0..8192)
        .map(|_| {
            let size = s.size(-2.0, 6.0);
            let uv = [0, 1].map(|_| [s.range(-size, size), s.range(-size, size)]);
            TextureQuestion { slot: slot(&mut s, &images, &atlas), uv, is_srgb: s.next() & 1, padding: [0; 3] }
        })
        .collect();
    for (q, odd) in questions.iter_mut().zip([1e9, -1e10, 1e30, f32::MAX, f32::INFINITY, f32::NEG_INFINITY, f32::NAN]) {
        q.uv = [[odd; 2]; 2];
    }
    let answers: Vec<[f32; 4]> = ask("ASK_TEXTURE", &questions, Some(&atlas));
    let textures = Textures::new(atlas);
    // Texels and weights are exact but for the 2 U of a unorm; each of three blends rounds three times, of values up to 1
    // and differences up to 1.
    let bound = 16.0 * U;
    let compare = |shift: f32| {
        worst(questions.iter().zip(&answers).map(|(q, a)| {
            let moved = |uv: [f32; 2]| [uv[0] + shift, uv[1]];
            let want = textures.sample(&q.slot, moved(q.uv[0]), moved(q.uv[1]), q.is_srgb != 0);
            worst((0..4).map(|i| excess(a[i], want[i], bound)))
        }))
    };
    assert!(compare(0.0) <= 1.0, "{} times the bound", compare(0.0));
    assert!(compare(1e-3) > 1.0, "a thousandth of an image is seen");
}

// --- Lights ---

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LightQuestion {
    light: Light,
    point: [f32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LightAnswer {
    direction_distance: [f32; 4],
    irradiance: [f32; 4],
}

fn light(s: &mut Stream) -> Light {
    let (inner, outer) = (s.range(0.0, 0.6).cos(), s.range(0.7, 1.5).cos());
    let spot_scale = 1.0 / (inner - outer);
    Light {
        position: (s.vector(-1.0, 1.0) * s.size(-6.0, 6.0)).to_array(),
        kind: s.next() % 3,
        direction: s.direction().to_array(),
        inv_range2: if s.next() & 1 == 0 { 0.0 } else { s.size(-8.0, 8.0) },
        intensity: (s.vector(0.0, 1.0) * s.size(-6.0, 9.0)).to_array(),
        spot_scale,
        spot_offset: -outer * spot_scale,
        ..Light::zeroed()
    }
}

#[test]
fn lights_agree_with_their_twin() {
    let mut s = Stream(4);
    let mut questions: Vec<LightQuestion> = (0..8192)
        .map(|_| {
            let light = light(&mut s);
            let reach = s.size(-7.0, 7.0);
            LightQuestion {
                light,
                point: (Vec3::from(light.position) + s.vector(-reach, reach)).extend(0.0).to_array(),
            }
        })
        .collect();
    for (q, d) in questions.iter_mut().zip([0.0, 1e-38, 1e-30, 1e20, 3e38]) {
        q.light.position = [0.0; 3];
        q.light.intensity = [1e30; 3];
        q.point = [d, 0.0, 0.0, 0.0];
    }
    let answers: Vec<LightAnswer> = ask("ASK_LIGHT", &questions, None);
    let compare = |gain: f32| {
        worst(questions.iter().zip(&answers).map(|(q, a)| {
            let changed = Light { intensity: q.light.intensity.map(|c| c * gain), ..q.light };
            let want = light_at(&changed, [q.point[0], q.point[1], q.point[2]]);
            let bare = Light { inv_range2: 0.0, kind: q.light.kind & 2, ..changed };
            let most = light_at(&bare, [q.point[0], q.point[1], q.point[2]]).irradiance;
            // Direction: a division, a dot product (3 U), a root, a division. Irradiance: the squared length (2 * 5 + 3 U),
            // three divisions, a product: 40 U. Range and cone are factors of at most 1, whose squares double the errors of
            // what they are made of: 64 U for the range, and for the cone that of a cosine (24 U) times its slope.
            let cone = if q.light.kind == shaders::LIGHT_SPOT { f64::from(q.light.spot_scale).abs() } else { 0.0 };
            let relative = (40.0 + 64.0 + 64.0 * (1.0 + cone)) * U;
            // What is smaller than the least normal number may be flushed to 0.
            let least = f64::from(f32::MIN_POSITIVE);
            excess3(a.irradiance, want.irradiance, |i| relative * most[i] + least)
                .max(excess3(a.direction_distance, want.direction, |_| 24.0 * U))
                .max(distance_excess(a.direction_distance[3], want.distance))
        }))
    };
    assert!(compare(1.0) <= 1.0, "{} times the bound", compare(1.0));
    assert!(compare(1.01) > 1.0, "a hundredth is seen");
}

fn distance_excess(got: f32, want: f64) -> f64 {
    if want > f64::from(f32::MAX) {
        return if got == f32::INFINITY { 0.0 } else { f64::INFINITY };
    }
    excess(got, want, 24.0 * U * want + f64::from(f32::MIN_POSITIVE))
}

// --- BRDF ---

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct BrdfQuestion {
    base_color: [f32; 3],
    metallic: f32,
    normal: [f32; 3],
    roughness: f32,
    view: [f32; 4],
    light: [f32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct BrdfAnswer {
    punctual: [f32; 4],
    uniform: [f32; 4],
}

fn double(v: [f32; 4]) -> DVec3 {
    Vec4::from(v).truncate().as_dvec3()
}

/// Absolute error of the albedo fits. In each polynomial the terms' sizes add up to at most 4.1 times the denominator, and
/// each takes some ten operations; a cosine is off by 3 U and alpha by 1 U, with slopes of at most 4.1 and 10.7. (The three
/// factors are maxima over a grid of the fits' domain.)
const FIT: f64 = (2.0 * 4.1 * 10.0 + 4.1 * 3.0 + 10.7) * U;

#[test]
fn the_brdf_agrees_with_its_twin() {
    let mut s = Stream(5);
    let questions: Vec<BrdfQuestion> = (0..16384)
        .map(|i| {
            let normal = s.direction();
            let view = (s.direction() + normal * s.range(0.0, 1.5)).normalize();
            // Half of the lights are near the mirror direction, where the lobe is.
            let mirrored = 2.0 * normal.dot(view) * normal - view;
            let near = (mirrored + s.direction() * s.size(-4.0, 0.0)).normalize();
            BrdfQuestion {
                base_color: s.vector(0.0, 1.0).to_array(),
                metallic: [0.0, 1.0, s.range(0.0, 1.0)][i % 3],
                normal: normal.to_array(),
                roughness: [0.0, s.range(0.0, 1.0), s.range(0.0, 0.3)][i / 3 % 3],
                view: view.extend([0.04, s.range(0.0, 1.0)][i / 9 % 2]).to_array(),
                light: if i % 2 == 0 { near } else { s.direction() }
                    .extend([1.0, s.range(0.0, 1.0)][i / 9 % 2])
                    .to_array(),
            }
        })
        .collect();
    let answers: Vec<BrdfAnswer> = ask("ASK_BRDF", &questions, None);
    let compare = |blunt: f32| {
        worst(
            questions
                .iter()
                .zip(&answers)
                .map(|(q, a)| brdf_excess(&BrdfQuestion { roughness: q.roughness + blunt, ..*q }, a)),
        )
    };
    assert!(compare(0.0) <= 1.0, "{} times the bound", compare(0.0));
    assert!(compare(1e-2) > 1.0, "a hundredth of roughness is seen");
}

fn brdf_excess(q: &BrdfQuestion, a: &BrdfAnswer) -> f64 {
    let base_color = Vec3::from(q.base_color).as_dvec3();
    let [metallic, roughness] = [q.metallic, q.roughness].map(f64::from);
    // With the reflectance and the opacity of what is not metal in the fourth components.
    let [dielectric, opaque] = [q.view[3], q.light[3]].map(f64::from);
    let reflector = Reflector { base_color, metallic, roughness, dielectric, opaque };
    let (normal, view, light) = (Vec3::from(q.normal).as_dvec3(), double(q.view), double(q.light));
    let want = reflector.reflect_light(normal, view, light);
    let nl = normal.dot(light);
    let nv = normal.dot(view).max(COSINE_MIN);
    let uniform = reflector.reflect_uniform(normal, view);
    // Sums and products of values up to 1, the albedo twice, once divided by at least 0.29: 16 U and some fits.
    let uniform_bound = 16.0 * U + 8.0 * FIT;
    if nl <= 4.0 * U {
        // On which side the light is may be a matter of rounding; what is then reflected is no more than rounding either.
        let most = 4.0 * U * 1024.0 * (1024.0 * 1024.0);
        return excess3(a.punctual, want, |_| most).max(excess3(a.uniform, uniform, |_| uniform_bound));
    }
    let sum = (light + view).length();
    let alpha = (roughness * roughness).max(1.0 / 1024.0);
    // The half vector's direction: the sum's rounding (2 U a component) over its length, the cross product's (4 U); an angle
    // that is off by e changes D, a square of 1 / (alpha^2 + angle^2), by 2 e / alpha. The rest of D, V and F are some thirty
    // operations, and cosines that are off by 3 U, relative to their size.
    let angle = (4.0 / sum + 8.0) * U;
    let relative = 2.0 * angle / alpha + (100.0 + 6.0 / nl + 6.0 / nv) * U;
    // The diffuse layer: three albedos, of which the mean is divided by; at most 1 / 256 for metals that have no layer left.
    let mean = 1.0 - reflector.specular_color().max_element();
    let layer = (nl + 3.0 * U) * (64.0 * U + 4.0 * FIT) / mean.max(1.0 / 256.0).powi(2) * (1.0 - metallic) + 3.0 * U;
    excess3(a.punctual, want, |i| relative * want[i] + layer).max(excess3(a.uniform, uniform, |_| uniform_bound))
}

// --- Where paths go on ---

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ScatterQuestion {
    base_color: [f32; 3],
    metallic: f32,
    normal: [f32; 3],
    roughness: f32,
    geometric: [f32; 3],
    dielectric: f32,
    view: [f32; 3],
    opaque: f32,
    u: [f32; 2],
    which: f32,
    part: f32,
    exponent: f32,
    index: f32,
    padding: [f32; 2],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct ScatterAnswer {
    direction: [f32; 3],
    through: u32,
    weight: [f32; 3],
    padding: u32,
}

/// What is asked of a surface, up to the ends of its ranges.
fn scatter_question(s: &mut Stream, i: usize) -> ScatterQuestion {
    let normal = s.direction();
    // At the ends of its range a draw lies at the end of the lobe, where nothing bounds its error but that it is finite.
    let most = if i.is_multiple_of(16) { 0.99999994 } else { 0.9 };
    ScatterQuestion {
        base_color: s.vector(0.0, 1.0).to_array(),
        metallic: [0.0, 0.0, 1.0, s.range(0.0, 1.0)][i % 4],
        normal: normal.to_array(),
        roughness: [0.0, s.range(0.0, 1.0), s.range(0.0, 0.3), 1.0][i / 4 % 4],
        geometric: (normal + s.direction() * 0.2).normalize().to_array(),
        dielectric: [0.04, s.range(0.0, 1.0)][i / 2 % 2],
        view: (s.direction() + normal * s.range(0.0, 1.5)).normalize().to_array(),
        opaque: [1.0, 0.0, s.range(0.0, 1.0)][i % 3],
        u: [s.range(0.0, 1.0), s.range(0.0, most)],
        which: s.range(0.0, 1.0),
        part: [s.range(0.05, 0.95), 0.0][i / 7 % 2],
        exponent: [0.0, 0.0, s.size(0.0, 6.0)][i / 3 % 3],
        index: [0.0, 1.0, s.range(0.25, 4.0), 1.0 / 1.5, 1.5][i / 5 % 5],
        padding: [0.0; 2],
    }
}

fn asked(q: &ScatterQuestion) -> Option<Bounce> {
    let vector = |v: [f32; 3]| Vec3::from(v).as_dvec3();
    let reflector = Reflector {
        base_color: vector(q.base_color),
        metallic: q.metallic.into(),
        roughness: q.roughness.into(),
        dielectric: q.dielectric.into(),
        opaque: q.opaque.into(),
    };
    let scatterer = Scatterer { reflector, exponent: q.exponent.into(), index: q.index.into(), part: q.part.into() };
    let normals = [vector(q.normal), vector(q.geometric)];
    scatter(&scatterer, normals, vector(q.view), q.u.map(f64::from), q.which.into())
}

#[test]
fn paths_go_on_where_their_twin_says() {
    let mut s = Stream(8);
    let questions: Vec<ScatterQuestion> = (0..32768).map(|i| scatter_question(&mut s, i)).collect();
    let answers: Vec<ScatterAnswer> = ask("ASK_SCATTER", &questions, None);
    for (q, a) in questions.iter().zip(&answers) {
        let length = Vec3::from(a.direction).length();
        assert!((length - 1.0).abs() < 1e-5 && Vec3::from(a.weight).is_finite(), "{:?} {:?}", a.direction, a.weight);
        assert!(Vec3::from(a.weight).min_element() >= 0.0 && Vec3::from(a.weight).max_element() < 100.0, "{:?}", q.u);
    }
    let compare = |wrong: f32| {
        let pairs = questions.iter().zip(&answers).filter(|(q, _)| q.u[1] < 0.9);
        let all: Vec<f64> =
            pairs.map(|(q, a)| scatter_excess(&ScatterQuestion { index: q.index * wrong, ..*q }, a)).collect();
        let known = all.iter().filter(|e| !e.is_nan()).count();
        (all.iter().copied().filter(|e| !e.is_nan()).fold(0.0, f64::max), known as f64 / all.len() as f64)
    };
    let (most, known) = compare(1.0);
    println!("{most:.3} times the bound at most, {:.2} % decided", 100.0 * known);
    assert!(most <= 1.0, "{most} times the bound");
    // The rest are seen at or below the horizon of their normal.
    assert!(known > 0.95, "{known} are decided");
    assert!(compare(1.001).0 > 1.0, "a thousandth of the index is seen");
}

/// How many times its bound the difference is; NaN where rounding may decide.
fn scatter_excess(q: &ScatterQuestion, a: &ScatterAnswer) -> f64 {
    let nothing = a.weight == [0.0; 3];
    let Some(want) = asked(q) else { return if nothing { 0.0 } else { f64::INFINITY } };
    // Where a device has no bound to keep, none is asked for.
    if want.doubtful || want.direction_error > 0.01 {
        return f64::NAN;
    }
    let weight = worst((0..3).map(|i| excess(a.weight[i], want.weight[i], want.weight_error)));
    if nothing {
        return weight;
    }
    let same = (a.through != 0) == want.through;
    let direction = worst((0..3).map(|i| excess(a.direction[i], want.direction[i], want.direction_error)));
    if same { weight.max(direction) } else { f64::INFINITY }
}

// --- Materials ---

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MaterialQuestion {
    material: Material,
    instance: Instance,
    vertices: [Vertex; 3],
    uv: [f32; 2],
    padding: [u32; 2],
    geometric: [f32; 4],
    view: [f32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MaterialAnswer {
    base: [f32; 4],
    emissive_occlusion: [f32; 4],
    normal_metallic: [f32; 4],
    geometric_roughness: [f32; 4],
}

fn instance(s: &mut Stream) -> Instance {
    let turn = Mat3::from_axis_angle(s.direction(), s.range(0.0, 3.0));
    // Unequal scales of up to 2 to 1, mirrored half of the time, and of any size.
    let mut scale = s.vector(1.0, 2.0) * s.size(-8.0, 8.0);
    if s.next() & 1 == 0 {
        scale.x = -scale.x;
    }
    let matrix = turn * Mat3::from_diagonal(scale);
    let rows = |m: Mat3| [0, 1, 2].map(|i| m.row(i).extend(0.0).to_array());
    let inverse = matrix.as_dmat3().inverse().as_mat3();
    let flags = if scale.x < 0.0 { INSTANCE_FLIPPED } else { 0 };
    Instance { to_relative: rows(matrix), to_object: rows(inverse), flags, ..Instance::zeroed() }
}

/// Three vertices around a common normal, with tangents about perpendicular to it, as codes of the octahedral map.
fn vertices(s: &mut Stream) -> [Vertex; 3] {
    let code = |v: Vec3, bits: f32| {
        let p = v / (v.x.abs() + v.y.abs() + v.z.abs());
        let fold = |a: f32, b: f32| if p.z >= 0.0 { a } else { (1.0 - b.abs()) * a.signum() };
        [(fold(p.x, p.y) * 32767.0).round() as i32 as u32, (fold(p.y, p.x) * bits).round() as i32 as u32]
    };
    let normal = s.direction();
    let tangent = normal.any_orthonormal_vector();
    let handedness = s.next() << 31;
    [0, 1, 2].map(|_| {
        let [nx, ny] = code((normal + s.direction() * 0.3).normalize(), 32767.0);
        let [tx, ty] = code((tangent + s.direction() * 0.2).normalize(), 16383.0);
        Vertex {
            normal: (nx & 0xffff) | (ny << 16),
            tangent: (tx & 0xffff) | ((ty & 0x7fff) << 16) | handedness,
            uv0: [s.range(-2.0, 2.0), s.range(-2.0, 2.0)],
            uv1: [s.range(-2.0, 2.0), s.range(-2.0, 2.0)],
            color_rg: s.next(),
            color_ba: s.next(),
        }
    })
}

fn material(s: &mut Stream, images: &[scene::Image], atlas: &Atlas) -> Material {
    let mut texture = || if s.next() & 1 == 0 { TextureSlot::zeroed() } else { slot(s, images, atlas) };
    let slots = [texture(), texture(), texture(), texture(), texture()];
    Material {
        base_color: s.vector(0.0, 1.0).extend(s.range(0.0, 1.0)).to_array(),
        emissive: s.vector(0.0, 4.0).to_array(),
        metallic: s.range(0.0, 1.0),
        roughness: s.range(0.0, 1.0),
        normal_scale: s.range(0.0, 1.5),
        occlusion_strength: s.range(0.0, 1.0),
        flags: if s.next() & 1 == 0 { MATERIAL_BLEND } else { 0 },
        base_color_texture: slots[0],
        metallic_roughness_texture: slots[1],
        normal_texture: slots[2],
        occlusion_texture: slots[3],
        emissive_texture: slots[4],
        ..Material::zeroed()
    }
}

#[test]
fn materials_agree_with_their_twin() {
    let mut s = Stream(6);
    let (images, atlas) = atlas(&mut s);
    let questions: Vec<MaterialQuestion> = (0..4096)
        .map(|_| {
            let u = s.range(0.0, 1.0);
            MaterialQuestion {
                material: material(&mut s, &images, &atlas),
                instance: instance(&mut s),
                vertices: vertices(&mut s),
                uv: [u, s.range(0.0, 1.0 - u)],
                padding: [0; 2],
                geometric: s.direction().extend(0.0).to_array(),
                view: s.direction().extend(0.0).to_array(),
            }
        })
        .collect();
    let answers: Vec<MaterialAnswer> = ask("ASK_MATERIAL", &questions, Some(&atlas));
    let textures = Textures::new(atlas);
    let compare = |flip: u32| {
        worst(questions.iter().zip(&answers).map(|(q, a)| {
            let instance = Instance { flags: q.instance.flags ^ flip, ..q.instance };
            material_excess(&MaterialQuestion { instance, ..*q }, a, &textures)
        }))
    };
    assert!(compare(0) <= 1.0, "{} times the bound", compare(0));
    assert!(compare(INSTANCE_FLIPPED) > 1.0, "the handedness is seen");
}

fn material_excess(q: &MaterialQuestion, a: &MaterialAnswer, textures: &Textures) -> f64 {
    let [v0, v1, v2] = &q.vertices;
    let spot = Spot { vertices: [v0, v1, v2], u: q.uv[0], v: q.uv[1] };
    let (geometric, view) = (double(q.geometric), double(q.view));
    let facing = geometric.dot(view);
    if facing.abs() < 8.0 * U {
        return 0.0; // seen edge-on: which side is a matter of rounding
    }
    let want = surface_at(&q.material, &q.instance, &spot, geometric, view, textures);
    // Colours: vertex colours (6 U each, blended: 16 U), textures (16 U), products.
    let color = 40.0 * U;
    let base = want.reflector.base_color;
    // Normals: decoded (48 U), blended and transformed (scales of up to 2 to 1 bend errors by as much): 128 U. The tangent the
    // same, and it is within 45 degrees of perpendicular: 3 * 128 U. Mapped, 16 U of a map's texel count double, its length
    // may be as short as 1/8 before it is normalised (below that, a random texel may point anywhere).
    let normal = if q.material.normal_texture.texel_size == 0 { 128.0 * U } else { mapped_bound(q, &spot, textures) };
    excess3(a.base, base, |_| color)
        .max(excess(a.base[3], want.alpha, color))
        .max(excess3(a.emissive_occlusion, want.emissive, |_| 4.0 * color))
        .max(excess(a.emissive_occlusion[3], want.occlusion, color))
        .max(excess(a.normal_metallic[3], want.reflector.metallic, color))
        .max(excess(a.geometric_roughness[3], want.reflector.roughness, color))
        .max(excess3(a.geometric_roughness, want.geometric, |_| U))
        .max(excess3(a.normal_metallic, want.normal, |_| normal))
}

fn mapped_bound(q: &MaterialQuestion, spot: &Spot<'_>, textures: &Textures) -> f64 {
    let at = spot.attributes();
    let m = textures.sample(&q.material.normal_texture, at.uv0, at.uv1, false).truncate() * 2.0 - 1.0;
    let scale = f64::from(q.material.normal_scale);
    let length = (m * DVec3::new(scale, scale, 1.0)).length();
    (3.0 * 384.0 * U * length + 3.0 * 32.0 * U * scale.max(1.0)) / length
}

// --- Colour ---

#[test]
fn colours_agree_with_their_twin() {
    let mut s = Stream(7);
    let questions: Vec<[f32; 4]> =
        (0..4096).map(|_| (s.vector(0.0, 1.0) * s.size(-5.0, 4.5)).extend(0.0).to_array()).collect();
    let answers: Vec<[[f32; 4]; 2]> = ask("ASK_COLOR", &questions, None);
    let compare = |gain: f32| {
        worst(questions.iter().zip(&answers).map(|(q, [mapped, encoded])| {
            let color = [q[0] * gain, q[1] * gain, q[2] * gain];
            // Vulkan's pow is exp2(y log2 x): 3 ulp of the logarithm (or 2^-21 near 1), which is at most 8.4 here, times y,
            // and (3 + 2 |y log2 x|) ulp of the exponential: 40 U of up to 1.06. Tone mapping is some twenty operations on
            // values that are scaled to 1; its subtraction of 0.04 leaves errors of the channel itself.
            let curve = worst((0..3).map(|i| excess(encoded[i], linear_to_srgb(color[i].into()), 48.0 * U)));
            let map = tone_map(color);
            let peak = f64::from(color.into_iter().fold(0.0, f32::max)).max(1.0);
            let bound = |i: usize| (40.0 + 8.0 * f64::from(color[i]) / peak) * U;
            curve.max(worst((0..3).map(|i| excess(mapped[i], map[i], bound(i)))))
        }))
    };
    assert!(compare(1.0) <= 1.0, "{} times the bound", compare(1.0));
    assert!(compare(1.001) > 1.0, "a thousandth is seen");
}

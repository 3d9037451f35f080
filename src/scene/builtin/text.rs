//! A sheet of paper with text in decreasing sizes: texture detail at and below a pixel's footprint, after the text of
//! "Interactive Stable Ray Tracing", section 6. Nothing in it is random.

use super::font::{self, ink};
use super::shapes::{empty, push_quad};
use super::stage::Stage;
use crate::scene::{Image, Material, Scene, Wrap};
use glam::{DVec3, Vec3};

/// Texels a side of the texture.
const SIZE: usize = 1024;
const MARGIN: usize = 40;
const PAPER: [u8; 4] = [242, 240, 232, 255];
const INK: [u8; 4] = [24, 22, 30, 255];

/// Lines, each with the texels that a pixel of the font takes.
const LINES: &[(usize, &str)] = &[
    (9, "Stable rays: 1024"),
    (7, "Sphinx of black quartz"),
    (7, "judge my vow!"),
    (5, "Pack my box with five dozen"),
    (5, "liquor jugs; 60 of them."),
    (4, "The quick brown fox jumps over the"),
    (4, "lazy dog, 3 times a day."),
    (3, "How vexingly quick daft zebras jump! Waltz,"),
    (3, "bad nymph, for quick jigs vex: 0123456789."),
    (3, "JACKDAWS LOVE MY BIG SPHINX OF QUARTZ"),
    (2, "The five boxing wizards jump quickly. Amazingly few discotheques"),
    (2, "provide jukeboxes. We promptly judged antique ivory buckles for the"),
    (2, "next prize. Grumpy wizards make toxic brew for the evil queen, Jack."),
    (2, "A wizard's job is to vex chumps quickly in fog - by 2 or 3 at a time."),
    (
        1,
        "Quick zephyrs blow, vexing daft Jim. Two driven jocks help fax my big quiz. Sixty zippers were quickly picked from the woven jute bag. Crazy Fredrick bought",
    ),
    (
        1,
        "many very exquisite opal jewels. Jaded zombies acted quaintly but kept driving their oxen forward. The job requires extra pluck and zeal from every young wage",
    ),
    (
        1,
        "earner. Five or six big jet planes zoomed quickly by the tower. Back in June we delivered oxygen equipment of the same size. My girl wove six dozen plaid",
    ),
    (
        1,
        "jackets before she quit. Few black taxis drive up major roads on quiet hazy nights. Would you believe it: 1, 2, 3, 4, 5, 6, 7, 8, 9 and not one more line?",
    ),
];

pub(super) fn build() -> Scene {
    let mut stage = Stage::new("text", Vec3::new(0.50, 0.55, 0.62));
    let page = stage.texture(page(), Wrap::Clamp, false);
    let paper = stage.material(Material {
        name: "paper".to_owned(),
        base_color_texture: Some(page),
        metallic: 0.0,
        roughness: 0.9,
        double_sided: true,
        ..Material::default()
    });
    let mut mesh = empty("page");
    push_quad(&mut mesh, DVec3::new(-1.0, 0.0, 1.0), DVec3::X * 2.0, DVec3::Z * -2.0, paper);
    let mesh = stage.mesh(mesh);
    stage.place("page", mesh);
    stage.point_light(DVec3::new(-1.5, 3.0, 0.5), Vec3::new(1.0, 0.97, 0.92), 18.0);
    stage.camera(DVec3::new(0.0, 2.3, 2.0), DVec3::new(0.0, 0.0, 0.12), 0.74);
    stage.finish()
}

fn page() -> Image {
    let mut texels = vec![PAPER; SIZE * SIZE];
    let mut top = MARGIN;
    for same in LINES.chunk_by(|a, b| a.0 == b.0) {
        for (scale, line) in same {
            draw_line(&mut texels, line, *scale, top);
            top += scale * (font::HEIGHT + 4);
        }
        top += same[0].0 * 2 + 4;
    }
    Image { name: "page".to_owned(), width: SIZE as u32, height: SIZE as u32, texels }
}

fn draw_line(texels: &mut [[u8; 4]], line: &str, scale: usize, top: usize) {
    for (i, character) in line.chars().enumerate() {
        let left = MARGIN + i * (font::WIDTH + 1) * scale;
        for y in 0..font::HEIGHT * scale {
            for x in 0..font::WIDTH * scale {
                if ink(character, x / scale, y / scale) && left + x < SIZE && top + y < SIZE {
                    texels[(top + y) * SIZE + left + x] = INK;
                }
            }
        }
    }
}

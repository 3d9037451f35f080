//! The images of `tools/metric_reference.py`, made by the same integers.

/// Pixels across and down.
pub const SIZE: [u32; 2] = [80, 72];

/// 8-bit codes, three a pixel.
pub type Codes = Vec<i32>;

/// The linear congruential generator of Numerical Recipes, its upper 24 bits.
pub struct Random {
    pub state: u32,
}

impl Random {
    pub fn next(&mut self, below: i32) -> i32 {
        self.state = self.state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.state >> 8) as i32 % below
    }
}

/// Discs of random size and colour, each hiding those under it.
pub fn discs(seed: u32, grey: bool, [width, height]: [u32; 2]) -> Codes {
    let (mut random, [width, height]) = (Random { state: seed }, [width as i32, height as i32]);
    let mut image = vec![128; (width * height * 3) as usize];
    for _ in 0..70 {
        let (radius, cx, cy) = (2 + random.next(14), random.next(width), random.next(height));
        let color = [0; 3].map(|_| 40 + random.next(176));
        for (i, pixel) in image.chunks_exact_mut(3).enumerate() {
            let (x, y) = (i as i32 % width, i as i32 / width);
            if (x - cx).pow(2) + (y - cy).pow(2) < radius * radius {
                pixel.copy_from_slice(&if grey { [color[0]; 3] } else { color });
            }
        }
    }
    image
}

/// Adds what is evenly distributed in `-amount..=amount`.
pub fn noise(image: &Codes, seed: u32, amount: i32) -> Codes {
    let mut random = Random { state: seed };
    image.iter().map(|code| (code + random.next(2 * amount + 1) - amount).clamp(0, 255)).collect()
}

/// A binomial filter over 3x3 pixels.
pub fn blur(image: &Codes, [width, height]: [u32; 2]) -> Codes {
    let (width, height) = (width as i32, height as i32);
    let at =
        |x: i32, y: i32, c: usize| image[((y.clamp(0, height - 1) * width + x.clamp(0, width - 1)) * 3) as usize + c];
    let across = |x: i32, y: i32, c: usize| at(x - 1, y, c) + 2 * at(x, y, c) + at(x + 1, y, c);
    let filtered = |i: usize| {
        let (x, y, c) = ((i / 3) as i32 % width, (i / 3) as i32 / width, i % 3);
        (across(x, y - 1, c) + 2 * across(x, y, c) + across(x, y + 1, c) + 8) >> 4
    };
    (0..image.len()).map(filtered).collect()
}

/// Everything one pixel to the right; what leaves comes in at the left.
pub fn shifted(image: &Codes, width: u32) -> Codes {
    image
        .chunks_exact(3 * width as usize)
        .flat_map(|row| [&row[row.len() - 3..], &row[..row.len() - 3]].concat())
        .collect()
}

/// One of the table's variants.
pub fn variant(name: &str, image: &Codes) -> Codes {
    match name {
        "same" => image.clone(),
        "noise" => noise(image, 11, 20),
        "blur" => blur(image, SIZE),
        "blurrier" => blur(&blur(&blur(image, SIZE), SIZE), SIZE),
        "shifted" => shifted(image, SIZE[0]),
        "darker" => image.iter().map(|code| (code * 3) >> 2).collect(),
        other => panic!("no variant {other}"),
    }
}

/// The values of the codes in a space of the table, interleaved.
pub fn values(space: &str, image: &Codes) -> Vec<f32> {
    let wide = |i: usize| {
        let stops = (i / 3) as i32 % SIZE[0] as i32 * 16 / SIZE[0] as i32 - 6;
        image[i] as f32 * (stops as f32).exp2() / 256.0
    };
    match space {
        "display" => image.iter().map(|code| *code as f32 / 255.0).collect(),
        "plain" => image.iter().map(|code| *code as f32 / 128.0).collect(),
        "negative" => image.iter().map(|code| (code - 100) as f32 / 128.0).collect(),
        "wide" => (0..image.len()).map(wide).collect(),
        other => panic!("no space {other}"),
    }
}

//! Paper 1's figures 6, 8 and 10, and paper 2's figure 16: pictures, and the Markdown that shows them.

use crate::Result;
use crate::progress::Progress;
use crate::report::distribution::{self, Area};
use crate::report::png::Picture;
use crate::sampler::{Strategy, Tiling};
use crate::samples::SamplePoint;
use crate::scene::motion::Motion;
use crate::settings::{Edges, Fill, Method, Settings, Weights};
use crate::trade::pictures::picture;
use crate::trade::studio::Studio;
use std::fmt::Write;
use std::path::Path;

/// Frames before the one that is shown: "to allow stable ray tracing to settle into a nonstandard sampling pattern" (paper 1,
/// section 6).
const SETTLED: u32 = 25;
/// Passes of 16 samples a pixel of a converged frame.
const PASSES: u32 = 16;

/// Renders figures of one scene into a folder.
pub struct Figures<'a> {
    /// The scene on its device.
    pub studio: Studio<'a>,
    /// Name of the scene, for file names and captions.
    pub scene: &'a str,
    /// Width and height of the frames in pixels.
    pub size: [u32; 2],
    /// Where the pictures go; the Markdown names them relative to the folder above.
    pub folder: &'a Path,
    /// Told of every frame.
    pub progress: &'a dyn Progress,
    /// Asked before every frame; if it says so, there is no figure.
    pub stop: &'a dyn Fn() -> bool,
}

impl std::fmt::Debug for Figures<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Figures of {} in {}", self.scene, self.folder.display())
    }
}

/// A frame of a motion, with its samples.
struct Drawn {
    picture: Picture,
    samples: Vec<SamplePoint>,
}

/// Figure 6: three parts of one frame of a rotation at 2 samples a pixel, with their samples.
///
/// # Errors
/// Those of rendering, and of files.
pub fn distributions(figures: &Figures<'_>) -> Result<Option<String>> {
    let settings = Settings { density: 2.0, ..Settings::of(Method::Stable) };
    let Some(frame) = figures.settled(&settings, Motion::Rotate)? else { return Ok(None) };
    let mut row = format!("| {}", figures.show("6-frame", &frame.picture)?);
    for (i, [x, y]) in [[0.5, 0.5], [0.3, 0.25], [0.72, 0.66]].into_iter().enumerate() {
        let middle = [(f64::from(figures.size[0]) * x) as u32, (f64::from(figures.size[1]) * y) as u32];
        let area = Area::around(middle, 12, figures.size);
        let _ = write!(row, " | {}", figures.draw(&format!("6-{i}"), &frame, area)?);
    }
    Ok(Some(format!("| frame | middle | upper left | lower right |\n| --- | --- | --- | --- |\n{row} |\n")))
}

/// Figure 8: supersampling against stable ray tracing at 1, 2 and 4 samples a pixel after 25 frames of a rotation, and
/// close-ups of the middle.
///
/// # Errors
/// Those of rendering, and of files.
pub fn qualities(figures: &Figures<'_>) -> Result<Option<String>> {
    let area = Area::around(figures.size.map(|side| side / 2), figures.size[0].min(figures.size[1]) / 4, figures.size);
    let mut text = String::from("| | 1 | 2 | 4 | converged |\n| --- | --- | --- | --- | --- |\n");
    let Some(converged) = figures.converged(Motion::Rotate)? else { return Ok(None) };
    for method in [Method::Supersample, Method::Stable] {
        let (mut whole, mut close) = (format!("| {}", method.name()), String::from("| close-up"));
        for samples in [1u16, 2, 4] {
            let settings = Settings { density: f32::from(samples), spp: u32::from(samples), ..Settings::of(method) };
            let Some(frame) = figures.settled(&settings, Motion::Rotate)? else { return Ok(None) };
            let name = format!("8-{}-{samples}", method.name());
            let _ = write!(whole, " | {}", figures.show(&name, &frame.picture)?);
            let _ = write!(close, " | {}", figures.show(&format!("{name}-close"), &area.cut(&frame.picture, 4))?);
        }
        let (all, part) =
            (figures.show("8-converged", &converged)?, figures.show("8-converged-close", &area.cut(&converged, 4))?);
        let _ = write!(text, "{whole} | {all} |\n{close} | {part} |\n");
    }
    Ok(Some(text))
}

/// Figure 10: what thickens edges, where it is worst in the frame: as in the paper, without a fill, with equal weights, and
/// with Equation 1 beside hidden samples too; by our defaults; and converged.
///
/// # Errors
/// Those of rendering, and of files.
pub fn thickening(figures: &Figures<'_>) -> Result<Option<String>> {
    let ours = Settings::of(Method::Stable);
    let paper = Settings {
        filter_fill: Fill::None,
        filter_weights: Weights::Equal,
        edges: Edges::Paper,
        ..Settings::of(Method::Stable)
    };
    let Some(converged) = figures.converged(Motion::Pan)? else { return Ok(None) };
    let Some(before) = figures.settled(&paper, Motion::Pan)? else { return Ok(None) };
    let Some(after) = figures.settled(&ours, Motion::Pan)? else { return Ok(None) };
    let area = worst_area(&before.picture, &converged, 16);
    let exact = Drawn { picture: converged, samples: Vec::new() };
    let cells = [
        figures.draw("10-before", &before, area)?,
        figures.draw("10-after", &after, area)?,
        figures.draw("10-converged", &exact, area)?,
    ];
    Ok(Some(format!(
        "| as in the paper | fill and Voronoi weights | converged |\n| --- | --- | --- |\n| {} |\n",
        cells.join(" | ")
    )))
}

/// Paper 2's Figure 16: soft shadows at 16 samples a pixel, by strategy and tiling, where the first is worst; with the RMSE of
/// each picture, of display values against a converged one. Two strategies are not the paper's: `sobol` and `random`.
///
/// # Errors
/// Those of rendering, and of files.
pub fn samplers(figures: &Figures<'_>) -> Result<Option<String>> {
    let Some(converged) = figures.converged(Motion::Static)? else { return Ok(None) };
    let mut text = String::from("| | 4x4 tiles | RMSE | sudoku tiles | RMSE |\n| --- | --- | ---: | --- | ---: |\n");
    let mut area = None;
    for sampler in Strategy::ALL {
        let _ = write!(text, "| {}", sampler.name());
        for tiling in Tiling::ALL {
            let settings = Settings { spp: 16, sampler, tiling, ..Settings::of(Method::Supersample) };
            let Some(frame) = figures.settled(&settings, Motion::Static)? else { return Ok(None) };
            let side = (figures.size[0].min(figures.size[1]) / 3).max(1);
            let area = area.get_or_insert_with(|| worst_area(&frame.picture, &converged, side));
            let name = format!("16-{}-{}", sampler.name(), tiling.name());
            let picture = figures.show(&name, &area.cut(&frame.picture, 3))?;
            let _ = write!(text, " | {picture} | {:.5}", display_rmse(&frame.picture, &converged));
        }
        text.push_str(" |\n");
    }
    Ok(Some(text))
}

/// Of display values from 0 to 1.
fn display_rmse(a: &Picture, b: &Picture) -> f64 {
    let squares = a.rgb.iter().zip(&b.rgb).map(|(a, b)| ((f64::from(*a) - f64::from(*b)) / 255.0).powi(2));
    (squares.sum::<f64>() / a.rgb.len().max(1) as f64).sqrt()
}

impl Figures<'_> {
    /// The frame after those in which the cache settles.
    fn settled(&self, settings: &Settings, motion: Motion) -> Result<Option<Drawn>> {
        // What keeps nothing needs no frames before.
        let first = if settings.method.keeps_samples() { 0 } else { SETTLED };
        let frames = (first..=SETTLED).map(|index| (index, index == first));
        self.render(settings.method.name(), settings, motion, frames.collect())
    }

    fn converged(&self, motion: Motion) -> Result<Option<Picture>> {
        let passes = (0..PASSES).map(|pass| (SETTLED, pass == 0));
        let drawn = self.render("converged", &Settings::of(Method::Reference), motion, passes.collect())?;
        Ok(drawn.map(|drawn| drawn.picture))
    }

    /// Renders these frames of a motion one after the other, each as a cut or not; the last is kept.
    fn render(
        &self,
        what: &str,
        settings: &Settings,
        motion: Motion,
        frames: Vec<(u32, bool)>,
    ) -> Result<Option<Drawn>> {
        let mut take = self.studio.take(&Settings { size: self.size, ..settings.clone() }, motion)?;
        self.progress.begin(&format!("figures: {} {what}", self.scene), frames.len() as u64);
        for (index, reset) in frames {
            if (self.stop)() {
                return Ok(None);
            }
            take.render(index, reset)?;
            self.progress.advance(1);
        }
        self.progress.finish();
        Ok(Some(Drawn { picture: picture(&take.picture()?), samples: take.session().samples()? }))
    }

    fn show(&self, name: &str, picture: &Picture) -> Result<String> {
        let file = self.file(name, "png");
        picture.write(&self.folder.join(&file))?;
        Ok(self.link(&file))
    }

    fn draw(&self, name: &str, frame: &Drawn, area: Area) -> Result<String> {
        let file = self.file(name, "svg");
        distribution::write(&self.folder.join(&file), &frame.picture, &frame.samples, area)?;
        Ok(self.link(&file))
    }

    /// Name of a file of the scene's.
    pub(super) fn file(&self, name: &str, ending: &str) -> String {
        format!("{}-{name}.{ending}", self.scene.rsplit(':').next().unwrap_or_default())
    }

    /// What shows a file of the folder.
    pub(super) fn link(&self, file: &str) -> String {
        let folder = self.folder.file_name().unwrap_or_default().to_string_lossy();
        format!("![{file}]({folder}/{file})")
    }
}

/// Of squares of `side` pixels at every half of that, the one where two pictures differ most.
fn worst_area(picture: &Picture, exact: &Picture, side: u32) -> Area {
    let size = [picture.width, picture.height];
    let starts = |length: u32| (0..=length.saturating_sub(side)).step_by((side as usize / 2).max(1));
    let places = starts(size[1]).flat_map(|y| starts(size[0]).map(move |x| [x, y]));
    let areas = places.map(|low| Area { low, size: [side.min(size[0]), side.min(size[1])] });
    let error = |area: &Area| -> i64 {
        let (a, b) = (area.cut(picture, 1), area.cut(exact, 1));
        a.rgb.iter().zip(&b.rgb).map(|(a, b)| (i64::from(*a) - i64::from(*b)).pow(2)).sum()
    };
    areas.max_by_key(error).unwrap_or(Area { low: [0; 2], size })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_of_display_values() {
        let grey = Picture { width: 2, height: 1, rgb: vec![51; 6] };
        let lighter = Picture { rgb: vec![51, 51, 51, 102, 102, 102], ..grey.clone() };
        assert_eq!(display_rmse(&grey, &grey), 0.0);
        assert!((display_rmse(&grey, &lighter) - 0.2 / 2.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn the_worst_area_is_where_pictures_differ() {
        let grey = Picture { width: 32, height: 24, rgb: vec![100; 32 * 24 * 3] };
        let mut other = grey.clone();
        other.rgb[3 * (20 * 32 + 26)] = 120;
        let area = worst_area(&other, &grey, 8);
        assert!(
            (area.low[0]..area.low[0] + 8).contains(&26) && (area.low[1]..area.low[1] + 8).contains(&20),
            "{area:?}"
        );
        assert_eq!(area.size, [8, 8]);
    }
}

//! `stillray samplers`: how well the strategies integrate.

use std::path::PathBuf;

use clap::{ArgAction, Args};
use rayon::prelude::*;
use serde::Serialize;
use stillray::report::table::Table;
use stillray::report::{file, json};
use stillray::sampler::trial::{Measured, Shape, measure};
use stillray::sampler::{DIMENSIONS, Strategy, Tiling};

use super::arguments::counted;
use super::{Outcome, console, interrupt, progress};

/// Measure how well the strategies of sampling integrate: the error of the mean over 4x4 pixels
///
/// What is integrated has closed forms: an edge across all dimensions, and a smooth product, other ones in each trial. Every
/// number is a root mean square over trials, with half the width of its 95 % interval.
#[derive(Debug, Args)]
pub struct Samplers {
    /// Samples a pixel, each from 1 to 4096
    #[arg(long, value_name = "LIST", default_value = "1,4,16,64", value_delimiter = ',', action = ArgAction::Set, value_parser = counted(1, 4096))]
    samples: Vec<u32>,
    /// Dimensions, each from 1 to 16
    #[arg(long, value_name = "LIST", default_value = "2,4,6,9", value_delimiter = ',', action = ArgAction::Set, value_parser = counted(1, DIMENSIONS))]
    dimensions: Vec<u32>,
    /// Trials, from 2 to 1000000
    #[arg(long, value_name = "N", default_value = "400", value_parser = counted(2, 1_000_000))]
    trials: u32,
    /// Write every number to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

#[derive(Debug, Clone, Copy, Serialize)]
struct Row {
    shape: Shape,
    strategy: Strategy,
    tiling: Tiling,
    dimensions: u32,
    samples: u32,
    #[serde(flatten)]
    measured: Measured,
}

impl Samplers {
    /// Measures and prints.
    pub fn run(self) -> Outcome {
        self.json.as_deref().map_or(Ok(()), file::check_target)?;
        interrupt::listen();
        let mut cells = Vec::new();
        for shape in [Shape::Edge, Shape::Smooth] {
            for strategy in Strategy::ALL {
                // Strategies without patterns know no tiling.
                let patterned = !matches!(strategy, Strategy::Sobol | Strategy::Random);
                for tiling in Tiling::ALL.into_iter().filter(|t| patterned || *t == Tiling::Sudoku) {
                    let all = self.dimensions.iter().flat_map(|d| self.samples.iter().map(move |s| (*d, *s)));
                    cells.extend(all.map(|(d, s)| (shape, strategy, tiling, d, s)));
                }
            }
        }
        let row = |(shape, strategy, tiling, dimensions, samples): (Shape, Strategy, Tiling, u32, u32)| {
            let measured = measure(strategy, tiling, shape, dimensions, samples, self.trials);
            Row { shape, strategy, tiling, dimensions, samples, measured }
        };
        let progress = progress::for_user(self.quiet);
        progress.begin("integrating", cells.len() as u64);
        let rows: Vec<Row> = cells.into_par_iter().map(row).inspect(|_| progress.advance(1)).collect();
        progress.finish();
        if let Some(path) = &self.json {
            interrupt::uninterrupted(|| json::write(path, &rows))?;
        }
        console::print(&self.text(&rows))
    }

    fn text(&self, rows: &[Row]) -> String {
        let mut text = String::new();
        for (shape, about) in [(Shape::Edge, "an edge"), (Shape::Smooth, "a smooth product")] {
            for dimensions in &self.dimensions {
                let titles = self.samples.iter().map(|samples| format!("{samples} a pixel"));
                let mut table = Table::new(
                    [format!("{about}, {dimensions} dimensions"), "tiling".to_owned()].into_iter().chain(titles),
                );
                let own: Vec<&Row> = rows.iter().filter(|r| r.shape == shape && r.dimensions == *dimensions).collect();
                for line in own.chunks(self.samples.len()) {
                    let values = line.iter().map(|r| format!("{:.5} ± {:.5}", r.measured.rmse, r.measured.half_width));
                    let names = [line[0].strategy.name(), line[0].tiling.name()].map(str::to_owned);
                    table.row(names.into_iter().chain(values));
                }
                text += &format!("{table}\n");
            }
        }
        text
    }
}

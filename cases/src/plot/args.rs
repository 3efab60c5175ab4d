//! Arguments of `perimelt plot`.

use std::path::PathBuf;

use clap::ValueEnum;
use perimelt_plot::{AXES, Cut};

use crate::argument::finite;
use crate::melt_pool::Travel;

/// What to plot.
#[derive(Clone, Debug, clap::Args)]
pub struct PlotArgs {
    /// log of the run
    pub log: PathBuf,
    /// folder for the pictures [default: the log's name with `-plots`]
    #[arg(long, short)]
    pub out: Option<PathBuf>,
    /// file format of the pictures
    #[arg(long, value_enum, default_value_t)]
    pub format: PictureFormat,
    /// bodies [default: all]
    #[arg(long)]
    pub body: Vec<String>,
    /// fields, or components such as `displacement.x` [default: temperature and displacement]
    #[arg(long)]
    pub field: Vec<String>,
    /// times of the field pictures and of the curves of line probes, s [default: when the field peaks, and the end; of
    /// the temperature also when the source is half way]
    #[arg(long, value_delimiter = ',', allow_negative_numbers = true)]
    pub at: Vec<f64>,
    /// cross-sections of three-dimensional bodies, such as `x=0.05` (m) across a weld along x [default: along and across the
    /// weld, through the hottest point; where nothing is hot, and in films, through that of half way]
    #[arg(long, value_name = "AXIS=POSITION", value_parser = cut)]
    pub section: Vec<Cut>,
    /// plies of laminates, counted from 1 from below, such as `1,3` [default: all of up to four; else the lowest, the middle and the
    /// highest]
    #[arg(long, value_delimiter = ',')]
    pub ply: Vec<usize>,
    /// values at the ends of the colours, such as `300,1500`, in SI units [default: smallest and largest value shown at each
    /// time]
    #[arg(long, value_name = "FROM,TO", allow_hyphen_values = true, value_parser = range)]
    pub range: Option<[f64; 2]>,
    /// temperatures of the lines in field pictures, K; they bound the melt pool where the case has no solidus [default: solidus
    /// and liquidus of the case file, or round numbers while nothing is that hot]
    #[arg(long, value_delimiter = ',', allow_negative_numbers = true, value_parser = finite)]
    pub isotherm: Vec<f64>,
    /// temperatures in degrees Celsius, also those of `--isotherm` and of the `--range` of a temperature
    #[arg(long)]
    pub celsius: bool,
    /// show the body deformed, its displacements this many times as large
    #[arg(long, allow_negative_numbers = true, value_parser = finite)]
    pub deform: Option<f64>,
    /// axis along which the heat source travels, for the length of the melt pool
    #[arg(long, value_enum, default_value_t)]
    pub travel: Travel,
    /// only pictures of these kinds [default: all]
    #[arg(long, value_enum, value_delimiter = ',', conflicts_with = "film")]
    pub only: Vec<PictureKind>,
    /// colours between points instead of one for each
    #[arg(long)]
    pub smooth: bool,
    /// width of the pictures, pixels
    #[arg(long, default_value_t = 1200, value_parser = clap::value_parser!(u32).range(500..=6000))]
    pub width: u32,
    /// pixels per inch: letters and lines have their usual size on paper at this resolution [default: they grow with pictures
    /// that are wider than 1200 pixels]
    #[arg(long, value_parser = clap::value_parser!(u32).range(24..=2400))]
    pub dpi: Option<u32>,
    /// draw only a film of one field of one body over the logged times: a file that ends in `.gif`, `.png` or `.apng`
    #[arg(long, value_name = "FILE", conflicts_with_all = ["out", "format", "at"])]
    pub film: Option<PathBuf>,
    /// most pictures of a film, evenly distributed over the logged times
    #[arg(long, default_value_t = 120, value_parser = clap::value_parser!(u32).range(2..=10_000))]
    pub frames: u32,
    /// pictures of a film in a second
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=50))]
    pub rate: u16,
}

/// File format of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PictureFormat {
    /// pixels
    #[default]
    Png,
    /// lines and letters, for print
    Svg,
}

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PictureKind {
    /// fields of the bodies
    Fields,
    /// sizes of melt pools over time
    MeltPool,
    /// probes
    Probes,
    /// errors of the balances
    Balance,
}

/// The name of a choice on the command line.
pub(super) fn name(choice: &impl ValueEnum) -> String {
    let value = choice.to_possible_value();
    value.map_or_else(String::new, |value| value.get_name().to_owned())
}

/// Reads a section.
fn cut(text: &str) -> Result<Cut, String> {
    let parts = text.split_once('=').and_then(|(axis, at)| {
        let axis = AXES.iter().position(|name| *name == axis.trim())?;
        let at = at.trim().parse().ok().filter(|at: &f64| at.is_finite())?;
        Some(Cut { axis, at })
    });
    parts.ok_or_else(|| {
        format!("`{text}`: expected an axis and a coordinate in m, such as `x=0.05`")
    })
}

/// Reads the values at the ends of the colours.
fn range(text: &str) -> Result<[f64; 2], String> {
    let number = |text: &str| text.trim().parse().ok().filter(|x: &f64| x.is_finite());
    let ends = text
        .split_once(',')
        .and_then(|(from, to)| Some([number(from)?, number(to)?]));
    ends.filter(|[from, to]| from < to)
        .ok_or_else(|| format!("`{text}`: expected two ascending numbers, such as `300,1500`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_and_ranges_are_read_or_explained() {
        let (axis, at) = (1, -0.5e-3);
        assert_eq!(cut("y=-0.5e-3"), Ok(Cut { axis, at }));
        assert_eq!(cut(" z = 2 "), Ok(Cut { axis: 2, at: 2.0 }));
        for wrong in ["x", "x:1", "w=1", "x=one", "x=nan", "=1", ""] {
            let error = cut(wrong).expect_err(wrong);
            assert!(error.contains("such as `x=0.05`"), "{error}");
        }
        assert_eq!(range("-1e8,2e8"), Ok([-1e8, 2e8]));
        for wrong in ["1", "2,1", "1,1", "1,2,3", "nan,1", ","] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
    }
}

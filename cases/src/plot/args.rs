//! Arguments of `perimelt plot`.

use std::path::PathBuf;
use std::str::FromStr;

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
    #[arg(long, value_name = "AXIS=POSITION")]
    pub section: Vec<Cut>,
    /// values at the ends of the colours, such as `300,1500`, in SI units [default: smallest and largest value shown at each
    /// time]
    #[arg(long, value_name = "FROM,TO", allow_hyphen_values = true)]
    pub range: Option<ValueRange>,
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum PictureFormat {
    /// pixels
    #[default]
    Png,
    /// lines and letters, for print
    Svg,
}

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
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

impl PictureKind {
    /// The name on the command line.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Fields => "fields",
            Self::MeltPool => "melt-pool",
            Self::Probes => "probes",
            Self::Balance => "balance",
        }
    }
}

impl PictureFormat {
    pub(super) fn extension(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Svg => "svg",
        }
    }
}

/// A plane on which one coordinate is constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// 0, 1, 2 for x, y, z
    pub axis: usize,
    /// the coordinate, m
    pub at: f64,
}

/// Names of the axes.
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

impl FromStr for Cut {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected =
            || format!("`{text}`: expected an axis and a coordinate in m, such as `x=0.05`");
        let (axis, at) = text.split_once('=').ok_or_else(expected)?;
        let axis = AXES.iter().position(|name| *name == axis.trim());
        let at: Option<f64> = at.trim().parse().ok().filter(|at: &f64| at.is_finite());
        match (axis, at) {
            (Some(axis), Some(at)) => Ok(Cut { axis, at }),
            _ => Err(expected()),
        }
    }
}

/// Smallest and largest value of the colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ValueRange {
    /// smallest value, in the unit of the field
    pub from: f64,
    /// largest value, in the unit of the field
    pub to: f64,
}

impl FromStr for ValueRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || format!("`{text}`: expected two ascending numbers, such as `300,1500`");
        let (from, to) = text.split_once(',').ok_or_else(expected)?;
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
        match (number(from), number(to)) {
            (Some(from), Some(to)) if from < to => Ok(ValueRange { from, to }),
            _ => Err(expected()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_and_ranges_are_read_or_explained() {
        assert_eq!(
            "y=-0.5e-3".parse(),
            Ok(Cut {
                axis: 1,
                at: -0.5e-3
            })
        );
        assert_eq!(" z = 2 ".parse(), Ok(Cut { axis: 2, at: 2.0 }));
        for wrong in ["x", "x:1", "w=1", "x=one", "x=nan", "=1", ""] {
            let error = wrong.parse::<Cut>().expect_err(wrong);
            assert!(error.contains("such as `x=0.05`"), "{error}");
        }
        let range = ValueRange {
            from: -1e8,
            to: 2e8,
        };
        assert_eq!("-1e8,2e8".parse(), Ok(range));
        for wrong in ["1", "2,1", "1,1", "1,2,3", "nan,1", ","] {
            assert!(wrong.parse::<ValueRange>().is_err(), "{wrong}");
        }
    }
}

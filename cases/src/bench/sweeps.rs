//! Sweeps over the bonds of a block, beside sweeps that only do what limits them.

use std::error::Error;
use std::io::Write;

use perimelt_core::body::{BodyError, Jitter, Store};
use perimelt_core::shape::{BoxShape, Shape};
use perimelt_core::{Body, Bond, BondKernel, Correction, Face, Family, FamilySpec};

use super::shortest;

/// Points along an edge of the block.
const EDGE: usize = 48;

/// Horizon over spacing: 122 bonds.
pub(super) const HORIZON: f64 = 3.015;

/// Sweeps of which the fastest counts.
const ROUNDS: usize = 15;

/// The points of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Points {
    /// On a lattice behind mirrored layers: all families are complete.
    Complete,
    /// On a lattice with bare faces, near which each point has weights of its own.
    Bare,
    /// Displaced at random.
    Cloud,
}

impl Points {
    const ALL: [Points; 3] = [Points::Complete, Points::Bare, Points::Cloud];

    fn name(self) -> &'static str {
        match self {
            Points::Complete => "lattice, complete families",
            Points::Bare => "lattice, bare faces",
            Points::Cloud => "cloud",
        }
    }

    /// A block with so many points along each edge, of unit spacing.
    pub(super) fn block(self, edge: usize) -> Result<Body, BodyError> {
        let shape = Shape::Box(BoxShape {
            min: [0.0; 3],
            max: [edge as f64; 3],
        });
        let mut body = Body::fill("block", &shape, 3, 1.0, 1.0)?;
        if self == Points::Cloud {
            return body.jittered(Jitter {
                amplitude: 0.2,
                seed: 1,
            });
        }
        body.store = Store::Lattice;
        Ok(body)
    }

    /// The family of each point of a block.
    pub(super) fn family(self, block: &Body) -> Result<Family, Box<dyn Error>> {
        let (correction, layers) = match self {
            Points::Bare => (Correction::Point, Vec::new()),
            Points::Complete | Points::Cloud => (Correction::Lattice, Face::ALL.to_vec()),
        };
        let spec = FamilySpec {
            correction,
            layers,
            ..FamilySpec::new(HORIZON)
        };
        Ok(Family::build(block, &spec)?)
    }
}

/// Heat flow.
pub(super) struct Heat;

impl BondKernel<1, 1> for Heat {
    #[inline(always)]
    fn bond(&self, bond: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [bond.mean() * bond.inverse_length * (other - own)]
    }
}

/// Bond force at finite displacements, evaluated once for both ends.
pub(super) struct Force;

impl BondKernel<3, 3> for Force {
    const PAIRED: usize = 3;

    #[inline(always)]
    fn bond(&self, bond: &Bond, own: [f64; 3], other: [f64; 3]) -> [f64; 3] {
        let mut y = [0.0; 3];
        for (axis, y) in y.iter_mut().enumerate() {
            *y = bond.xi[axis] + other[axis] - own[axis];
        }
        let length = (y[0] * y[0] + y[1] * y[1] + y[2] * y[2]).sqrt();
        let force = bond.mean() * (bond.inverse_length - 1.0 / length);
        y.map(|y| force * y)
    }
}

/// Loads the value of the neighbour, and adds it.
struct Load;

impl BondKernel<1, 1> for Load {
    #[inline(always)]
    fn bond(&self, _: &Bond, _: [f64; 1], other: [f64; 1]) -> [f64; 1] {
        other
    }
}

/// A square root and a division, once for both ends.
struct Root;

impl BondKernel<1, 1> for Root {
    const PAIRED: usize = 1;

    #[inline(always)]
    fn bond(&self, _: &Bond, [own]: [f64; 1], [other]: [f64; 1]) -> [f64; 1] {
        [1.0 / (1.5 + other - own).sqrt()]
    }
}

/// A sweep that is timed.
pub(super) struct Timed<'a> {
    family: &'a Family,
    points: usize,
    fields: [Vec<f64>; 3],
}

impl<'a> Timed<'a> {
    pub(super) fn new(family: &'a Family, points: usize) -> Self {
        let value = |slot: usize, field: usize| ((slot * (field + 7)) as f64).sin() * 1e-3;
        let slots = family.slots();
        let field = |field| (0..slots).map(|slot| value(slot, field)).collect();
        Timed {
            family,
            points,
            fields: [0, 1, 2].map(field),
        }
    }

    /// Time of a sweep, s.
    pub(super) fn seconds<const I: usize, const O: usize>(
        &self,
        kernel: &impl BondKernel<I, O>,
    ) -> f64 {
        let mut inputs = [&self.fields[0][..]; I];
        for (input, field) in inputs.iter_mut().zip(&self.fields) {
            *input = field;
        }
        let mut sums = vec![[0.0; O]; self.points];
        shortest(ROUNDS, || self.family.sum(kernel, inputs, &mut sums))
    }

    /// Directed bonds per second.
    fn rate<const I: usize, const O: usize>(&self, kernel: &impl BondKernel<I, O>) -> f64 {
        self.family.bonds() as f64 / self.seconds(kernel)
    }
}

/// A kernel on some points, with its speed by number of threads and what limits it on one thread.
struct Row {
    kernel: &'static str,
    points: Points,
    /// Million directed bonds per second.
    rates: Vec<f64>,
    bound: f64,
    limit: &'static str,
}

pub(super) fn write(threads: &[usize], out: &mut impl Write) -> Result<(), Box<dyn Error>> {
    let pool = |count: &usize| rayon::ThreadPoolBuilder::new().num_threads(*count).build();
    let pools = threads.iter().map(pool).collect::<Result<Vec<_>, _>>()?;
    let single = pool(&1)?;
    let mut rows = Vec::new();
    let mut set_up = Vec::new();
    for points in Points::ALL {
        let block = points.block(EDGE)?;
        let count = block.points.len();
        let build = || points.family(&block).map_err(|error| error.to_string());
        let family = build()?;
        let seconds = single.install(|| shortest(3, || drop(build())));
        set_up.push((points, seconds / count as f64));
        let timed = Timed::new(&family, count);
        let million = |rate: f64| rate / 1e6;
        let rates = |rate: &(dyn Fn() -> f64 + Sync)| {
            let rates = pools.iter().map(|pool| million(pool.install(rate)));
            rates.collect::<Vec<f64>>()
        };
        let [load, root] = single.install(|| [timed.rate(&Load), timed.rate(&Root)].map(million));
        rows.push(Row {
            kernel: "heat",
            points,
            rates: rates(&|| timed.rate(&Heat)),
            bound: load,
            limit: "loads",
        });
        // three values of the neighbour are loaded
        let (bound, limit) = match root < load / 3.0 {
            true => (root, "square root and division"),
            false => (load / 3.0, "loads"),
        };
        rows.push(Row {
            kernel: "force",
            points,
            rates: rates(&|| timed.rate(&Force)),
            bound,
            limit,
        });
    }
    writeln!(
        out,
        "Block of {EDGE}^3 points, horizon {HORIZON} spacings, f64; million directed bonds per second, best of {ROUNDS} sweeps. `heat` reads one value of the\n\
         neighbour, `force` three, with a square root and a division; on lattices it visits a bond once for both ends. The bound is the speed, on one thread, of a\n\
         sweep over the same bonds that only loads and adds values, or only computes square roots and divisions: what a machine without any other cost would reach.\n"
    )?;
    let columns: String = (threads.iter())
        .map(|count| match count {
            1 => " 1 thread |".into(),
            count => format!(" {count} threads |"),
        })
        .collect();
    writeln!(
        out,
        "| kernel | points |{columns} bound | limited by | reached on 1 thread |"
    )?;
    writeln!(out, "|---|---|{}---|---|---|", "---|".repeat(threads.len()))?;
    for row in &rows {
        let rates: String = row
            .rates
            .iter()
            .map(|rate| format!(" {rate:.0} |"))
            .collect();
        let reached = threads.iter().position(|count| *count == 1);
        let reached = reached.map_or("".into(), |at| format!("{:.2}", row.rates[at] / row.bound));
        writeln!(
            out,
            "| {} | {} |{rates} {:.0} | {} | {reached} |",
            row.kernel,
            row.points.name(),
            row.bound,
            row.limit
        )?;
    }
    writeln!(
        out,
        "\nFamilies of the block, one thread:\n\n| points | set-up, us a point |\n|---|---|"
    )?;
    for (points, seconds) in set_up {
        writeln!(out, "| {} | {:.2} |", points.name(), seconds * 1e6)?;
    }
    Ok(())
}

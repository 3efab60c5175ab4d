//! Estimated speed of many processes, from times that two or more have measured.

use std::error::Error;
use std::io::Write;

use super::messages::Measured;
use crate::verify::results::machine;

/// Numbers of processes of the table.
const PROCESSES: [usize; 6] = [2, 8, 32, 64, 256, 1024];

/// Points of each process.
const POINTS: [f64; 2] = [1e5, 1e6];

/// A step, as the model sees it.
struct StepKind {
    name: &'static str,
    /// Time of a sweep per point over that of a whole step, from profiles.
    share_of_sweep: f64,
    /// Cells from which values are needed.
    reach: f64,
    /// Numbers per point.
    components: f64,
    /// Whether bonds across a cut are evaluated by both processes and those within once.
    is_paired: bool,
}

const HEAT: StepKind = StepKind {
    name: "heat, horizon 3",
    share_of_sweep: 0.75,
    reach: 3.0,
    components: 1.0,
    is_paired: false,
};

const SOLID: StepKind = StepKind {
    name: "bond-based solid",
    share_of_sweep: 0.75,
    reach: 3.0,
    components: 3.0,
    is_paired: true,
};

impl StepKind {
    /// Time of a step of one process without messages over that with those of so many processes.
    fn efficiency(&self, measured: &Measured, sweep: f64, processes: usize, points: f64) -> f64 {
        let edge = points.cbrt();
        let sides = sides(processes);
        let widened: f64 = sides
            .iter()
            .map(|sides| edge + self.reach * sides)
            .product();
        let ghosts = widened - points;
        let neighbours: f64 = sides.iter().map(|sides| 1.0 + sides).product::<f64>() - 1.0;
        let sweep_of_step = sweep * points;
        let work = sweep_of_step / self.share_of_sweep;
        // half of the bonds across a cut would otherwise be those of the neighbour
        let twice = match self.is_paired {
            true => 0.5 * 0.5 * ghosts / points * sweep_of_step,
            false => 0.0,
        };
        let exchange =
            neighbours * measured.latency + ghosts * self.components / measured.bandwidth;
        // times of reductions grow with the depth of a tree
        let depth = (processes as f64).log2() / (measured.processes as f64).log2();
        let reductions = (measured.sum + measured.max) * depth;
        work / (work + twice + exchange + reductions)
    }
}

/// Cut sides of an inner part along each axis, where boxes are halved along one axis after the other.
fn sides(processes: usize) -> [f64; 3] {
    let halvings = (processes as f64).log2().round() as usize;
    [0, 1, 2].map(|axis| {
        let along = halvings / 3 + usize::from(axis < halvings % 3);
        along.min(2) as f64
    })
}

pub(super) fn write(measured: &Measured, out: &mut impl Write) -> Result<(), Box<dyn Error>> {
    let Measured {
        processes,
        latency,
        bandwidth,
        sum,
        max,
        heat,
        force,
    } = *measured;
    writeln!(
        out,
        "# Many processes\n\nWritten by `perimelt bench --mpi`, started as {processes} processes. Machine of the first one: {}.\n\n\
         | measured, all processes at work, the slowest | |\n|---|---|\n\
         | short message both ways, each with one other process | {:.2} us |\n\
         | long message (1 MiB), each way | {:.2} GB/s |\n\
         | exact sum of one number (68 integers) | {:.2} us |\n\
         | maximum of one number | {:.2} us |\n\
         | sweep of heat over a bare block of 64^3 points, one thread | {:.1} ns a point |\n\
         | sweep of bond forces | {:.1} ns a point |\n",
        machine(),
        latency * 1e6,
        bandwidth * 8e-9,
        sum * 1e6,
        max * 1e6,
        heat * 1e9,
        force * 1e9
    )?;
    writeln!(
        out,
        "Weak scaling: speed of each process over that of one alone, if each has the same number of points. Estimated with these constants by\n\n\
         - parts that are cubes, halved along one axis after the other; with 64 processes or more the slowest has neighbours on all sides, 26 of them;\n\
         - one exchange a step of all values within three cells of a cut (three numbers a point for solids), messages one after the other, no overlap with work;\n\
         - one exact sum and one maximum a step, times the depth of a tree of processes over the measured one;\n\
         - sweeps that take three quarters of a step; bonds across a cut of a solid are evaluated by both processes;\n\
         - latency and bandwidth as measured: on one machine those of its memory. Started over two machines with all of their cores, each process exchanges through\n  \
           the network, and the table holds for a network of that speed.\n"
    )?;
    let header: String = PROCESSES
        .iter()
        .map(|count| format!(" {count} |"))
        .collect();
    writeln!(out, "| step | points of a process |{header}")?;
    writeln!(out, "|---|---|{}", "---|".repeat(PROCESSES.len()))?;
    for (kind, sweep) in [(&HEAT, heat), (&SOLID, force)] {
        for points in POINTS {
            let row: String = (PROCESSES.iter())
                .map(|count| {
                    let efficiency = kind.efficiency(measured, sweep, *count, points);
                    format!(" {efficiency:.2} |")
                })
                .collect();
            writeln!(out, "| {} | {points:.0e} |{row}", kind.name)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAST: Measured = Measured {
        processes: 2,
        latency: 0.0,
        bandwidth: f64::INFINITY,
        sum: 0.0,
        max: 0.0,
        heat: 1e-7,
        force: 1e-7,
    };

    #[test]
    fn inner_parts_have_neighbours_on_all_sides() {
        assert_eq!(sides(1), [0.0; 3]);
        assert_eq!(sides(2), [1.0, 0.0, 0.0]);
        assert_eq!(sides(8), [1.0; 3]);
        assert_eq!(sides(64), [2.0; 3]);
        assert_eq!(sides(1024), [2.0; 3]);
    }

    /// Heat without the costs of messages scales perfectly; a message that takes as long as the step halves the speed.
    #[test]
    fn messages_cost_their_time() {
        assert_eq!(HEAT.efficiency(&FAST, 1e-7, 1024, 1e6), 1.0);
        let latency = 1e-7 * 1e6 / HEAT.share_of_sweep;
        let slow = Measured { latency, ..FAST };
        assert!((HEAT.efficiency(&slow, 1e-7, 2, 1e6) - 0.5).abs() < 1e-12);
        assert!((HEAT.efficiency(&slow, 1e-7, 64, 1e6) - 1.0 / 27.0).abs() < 1e-12);
        // two planes of 100 x 100 x 3 points more on the six faces of a cube, less on edges: by hand for one cut
        let bandwidth = 3e4 / latency;
        let narrow = Measured { bandwidth, ..FAST };
        assert!((HEAT.efficiency(&narrow, 1e-7, 2, 1e6) - 0.5).abs() < 1e-12);
    }
}

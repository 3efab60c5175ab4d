//! Estimated size of a log.

use std::path::Path;

use perimelt_core::Simulation;
use perimelt_core::field::FieldIndex;
use perimelt_core::log::Precision;
use perimelt_core::simulation::ByteCount;

use super::Failure;
use super::record::logged_fields;
use crate::case::Case;
use crate::unit::bytes;

/// Sizes before compression, in bytes: those of the log are smaller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogSize {
    /// Number of logged states.
    pub states: f64,
    /// Size of a state.
    pub state: usize,
    /// Number of checkpoints.
    pub checkpoints: f64,
    /// Size of a checkpoint.
    pub checkpoint: usize,
}

impl LogSize {
    /// Size of the log of a case from the present state on.
    ///
    /// # Errors
    /// The state cannot be saved, or a mistake in a probe.
    pub fn new(case: &Case, simulation: &Simulation) -> Result<LogSize, Failure> {
        let world = simulation.observed();
        let width = match case.log.precision {
            Precision::F32 => 4,
            Precision::F64 => 8,
        };
        let fields = logged_fields(case, simulation);
        let bodies = world.bodies().iter().zip(&fields).map(|(body, fields)| {
            let components = |f: &FieldIndex| world.fields().field(*f).data().components();
            // positions, and the spacings of points that are not on a lattice
            let others = 3 + usize::from(body.lattice().is_none());
            let numbers = others + fields.iter().map(components).sum::<usize>();
            width * numbers * body.points.len()
        });
        let mut checkpoint = ByteCount(0);
        simulation.save_to(&mut checkpoint)?;
        let probes = case.build_probes(simulation)?;
        let columns: usize = probes.iter().map(|p| p.columns.len()).sum();
        let options = simulation.options();
        let left = options.end - simulation.time();
        let checkpoints = (left / case.checkpoint_interval() - 1e-9).ceil() + 1.0;
        let states = options.log.left(simulation.time(), options.end) + 1;
        Ok(LogSize {
            states: states as f64,
            // digits of a number as text, and its name
            state: bodies.sum::<usize>() + 40 * columns,
            // they are written with states
            checkpoints: checkpoints.min(states as f64),
            checkpoint: checkpoint.0,
        })
    }

    /// Size of the whole log.
    pub fn total(&self) -> f64 {
        self.states * self.state as f64 + self.checkpoints * self.checkpoint as f64
    }

    /// Warning about a log that may not fit into the folder of `log`; `None` where the free space is unknown.
    pub fn warning(&self, log: &Path) -> Option<String> {
        let folder = match log.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        self.beyond(fs4::available_space(folder).ok()?, folder)
    }

    fn beyond(&self, free: u64, folder: &Path) -> Option<String> {
        (self.total() > free as f64).then(|| {
            format!(
                "the log may need up to {} before compression, but {} has {} of free space; longer intervals or fewer \
                 fields in `[log]` make it smaller",
                bytes(self.total()),
                folder.display(),
                bytes(free as f64)
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_that_exceeds_the_free_space_is_told() {
        let size = LogSize {
            states: 100.0,
            state: 20_000_000,
            checkpoints: 10.0,
            checkpoint: 50_000_000,
        };
        let folder = Path::new("runs");
        assert_eq!(size.beyond(2_500_000_001, folder), None);
        let told = size.beyond(2_400_000_000, folder).expect("too large");
        assert!(
            told.contains("2.50 GB") && told.contains("runs has 2.40 GB"),
            "{told}"
        );
        // the temporary folder has more than some bytes, and less than this
        let log = std::env::temp_dir().join("a.mcap");
        let small = LogSize {
            state: 1,
            checkpoint: 1,
            ..size
        };
        assert_eq!(small.warning(&log), None);
        let large = LogSize {
            states: 1e30,
            ..size
        };
        assert!(large.warning(&log).is_some());
        assert!(large.warning(Path::new("b.mcap")).is_some());
    }
}

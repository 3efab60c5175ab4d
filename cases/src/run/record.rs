//! Contents of the log of a run, and times at which they are written.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use perimelt_core::body::Ply;
use perimelt_core::field::{FieldIndex, keys};
use perimelt_core::log::{
    BodyInfo, CloudView, Column, Coordinates, Entry, FieldInfo, FieldView, LatticeInfo, LogError,
    PlyInfo, Precision, Progress, RunInfo, Series, Writer,
};
use perimelt_core::simulation::Progress as Counters;
use perimelt_core::world::activity::is_active;
use perimelt_core::{Balance, Body, Report, Simulation, World};

use super::{Failure, inputs};
use crate::case::Case;
use crate::log_names::{PLY, RELATIVE_ERROR, REPORTS, SPACING};
use crate::melt_pool::sources_of;
use crate::probe::Probe;

/// Fields that are logged only if the case lists them, because others contain the same information; clouds consist of
/// active points.
const NOT_BY_DEFAULT: [&str; 3] = ["enthalpy", "active", "birth_temperature"];

/// Writes states, probes, balances, progress and checkpoints.
pub struct Recorder {
    /// `None` in all but the first of several processes, which contribute to what it writes.
    writer: Option<Writer>,
    precision: Precision,
    /// Fields in the point cloud of each body.
    fields: Vec<Vec<FieldIndex>>,
    probes: Vec<Probe>,
    /// Counters at the last progress message.
    counted: Counters,
    checkpoint_interval: f64,
    next_checkpoint: f64,
    /// Whether relative errors of the balances are logged; the columns of a resumed log stay as they are.
    with_relative_errors: bool,
    started: Instant,
    wall_before: f64,
}

impl Recorder {
    /// A recorder for `simulation`; `wall_before` is the wall time that the run took already, s.
    pub fn new(
        case: &Case,
        simulation: &Simulation,
        writer: Option<Writer>,
        wall_before: f64,
    ) -> Result<Recorder, Failure> {
        let mut recorder = Recorder {
            precision: case.log.precision,
            fields: logged_fields(case, simulation),
            probes: match &writer {
                Some(_) => case.build_probes(simulation)?,
                None => Vec::new(),
            },
            writer,
            counted: simulation.progress().clone(),
            checkpoint_interval: case.checkpoint_interval(),
            next_checkpoint: 0.0,
            with_relative_errors: true,
            started: Instant::now(),
            wall_before,
        };
        recorder.plan_checkpoint(simulation.time());
        Ok(recorder)
    }

    /// Logs the state, probes, balances and progress, and flushes them.
    pub fn record(&mut self, simulation: &Simulation) -> Result<(), Failure> {
        // which all processes sum up
        let reports = simulation.reports();
        let balances = simulation.balances();
        if self.writer.is_none() {
            return Ok(());
        }
        let time = simulation.time();
        for body in 0..self.fields.len() {
            self.record_points(simulation, body)?;
        }
        let sources = sources_of(simulation);
        for probe in &self.probes {
            let values = probe.measure(simulation.observed(), &sources);
            let columns = probe.columns.iter().zip(values);
            let row: Vec<_> = columns
                .map(|((name, unit), value)| Entry::new(name, unit, value))
                .collect();
            write(&mut self.writer, |writer| {
                writer.probe(&probe.name, time, &row)
            })?;
        }
        self.record_reports(time, reports)?;
        self.record_balance(time, balances)?;
        self.record_progress(simulation)?;
        write(&mut self.writer, Writer::flush)
    }

    /// Keeps the columns of a log that already has balances.
    pub fn continuing(mut self, balance: &Series) -> Recorder {
        let has = |c: &Column| c.name.ends_with(RELATIVE_ERROR);
        self.with_relative_errors = balance.columns.is_empty() || balance.columns.iter().any(has);
        self
    }

    fn record_points(&mut self, simulation: &Simulation, body: usize) -> Result<(), Failure> {
        let world = simulation.observed();
        let points = world.body(body);
        let data: Vec<_> = self.fields[body]
            .iter()
            .map(|&f| {
                (
                    world.fields().field(f).name.as_str(),
                    world.fields().field(f).data(),
                )
            })
            .collect();
        // points without material are left out
        let there = PresentPoints::of(world, body);
        let place = world.place_of_points(body);
        let at = |row: usize| place(there.point(row)).into();
        let values: Vec<Cow<'_, [f64]>> = data
            .iter()
            .map(|(_, data)| there.rows(data.flat(), data.components()))
            .collect();
        let mut fields: Vec<FieldView> = data
            .iter()
            .zip(&values)
            .map(|((name, data), values)| FieldView {
                name,
                components: data.components(),
                values,
            })
            .collect();
        if points.lattice().is_none() {
            fields.push(FieldView {
                name: SPACING,
                components: 1,
                values: &points.points.spacing,
            });
        }
        let plies: Option<Vec<f64>> = points.layers().map(|layers| {
            let points = 0..points.points.len();
            let ply = |point: usize| layers.layers()[layers.place(point).0].ply;
            points.map(|point| 1.0 + ply(point) as f64).collect()
        });
        if let Some(plies) = &plies {
            fields.push(FieldView {
                name: PLY,
                components: 1,
                values: plies,
            });
        }
        let cloud = CloudView {
            time: simulation.time(),
            positions: Coordinates::Computed(there.count(points), &at),
            fields: &fields,
        };
        write(&mut self.writer, |writer| {
            writer.points(&points.name, self.precision, &cloud)
        })
    }

    fn record_reports(
        &mut self,
        time: f64,
        reports: Vec<(&str, Vec<Report>)>,
    ) -> Result<(), Failure> {
        let mut columns = Vec::new();
        for (label, reports) in reports {
            columns.extend(reports.into_iter().map(|report| Report {
                name: format!("{label}.{}", report.name),
                ..report
            }));
        }
        if columns.is_empty() {
            return Ok(());
        }
        write(&mut self.writer, |writer| {
            writer.probe(REPORTS, time, &row(&columns))
        })
    }

    fn record_balance(
        &mut self,
        time: f64,
        balances: Vec<(&str, Vec<Balance>)>,
    ) -> Result<(), Failure> {
        let mut columns = Vec::new();
        for (label, balances) in balances {
            for b in balances {
                let error = b.error();
                let parts = [
                    ("stored", b.stored),
                    ("initial", b.initial),
                    ("supplied", b.supplied),
                    ("error", error),
                ];
                let deposited = b.deposited.map(|value| ("deposited", value));
                for (part, value) in parts.into_iter().chain(deposited) {
                    let name = format!("{label}.{}.{part}", b.quantity);
                    columns.push(Report::new(name, &b.unit, value));
                }
                if self.with_relative_errors {
                    let name = format!("{label}.{}{RELATIVE_ERROR}", b.quantity);
                    columns.push(Report::new(name, "1", b.relative_error()));
                }
            }
        }
        if columns.is_empty() {
            return Ok(());
        }
        write(&mut self.writer, |writer| {
            writer.balance(time, &row(&columns))
        })
    }

    fn record_progress(&mut self, simulation: &Simulation) -> Result<(), Failure> {
        let now = simulation.progress();
        let by_label = |new: &[u64], old: &[u64]| -> BTreeMap<String, u64> {
            let labels = simulation.physics_labels();
            labels
                .zip(new.iter().zip(old))
                .map(|(l, (n, o))| (l.to_string(), n - o))
                .collect()
        };
        let progress = Progress {
            time: simulation.time(),
            step: now.macro_steps,
            step_size: now.last_step,
            sub_steps: by_label(&now.sub_steps, &self.counted.sub_steps),
            iterations: by_label(&now.iterations, &self.counted.iterations),
            evaluations: by_label(&now.evaluations, &self.counted.evaluations),
            coupling_passes: now.passes - self.counted.passes,
            wall_seconds: self.wall_before + self.started.elapsed().as_secs_f64(),
        };
        self.counted = now.clone();
        write(&mut self.writer, |writer| writer.progress(&progress))
    }

    /// Whether a checkpoint is due.
    pub fn is_checkpoint_due(&self, simulation: &Simulation) -> bool {
        simulation.time() >= self.next_checkpoint
    }

    /// Logs all data needed to resume.
    pub fn checkpoint(&mut self, simulation: &Simulation) -> Result<(), Failure> {
        let step = simulation.progress().macro_steps;
        let save = |out: &mut dyn Write| -> Result<(), Failure> { Ok(simulation.save_to(out)?) };
        match &mut self.writer {
            Some(writer) => writer.checkpoint(simulation.time(), step, save)?,
            None => save(&mut std::io::sink())?,
        }
        write(&mut self.writer, Writer::flush)?;
        self.plan_checkpoint(simulation.time());
        Ok(())
    }

    fn plan_checkpoint(&mut self, time: f64) {
        // a thousandth covers rounding of log times that should coincide with the cadence
        let done = (time / self.checkpoint_interval + 1e-3).floor();
        self.next_checkpoint = (done + 1.0 - 1e-3) * self.checkpoint_interval;
    }

    /// To be called when the file of the log has its name.
    pub fn placed(&mut self) {
        if let Some(writer) = &mut self.writer {
            writer.placed();
        }
    }

    /// Closes the log.
    pub fn finish(self) -> Result<(), Failure> {
        Ok(self.writer.map_or(Ok(()), Writer::finish)?)
    }
}

/// Writes in the process that has the log.
fn write(
    writer: &mut Option<Writer>,
    what: impl FnOnce(&mut Writer) -> Result<(), LogError>,
) -> Result<(), Failure> {
    Ok(writer.as_mut().map_or(Ok(()), what)?)
}

fn row(columns: &[Report]) -> Vec<Entry<'_>> {
    let columns = columns.iter();
    columns
        .map(|c| Entry::new(&c.name, &c.unit, c.value))
        .collect()
}

/// Fields in the point cloud of each body. The displacement of a body whose points get or lose material is always one of
/// them: the reference positions of the points in a state follow from it.
pub fn logged_fields(case: &Case, simulation: &Simulation) -> Vec<Vec<FieldIndex>> {
    let chosen = |body: usize| {
        let changes = simulation.observed().activity(body).is_some();
        let wanted = |name: &str| match &case.log.fields {
            Some(fields) => {
                fields.iter().any(|f| f == name) || (changes && name == keys::DISPLACEMENT.name)
            }
            None => !NOT_BY_DEFAULT.contains(&name),
        };
        let fields = simulation
            .lasting()
            .filter(|f| f.body == body && wanted(&f.name));
        let index =
            |f: &perimelt_core::field::Field| simulation.observed().fields().find(body, &f.name);
        fields.filter_map(index).collect()
    };
    (0..simulation.observed().bodies().len())
        .map(chosen)
        .collect()
}

/// Points of a body that have material; `None` where all have.
struct PresentPoints(Option<Vec<usize>>);

impl PresentPoints {
    fn of(world: &World, body: usize) -> PresentPoints {
        let there = world.activity(body).map(|activity| {
            let points = activity.iter().enumerate();
            let points = points.filter(|(_, a)| is_active(**a));
            points.map(|(point, _)| point).collect::<Vec<_>>()
        });
        PresentPoints(there.filter(|t| t.len() < world.body(body).points.len()))
    }

    /// Number of these points.
    fn count(&self, body: &Body) -> usize {
        self.0.as_ref().map_or(body.points.len(), Vec::len)
    }

    /// The point of a row.
    fn point(&self, row: usize) -> usize {
        self.0.as_ref().map_or(row, |points| points[row])
    }

    /// The values of these points, `width` for each.
    fn rows<'a>(&self, values: &'a [f64], width: usize) -> Cow<'a, [f64]> {
        let Some(points) = &self.0 else {
            return Cow::Borrowed(values);
        };
        let rows = points.iter().map(|p| &values[p * width..][..width]);
        rows.flatten().copied().collect()
    }
}

fn lattice_info(body: &Body) -> Option<LatticeInfo> {
    let lattice = body.lattice()?;
    let (cell, place) = (lattice.cell(0), body.points.position.at(0));
    Some(LatticeInfo {
        origin: [0, 1, 2].map(|a| place[a] - f64::from(cell[a]) * lattice.spacing),
        spacing: lattice.spacing,
        cells: lattice.cells,
    })
}

fn ply_info(ply: &Ply) -> PlyInfo {
    PlyInfo {
        angle: ply.angle.to_degrees(),
        middle: ply.low + 0.5 * ply.thickness,
    }
}

/// A number of each point that no plugin owns.
fn field_of_points(name: &str, unit: &str) -> FieldInfo {
    FieldInfo {
        name: name.into(),
        unit: unit.into(),
        components: 1,
    }
}

/// Constant data of a run.
pub fn run_info(case: &Case, simulation: &Simulation) -> RunInfo {
    let body = |(index, body): (usize, &perimelt_core::Body)| BodyInfo {
        name: body.name.clone(),
        dimension: body.dimension,
        spacing: body.finest_spacing(),
        thickness: body.thickness,
        points: body.points.len(),
        symmetry: simulation.observed().symmetry(index).to_vec(),
        lattice: lattice_info(body),
        plies: (body.layers().into_iter())
            .flat_map(|layers| layers.plies().iter().map(ply_info))
            .collect(),
        fields: simulation
            .lasting()
            .filter(|f| f.body == index)
            .map(|f| FieldInfo {
                name: f.name.clone(),
                unit: f.unit.clone(),
                components: f.data().components(),
            })
            .chain((body.lattice().is_none()).then(|| field_of_points(SPACING, "m")))
            .chain(body.layers().map(|_| field_of_points(PLY, "1")))
            .collect(),
    };
    let folder = case.folder.as_path();
    let here = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    RunInfo {
        version: env!("CARGO_PKG_VERSION").into(),
        threads: rayon::current_num_threads(),
        started: SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |d| d.as_secs()),
        case_folder: std::path::absolute(here)
            .unwrap_or_else(|_| here.into())
            .display()
            .to_string(),
        inputs: inputs::of(case),
        bodies: simulation
            .observed()
            .bodies()
            .iter()
            .enumerate()
            .map(body)
            .collect(),
        plugins: simulation.composition(),
    }
}

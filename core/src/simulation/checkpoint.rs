//! Checkpoints: everything needed to go on bit by bit; and the copies that repeated passes start from.

use std::cell::Ref;
use std::io;

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize, Serializer};
use serde_bytes::ByteBuf;

use super::{ClockState, Ready, Simulation};
use crate::error::RunError;
use crate::field::{Data, FieldIndex};
use crate::plugin::{RunningCoupler, RunningPhysics};
use crate::stepping::{Step, Update};

/// Values of the fields of the state of a physics, and its packed internal state.
pub(super) type SavedPhysics = (Vec<Vec<f64>>, Vec<u8>);

/// Version of the layout of checkpoints, those of plugins included.
const FORMAT: u32 = 13;

/// A field with its values as bytes, little-endian.
#[derive(Serialize, Deserialize)]
struct SavedField<V> {
    body: usize,
    name: String,
    values: V,
}

/// What is saved, with the values of fields and the states of plugins as bytes. [`Simulation::save_to`] writes it part by part.
#[derive(Deserialize)]
struct Checkpoint {
    clock: ClockState,
    fields: Vec<SavedField<ByteBuf>>,
    physics: Vec<ByteBuf>,
    couplers: Vec<ByteBuf>,
    /// Where the rows of moving families were found, m.
    rows_found_at: Vec<Vec<nalgebra::Vector3<f64>>>,
}

/// The values of a field, to be written from where they are, or collected from several processes.
enum FieldValues<'a> {
    Here(Ref<'a, Data>),
    Collected(Vec<f64>),
}

impl Serialize for FieldValues<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let values = match self {
            FieldValues::Here(data) => data.flat(),
            FieldValues::Collected(values) => values,
        };
        if cfg!(target_endian = "little") {
            return serializer.serialize_bytes(bytemuck::cast_slice(values));
        }
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        serializer.serialize_bytes(&bytes)
    }
}

/// The number of bytes that were written to it, which it does not keep.
#[derive(Debug)]
pub struct ByteCount(pub usize);

impl io::Write for ByteCount {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes the state of a plugin as bytes. It is packed twice, the first time for the number of bytes, so that it does not stand in memory.
fn write_state(
    mut out: &mut dyn io::Write,
    state: &dyn erased_serde::Serialize,
) -> Result<(), RunError> {
    let mut count = ByteCount(0);
    pack_to(&mut count, state)?;
    let bytes = u32::try_from(count.0).map_err(not_written)?;
    rmp::encode::write_bin_len(&mut out, bytes).map_err(not_written)?;
    pack_to(out, state)
}

fn write_array_len(mut out: &mut dyn io::Write, len: usize) -> Result<(), RunError> {
    rmp::encode::write_array_len(&mut out, len as u32).map_err(not_written)?;
    Ok(())
}

fn not_written(error: impl std::fmt::Display) -> RunError {
    RunError::Checkpoint(error.to_string())
}

impl Simulation {
    pub(super) fn save_physics(&self) -> Result<Vec<SavedPhysics>, RunError> {
        let save = |(p, state): (&Ready<dyn RunningPhysics>, &Vec<FieldIndex>)| {
            let fields = state
                .iter()
                .map(|&f| self.world.fields.field(f).data().flat().to_vec())
                .collect();
            Ok((fields, pack(&*p.plugin.save(&self.world))?))
        };
        self.physics
            .iter()
            .zip(&self.plan.state)
            .map(save)
            .collect()
    }

    pub(super) fn restore_physics(
        &mut self,
        p: usize,
        saved: &SavedPhysics,
    ) -> Result<(), RunError> {
        for (&f, values) in self.plan.state[p].iter().zip(&saved.0) {
            self.world
                .fields
                .field(f)
                .data_mut()
                .flat_mut()
                .copy_from_slice(values);
        }
        let label = self.physics[p].label.clone();
        let mut source = rmp_serde::Deserializer::from_read_ref(&saved.1);
        let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut source);
        let broken =
            |e: erased_serde::Error| RunError::Checkpoint(format!("state of {label}: {e}"));
        let physics = &mut self.physics[p].plugin;
        physics.load(&self.world, &mut erased).map_err(broken)
    }

    pub(super) fn save_couplers(&self) -> Result<Vec<ByteBuf>, RunError> {
        let save = |c: &Ready<dyn RunningCoupler>| Ok(pack(&*c.plugin.save(&self.world))?.into());
        self.couplers.iter().map(save).collect()
    }

    pub(super) fn restore_couplers(&mut self, saved: &[ByteBuf]) -> Result<(), RunError> {
        for (c, state) in self.couplers.iter_mut().zip(saved) {
            let mut source = rmp_serde::Deserializer::from_read_ref(state);
            let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut source);
            let broken = |e| RunError::Checkpoint(format!("state of {}: {e}", c.label));
            c.plugin.load(&self.world, &mut erased).map_err(broken)?;
        }
        Ok(())
    }

    /// Writes everything needed to go on, bit by bit.
    ///
    /// # Errors
    /// When a plugin's state cannot be serialised, or `out` cannot be written.
    pub fn save_to(&self, out: &mut dyn io::Write) -> Result<(), RunError> {
        let fields = self.saved_indices().map(|i| self.world.fields.field(i));
        let fields = fields.map(|f| SavedField {
            body: f.body,
            name: f.name.clone(),
            values: match self.world.processes().size() {
                1 => FieldValues::Here(f.data()),
                // only the first process writes
                _ => FieldValues::Collected(
                    (self.world.gather(f.body, f.data().flat())).unwrap_or_default(),
                ),
            },
        });
        write_array_len(out, 2)?;
        pack_to(out, &FORMAT)?;
        write_array_len(out, 5)?;
        pack_to(out, &self.clock)?;
        pack_to(out, &fields.collect::<Vec<_>>())?;
        write_array_len(out, self.physics.len())?;
        for physics in &self.physics {
            write_state(out, &*physics.plugin.save(&self.world))?;
        }
        write_array_len(out, self.couplers.len())?;
        for coupler in &self.couplers {
            write_state(out, &*coupler.plugin.save(&self.world))?;
        }
        pack_to(out, &self.world.rows_found_at())
    }

    /// What [`Simulation::save_to`] writes.
    ///
    /// # Errors
    /// See [`Simulation::save_to`].
    pub fn save(&self) -> Result<Vec<u8>, RunError> {
        let mut bytes = Vec::new();
        self.save_to(&mut bytes)?;
        Ok(bytes)
    }

    /// Restores what [`Simulation::save`] gave, instead of [`Simulation::start`].
    ///
    /// # Errors
    /// When the data are damaged or belong to another case.
    pub fn load(&mut self, checkpoint: &[u8]) -> Result<(), RunError> {
        let misfit = |what: String| RunError::Checkpoint(what);
        let format: Result<(u32, IgnoredAny), _> = rmp_serde::from_slice(checkpoint);
        if !format.is_ok_and(|(format, _)| format == FORMAT) {
            let message = "it is damaged, or another version of the program wrote it: resume with that version, or start the \
                           run again";
            return Err(misfit(message.into()));
        }
        let (_, saved): (u32, Checkpoint) =
            rmp_serde::from_slice(checkpoint).map_err(|e| misfit(e.to_string()))?;
        if saved.physics.len() != self.physics.len() || saved.couplers.len() != self.couplers.len()
        {
            return Err(misfit("it has other plugins".into()));
        }
        self.check_clock(&saved.clock).map_err(misfit)?;
        let named = |f: &SavedField<ByteBuf>| (f.body, f.name.clone());
        let mut present: Vec<_> = saved.fields.iter().map(named).collect();
        let saved_fields = self.saved_indices().map(|i| self.world.fields.field(i));
        let mut expected: Vec<_> = saved_fields.map(|f| (f.body, f.name.clone())).collect();
        present.sort();
        expected.sort();
        if let Some((_, name)) = expected.iter().find(|f| present.binary_search(f).is_err()) {
            return Err(misfit(format!("it has no field `{name}`")));
        }
        if let Some(twice) = present.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(misfit(format!("it has field `{}` twice", twice[0].1)));
        }
        for f in &saved.fields {
            let index = self.world.fields.find(f.body, &f.name);
            let field = index.map(|i| self.world.fields.field(i));
            let is_expected = expected.binary_search(&named(f)).is_ok();
            let field = field.filter(|_| is_expected);
            let field = field.ok_or_else(|| misfit(format!("it has a field `{}`", f.name)))?;
            let mut data = field.data_mut();
            let expected = self.world.points_of_whole(f.body) * data.components();
            if expected * 8 != f.values.len() {
                return Err(misfit(format!(
                    "field `{}` has another number of points",
                    f.name
                )));
            }
            let (whole, _) = f.values.as_chunks::<8>();
            let components = data.components();
            let points = data.flat_mut().chunks_exact_mut(components).enumerate();
            for (point, values) in points {
                let first = components * self.world.number_in_whole(f.body, point);
                let of_point = values.iter_mut().zip(&whole[first..]);
                of_point.for_each(|(value, bytes)| *value = f64::from_le_bytes(*bytes));
            }
        }
        let positions = saved.rows_found_at.iter().flatten().flatten();
        if !positions.copied().all(f64::is_finite) || !self.world.find_rows_at(saved.rows_found_at)
        {
            return Err(misfit("it has other families of moving points".into()));
        }
        for (p, state) in self.physics.iter_mut().zip(&saved.physics) {
            let mut source = rmp_serde::Deserializer::from_read_ref(state);
            let mut erased = <dyn erased_serde::Deserializer<'_>>::erase(&mut source);
            p.plugin
                .load(&self.world, &mut erased)
                .map_err(|e| misfit(format!("state of {}: {e}", p.label)))?;
        }
        self.restore_couplers(&saved.couplers)?;
        self.clock = saved.clock;
        self.clock.logs = self.logs_until(self.clock.time);
        for (owned, &time) in self.plan.owned.iter().zip(&self.clock.advanced_to) {
            self.world.set_times(owned, time);
        }
        self.find_steps();
        self.assemble();
        // what a run checks after every pass
        let step = Step::new(self.clock.time, 0.0);
        (0..self.physics.len()).try_for_each(|p| self.check_state(p, step))
    }

    /// Whether a clock is one that a run of these physics can have; else what is wrong with it.
    fn check_clock(&self, clock: &ClockState) -> Result<(), String> {
        /// Counts up to here leave room for those of any run.
        const MOST: u64 = 1 << 60;
        let ClockState {
            time,
            advanced_to,
            progress,
            ..
        } = clock;
        let count = self.physics.len();
        let lists = [
            advanced_to.len(),
            progress.sub_steps.len(),
            progress.iterations.len(),
            progress.evaluations.len(),
        ];
        if lists.iter().any(|found| *found != count) {
            return Err(format!(
                "its clock has another number of physics than {count}"
            ));
        }
        if !(time.is_finite() && *time >= 0.0 && progress.last_step >= 0.0) {
            return Err(format!("its time is {time} s"));
        }
        for (physics, reached) in self.physics.iter().zip(advanced_to) {
            let is_reached = match physics.stepping.update {
                Update::Step => reached == time,
                // waits for the next logged state
                Update::Log => (0.0..=*time).contains(reached),
            };
            if !is_reached {
                let label = &physics.label;
                return Err(format!("{label} is at {reached} s at the time {time} s"));
            }
        }
        let lists = [
            &progress.sub_steps,
            &progress.iterations,
            &progress.evaluations,
        ];
        let counts = lists.into_iter().flatten().copied();
        let others = [progress.macro_steps, progress.passes, progress.unconverged];
        if counts.chain(others).any(|count| count > MOST) {
            return Err("its counts of steps are too large".into());
        }
        Ok(())
    }
}

fn pack(state: &dyn erased_serde::Serialize) -> Result<Vec<u8>, RunError> {
    let mut bytes = Vec::new();
    pack_to(&mut bytes, state)?;
    Ok(bytes)
}

fn pack_to(out: &mut dyn io::Write, state: &dyn erased_serde::Serialize) -> Result<(), RunError> {
    let mut target = rmp_serde::Serializer::new(out);
    let mut erased = <dyn erased_serde::Serializer>::erase(&mut target);
    state.erased_serialize(&mut erased).map_err(not_written)
}

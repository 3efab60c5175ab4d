//! Fields that plugins own, read, write, add to and take up.

use super::Setup;
use crate::error::{Problem, SetupError};
use crate::field::{FieldIndex, Key, Read, ReadIfProvided, Value, Write};
use crate::world::BodyIndex;
use crate::world::facts::Fact;

/// How a plugin touches a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// State that it advances.
    Own,
    /// State that it keeps for itself from step to step: saved with checkpoints, but neither logged nor read by others.
    Keep,
    /// Sums that it takes up; zeroed before each round of additions.
    Consume,
    /// Amounts that it takes up once, at the start of a step; zeroed before each round of additions and before a
    /// further sub-step.
    Take,
    /// Derived values that it computes.
    Write,
    /// Adds into a sink.
    Add,
    /// Adds amounts that another physics takes up, which advances after it.
    Give,
    /// Like `Give`, summed over the sub-steps of the physics, so that the other one may take longer steps.
    GiveSum,
    /// Reads values that the case gives ([`Setup::given`]).
    Given,
    /// Reads.
    Read,
    /// Reads if provided.
    ReadIfProvided,
    /// Sets the layer behind a face.
    Layer,
    /// Sets the layer behind a face if somebody owns the field.
    LayerIfProvided,
}

impl Access {
    pub(super) fn provides(self) -> bool {
        matches!(self, Access::Own | Access::Write | Access::Given)
    }

    /// Whether it changes a field in a way that no other plugin may.
    fn excludes(self, other: Access) -> bool {
        let computes = |a: Access| matches!(a, Access::Own | Access::Keep | Access::Write);
        computes(self) && computes(other) || self.consumes() && other.consumes()
    }

    /// Whether a plugin does more with a body than to read its fields.
    pub(super) fn acts(self) -> bool {
        !matches!(self, Access::Given | Access::Read | Access::ReadIfProvided)
    }

    pub(crate) fn reads(self) -> bool {
        matches!(
            self,
            Access::Given | Access::Read | Access::ReadIfProvided | Access::Consume | Access::Take
        )
    }

    pub(crate) fn gives(self) -> bool {
        matches!(self, Access::Give | Access::GiveSum)
    }

    pub(crate) fn consumes(self) -> bool {
        matches!(self, Access::Consume | Access::Take)
    }

    pub(crate) fn writes(self) -> bool {
        matches!(
            self,
            Access::Write | Access::Add | Access::Layer | Access::LayerIfProvided
        )
    }
}

/// A declared access.
#[derive(Clone, Debug)]
pub struct Declaration {
    /// The plugin, by its position in [`Setup`]'s order: couplers first, then physics.
    pub plugin: usize,
    /// How.
    pub access: Access,
    /// What.
    pub field: FieldIndex,
}

/// The fact that a physics gives amounts to another one of a body ([`Setup::give`]), so that this takes them up whichever of the
/// two is prepared first. The giver publishes it, or a coupler where it is prepared later.
#[derive(Debug)]
pub struct ExpectedGift {
    field: String,
}

impl ExpectedGift {
    /// Amounts for this sink.
    pub fn of<T: Value>(sink: &Key<T>) -> Self {
        ExpectedGift {
            field: sink.name.to_string(),
        }
    }
}

impl Fact for ExpectedGift {}

impl Setup<'_> {
    pub(super) fn declare<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
        access: Access,
    ) -> Result<FieldIndex, SetupError> {
        if access.acts() {
            self.check_support_of_case(body)?;
        }
        let points = self.body(body).points.len();
        let field = self
            .world
            .fields
            .intern(body, points, key)
            .map_err(|present| {
                let problem = Problem::FieldType {
                    field: key.name.to_string(),
                    asked: T::COMPONENTS,
                    present,
                };
                SetupError::new("", problem)
            })?;
        let plugin = self.current;
        let rival = |d: &&Declaration| d.field == field && d.access.excludes(access);
        if let Some(first) = self.declarations.iter().find(rival) {
            let problem = Problem::TwoWriters {
                field: key.name.to_string(),
                body: self.body(body).name.clone(),
                first: self.label(first.plugin).to_string(),
            };
            return Err(SetupError::new("", problem));
        }
        self.declarations.push(Declaration {
            plugin,
            access,
            field,
        });
        Ok(field)
    }

    /// A state field that the calling physics owns and advances.
    ///
    /// # Errors
    /// When somebody else writes it, or it is known with another type.
    pub fn own<T: Value>(&mut self, body: BodyIndex, key: &Key<T>) -> Result<Write<T>, SetupError> {
        self.declare(body, key, Access::Own).map(Write::new)
    }

    /// State that the calling physics advances, as [`Setup::own`], and finds from other fields when the run starts: a case gives it no
    /// initial value.
    ///
    /// # Errors
    /// See [`Setup::own`].
    pub fn own_derived<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<Write<T>, SetupError> {
        let field = self.own(body, key)?;
        self.world.derived.insert(field.field);
        Ok(field)
    }

    /// A field that the calling physics keeps for itself from step to step, such as the force of the last step. Processes that share a body
    /// exchange it as they do state that the physics advances ([`Setup::own`]).
    ///
    /// # Errors
    /// See [`Setup::own`].
    pub fn keep<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<Write<T>, SetupError> {
        self.declare(body, key, Access::Keep).map(Write::new)
    }

    /// A sink field that the calling physics takes up.
    ///
    /// # Errors
    /// See [`Setup::own`].
    pub fn consume<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<Read<T>, SetupError> {
        self.declare(body, key, Access::Consume).map(Read::new)
    }

    /// Consumes a sink like [`Setup::consume`], but only where a coupler adds into it: what nobody adds
    /// to need not be zeroed and read in every step.
    ///
    /// # Errors
    /// See [`Setup::own`].
    pub fn consume_if_added<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<Option<Read<T>>, SetupError> {
        match self.is_declared(body, key, Access::Add) {
            true => self.consume(body, key).map(Some),
            false => Ok(None),
        }
    }

    /// A sink field of amounts, such as [`IMPULSE`](crate::keys::IMPULSE), that the calling physics takes up
    /// once at the start of a step, where a coupler adds into it or a gift is announced. When the physics takes several sub-steps while its
    /// couplers are applied once, the sink is zero from the second sub-step on.
    ///
    /// # Errors
    /// See [`Setup::own`].
    pub fn take_if_added<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<Option<Read<T>>, SetupError> {
        match self.is_declared(body, key, Access::Add) {
            true => self
                .declare(body, key, Access::Take)
                .map(Read::new)
                .map(Some),
            false => Ok(None),
        }
    }

    /// Whether a plugin prepared before the calling one has declared such an access. For a physics, couplers come before: it
    /// need not compute a field that nobody reads ([`Access::Read`]), nor take up a sink to which nobody adds
    /// ([`Access::Add`]).
    pub fn is_declared<T: Value>(&self, body: BodyIndex, key: &Key<T>, access: Access) -> bool {
        let field = self.world.fields.find(body, &key.name);
        let is_such = |a: Access| match access {
            Access::Read => a.reads(),
            access => a == access,
        };
        let mut declarations = self.declarations.iter();
        let mut gifts = self.world.facts::<ExpectedGift>(body);
        declarations.any(|d| Some(d.field) == field && is_such(d.access))
            || access == Access::Add && gifts.any(|gift| gift.field == key.name)
    }

    /// A derived field that the calling plugin computes.
    ///
    /// # Errors
    /// See [`Setup::own`].
    pub fn write<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<Write<T>, SetupError> {
        let field = self.declare(body, key, Access::Write)?;
        self.world.derived.insert(field);
        Ok(Write::new(field))
    }

    /// A sink field that the calling coupler adds into.
    ///
    /// # Errors
    /// See [`Setup::own`]; also when a physics asks: sinks are zeroed before couplers add, not before physics do.
    pub fn add<T: Value>(&mut self, body: BodyIndex, key: &Key<T>) -> Result<Write<T>, SetupError> {
        if self.plugins[self.current].is_physics {
            let message = format!(
                "a physics cannot add to `{}`: sinks are set to zero before couplers add to them",
                key.name
            );
            let expected = "a field that the physics writes and a coupler that adds it";
            return Err(SetupError::value("", message, expected));
        }
        self.declare(body, key, Access::Add).map(Write::new)
    }

    /// Amounts that the calling physics gives to the points of a body, of which another physics, of that body or the same one,
    /// takes them up ([`Setup::take`]): those of the last sub-step ([`Access::Give`]), such as impulses, or their sum over
    /// its sub-steps since both physics were at one time ([`Access::GiveSum`]).
    ///
    /// # Errors
    /// See [`Setup::own`].
    ///
    /// # Panics
    /// When the access is another one.
    pub fn give<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
        access: Access,
    ) -> Result<Write<T>, SetupError> {
        assert!(access.gives(), "{access:?} gives nothing");
        self.declare(body, key, access).map(Write::new)
    }

    /// Amounts that the calling physics takes up once, at the start of a step, from another physics.
    ///
    /// # Errors
    /// See [`Setup::own`].
    pub fn take<T: Value>(&mut self, body: BodyIndex, key: &Key<T>) -> Result<Read<T>, SetupError> {
        self.declare(body, key, Access::Take).map(Read::new)
    }

    /// A field that the calling plugin reads.
    ///
    /// # Errors
    /// When it is known with another type; [`Setup::finish`] reports one that nobody provides.
    pub fn read<T: Value>(&mut self, body: BodyIndex, key: &Key<T>) -> Result<Read<T>, SetupError> {
        self.declare(body, key, Access::Read).map(Read::new)
    }

    /// A field that the calling plugin reads where it exists.
    ///
    /// # Errors
    /// When it is known with another type.
    pub fn read_if_provided<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<ReadIfProvided<T>, SetupError> {
        self.declare(body, key, Access::ReadIfProvided)
            .map(ReadIfProvided::new)
    }

    /// A field of a body that the case gives (`initial`), zero where it does not, unless a plugin computes it. Any number of
    /// plugins may read it.
    ///
    /// # Errors
    /// When it is known with another type.
    pub fn given<T: Value>(
        &mut self,
        body: BodyIndex,
        key: &Key<T>,
    ) -> Result<Read<T>, SetupError> {
        self.declare(body, key, Access::Given).map(Read::new)
    }

    /// Sets the values of a field before the first step, by point, which a case may replace.
    pub fn set_first(&mut self, field: Write<f64>, value: impl Fn(usize) -> f64) {
        let values = self.world.fields.values_mut(field.field).iter_mut();
        values.enumerate().for_each(|(point, v)| *v = value(point));
        self.world.derived.remove(&field.field);
    }
}

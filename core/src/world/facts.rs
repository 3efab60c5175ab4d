//! Facts about bodies that plugins publish at set-up for others, by type.

use std::any::Any;
use std::cell::Cell;
use std::fmt;
use std::marker::PhantomData;
use std::rc::Rc;

use super::BodyIndex;
use super::changes::Changes;

/// A rule that a fact breaks: what to write instead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactRule {
    /// Key of the plugin that published the fact.
    pub key: &'static str,
    /// What is wrong, with `{body}` and `{first}` for the names of the body and of the plugin that published first.
    pub message: &'static str,
    /// What is expected.
    pub expected: &'static str,
}

/// Something that is true of a body and that other plugins ask for, such as that it is rigid or how it melts.
///
/// A plugin publishes facts ([`Setup::publish`](crate::Setup::publish)); others find them by their type
/// ([`Setup::facts`](crate::Setup::facts), [`World::facts`](crate::World::facts)).
pub trait Fact: Any {
    /// The mistake of a second plugin that publishes such a fact of a body; `None` where there may be several.
    const SECOND: Option<FactRule> = None;

    /// What happens to the points of the body.
    fn changes(&self) -> Changes {
        Changes::NONE
    }

    /// The mistake where no plugin asks for the fact; `None` where that is none.
    fn unread(&self) -> Option<FactRule> {
        None
    }
}

/// Of each body there is one coupler of type `C`: it computes the whole of an effect, which a second one would count again.
pub(crate) struct Once<C>(pub(crate) PhantomData<C>);

impl<C: 'static> Fact for Once<C> {
    const SECOND: Option<FactRule> = Some(FactRule {
        key: "body",
        message: "the whole effect on body `{body}` is that of `{first}`",
        expected: "one such coupler for the body",
    });
}

/// A fact that was published.
#[derive(Clone)]
pub(crate) struct Published {
    pub(crate) body: BodyIndex,
    /// Position of the plugin in the set-up.
    pub(crate) plugin: usize,
    value: Rc<dyn Any>,
    /// See [`Fact::unread`].
    unread: Option<FactRule>,
    is_read: Cell<bool>,
}

/// All facts.
#[derive(Clone, Default)]
pub(crate) struct Facts(Vec<Published>);

impl fmt::Debug for Facts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} facts", self.0.len())
    }
}

impl Facts {
    pub(crate) fn publish<T: Fact>(&mut self, body: BodyIndex, plugin: usize, fact: T) {
        self.0.push(Published {
            body,
            plugin,
            unread: fact.unread(),
            value: Rc::new(fact),
            is_read: Cell::new(false),
        });
    }

    /// Facts of a type, each with the plugin that published it.
    pub(crate) fn of<T: Fact>(&self, body: BodyIndex) -> impl Iterator<Item = (usize, &T)> {
        let of_body = self.0.iter().filter(move |fact| fact.body == body);
        of_body.filter_map(|fact| Some((fact.plugin, fact.value.downcast_ref()?)))
    }

    /// Facts of a type about all bodies, each with the plugin that published it.
    pub(crate) fn all<T: Fact>(&self) -> impl Iterator<Item = (usize, &T)> {
        let facts = self.0.iter();
        facts.filter_map(|fact| Some((fact.plugin, fact.value.downcast_ref()?)))
    }

    /// Notes that a plugin asked for the facts of a type.
    pub(crate) fn note_reader<T: Fact>(&self, body: BodyIndex) {
        let of_body = self.0.iter().filter(|fact| fact.body == body);
        let read = of_body.filter(|fact| fact.value.is::<T>());
        read.for_each(|fact| fact.is_read.set(true));
    }

    /// Facts for which a plugin had to ask and none did, each with the rule that it breaks.
    pub(crate) fn unread(&self) -> impl Iterator<Item = (&Published, FactRule)> {
        let facts = self.0.iter().filter(|fact| !fact.is_read.get());
        facts.filter_map(|fact| Some((fact, fact.unread?)))
    }
}

//! Registrations by name.

/// What is registered under a name.
pub trait HasName {
    /// The name in case files.
    fn name(&self) -> &'static str;
}

/// A part of all registrations of the type `R`, sorted by its name: the linker orders them differently in each build.
pub fn by_name<R: inventory::Collect, T: HasName>(
    part: fn(&'static R) -> &'static T,
) -> Vec<&'static T> {
    let mut all: Vec<_> = inventory::iter::<R>.into_iter().map(part).collect();
    all.sort_by_key(|registration| registration.name());
    all
}

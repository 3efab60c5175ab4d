//! Physics plugins.

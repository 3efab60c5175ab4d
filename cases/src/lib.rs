//! Case files, command line and material library.

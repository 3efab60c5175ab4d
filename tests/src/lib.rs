//! Verification and command-line tests.

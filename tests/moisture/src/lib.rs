//! Moisture that diffuses through a body and swells it: a physics and a coupler, each a file
//! that reads top to bottom. Linking this crate makes them known; see `main.rs`.
mod diffusion;
mod ring;
mod swelling;

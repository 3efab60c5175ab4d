//! Values of the keys `inertia` and `initial_angular_velocity`.

use nalgebra::{Matrix3, Vector3};
use perimelt_core::SetupError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::rotation::PrincipalInertia;

/// Inertia about the centre of mass, kg m².
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "a number in kg m² (2D), or [xx, yy, zz] or a symmetric 3 by 3 matrix (3D)"
)]
pub enum Inertia {
    /// About z, of a 2D body.
    Scalar(f64),
    /// About x, y and z, which are principal axes.
    Principal([f64; 3]),
    /// Rows of a symmetric matrix.
    Matrix([[f64; 3]; 3]),
}

/// Angular velocity, rad/s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "a number in rad/s (2D), or a vector [x, y, z] (3D)"
)]
pub enum AngularVelocity {
    /// About z, of a 2D body.
    Scalar(f64),
    /// In space.
    Vector([f64; 3]),
}

impl Inertia {
    pub(super) fn matrix(&self, dimension: usize) -> Result<Matrix3<f64>, SetupError> {
        let refuse =
            |message: &str, expected: &str| Err(SetupError::value("inertia", message, expected));
        let matrix = match (self, dimension) {
            (Inertia::Scalar(about_z), 2) => Matrix3::identity() * *about_z,
            (Inertia::Principal(moments), 3) => Matrix3::from_diagonal(&Vector3::from(*moments)),
            // rows become columns: the matrix is symmetric
            (Inertia::Matrix(rows), 3) => Matrix3::from(*rows),
            (_, 2) => return refuse("a 2D body rotates about z only", "one number in kg m²"),
            _ => {
                let expected = "[xx, yy, zz] or a symmetric 3 by 3 matrix in kg m²";
                return refuse("one number does not give the inertia in 3D", expected);
            }
        };
        if matrix != matrix.transpose() {
            return refuse("the matrix is not symmetric", "a symmetric matrix");
        }
        match PrincipalInertia::new(&matrix).least() > 0.0 {
            true => Ok(matrix),
            false => refuse(
                "a principal moment is not positive",
                "positive principal moments in kg m²",
            ),
        }
    }
}

impl AngularVelocity {
    pub(super) fn vector(&self, dimension: usize) -> Result<Vector3<f64>, SetupError> {
        let expected = match dimension {
            2 => "one number in rad/s, about z",
            _ => "a vector [x, y, z] in rad/s",
        };
        match (self, dimension) {
            (AngularVelocity::Scalar(about_z), 2) => Ok(Vector3::ith(2, *about_z)),
            (AngularVelocity::Vector(velocity), 3) => Ok(Vector3::from(*velocity)),
            _ => {
                let message = format!("the wrong number of components for a {dimension}D body");
                Err(SetupError::value(
                    "initial_angular_velocity",
                    message,
                    expected,
                ))
            }
        }
    }
}

//! Extents of melt pools.

use super::*;
use std::f64::consts::PI;

const SPACING: f64 = 1e-4;

/// Cell centres of a box whose corner is at `from`, in cells.
fn lattice(from: [f64; 3], cells: [usize; 3]) -> Vec<[f64; 3]> {
    let mut positions = Vec::new();
    for k in 0..cells[2] {
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                let cell = [i, j, k];
                positions.push([0, 1, 2].map(|a| (from[a] + cell[a] as f64 + 0.5) * SPACING));
            }
        }
    }
    positions
}

/// `T = 2000 - 500 r^2`, r = 1 on the ellipsoid with these half axes (m).
fn ellipsoid(positions: &[[f64; 3]], centre: [f64; 3], half_axes: [f64; 3]) -> Vec<f64> {
    let term = |p: &[f64; 3], a: usize| ((p[a] - centre[a]) / half_axes[a]).powi(2);
    let temperature = |p| 2000.0 - 500.0 * (term(p, 0) + term(p, 1) + term(p, 2));
    positions.iter().map(temperature).collect()
}

fn gauge(positions: &[[f64; 3]], dimension: usize) -> MeltPoolGauge {
    let grid = CellGrid::new(positions, SPACING).expect("a lattice");
    MeltPoolGauge::on(grid, dimension, 1.0, 1500.0)
}

fn measured(
    positions: &[[f64; 3]],
    dimension: usize,
    travel: Travel,
    temperature: &[f64],
) -> Option<MeltPool> {
    gauge(positions, dimension).measure(temperature, Aim::fixed(travel))
}

fn close(found: f64, expected: f64) {
    // linear interpolation on a parabola: dx^2 T'' / (8 T') = dx^2 / (8 a), a >= 5 dx here
    let tolerance = SPACING / 40.0 * 1.01;
    assert!(
        (found - expected).abs() < tolerance,
        "{found} instead of {expected}"
    );
}

/// Half a block, cut at the plane of symmetry y = 0, its surface at z = 0.
#[test]
fn isotherm_of_a_half_ellipsoid_is_found_within_a_fortieth_of_the_spacing() {
    let positions = lattice([-30.0, 0.0, -10.0], [60, 12, 10]);
    let (centre, half) = (3.3e-4, [17.2e-4, 8.1e-4, 5.4e-4]);
    let temperature = ellipsoid(&positions, [centre, 0.0, 0.0], half);
    let pool = measured(&positions, 3, Travel::X, &temperature);
    let pool = pool.expect("a pool");
    close(pool.front, centre + half[0]);
    close(pool.rear, centre - half[0]);
    close(pool.width.expect("3D"), half[1]);
    close(pool.depth.expect("3D"), half[2]);
    close(pool.length() / 2.0, half[0]);
    assert_eq!(pool.copies, 1.0);

    let symmetry = [Face::YMin, Face::XMin];
    let gauge = gauge(&positions, 3).with_symmetry(&symmetry);
    let whole = gauge
        .measure(&temperature, Aim::fixed(Travel::X))
        .expect("a pool");
    close(0.5 * whole.width.expect("3D"), half[1]);
    // the pool does not reach the other plane of symmetry
    assert_eq!(whole.copies, 2.0);
    assert_eq!((whole.rear, whole.depth), (pool.rear, pool.depth));
    // a quarter of the ellipsoid; cells with linear values, five in the smallest half axis
    let quarter = PI / 3.0 * half.iter().product::<f64>();
    assert!(
        (pool.volume / quarter - 1.0).abs() < 0.01,
        "{}",
        pool.volume / quarter
    );
    assert_eq!(whole.volume, 2.0 * pool.volume);
}

/// A quarter of a spot: length and width are those of the whole, in whichever direction the source travels.
#[test]
fn a_pool_is_mirrored_along_travel_as_across() {
    let positions = lattice([0.0, 0.0, -10.0], [30, 12, 10]);
    let half = [17.2e-4, 8.1e-4, 5.4e-4];
    let temperature = ellipsoid(&positions, [0.0; 3], half);
    let symmetry = [Face::XMin, Face::YMin];
    let gauge = gauge(&positions, 3).with_symmetry(&symmetry);
    for (travel, [along, across]) in [(Travel::X, [0, 1]), (Travel::Y, [1, 0])] {
        let pool = gauge
            .measure(&temperature, Aim::fixed(travel))
            .expect("a pool");
        close(0.5 * pool.length(), half[along]);
        close(pool.front, half[along]);
        close(0.5 * pool.width.expect("3D"), half[across]);
        assert_eq!(pool.copies, 4.0);
    }
}

/// A whole block under a beam of any direction; the pool is turned with the source.
#[test]
fn extents_lie_along_travel_and_beam_and_not_along_the_axes() {
    let positions = lattice([-30.0, -30.0, -30.0], [60, 60, 60]);
    let half = [17.2e-4, 8.1e-4, 11.4e-4];
    let (cos, sin) = (30_f64.to_radians().cos(), 30_f64.to_radians().sin());
    for (travel, beam, across) in [
        ([cos, sin, 0.0], [0.0, 0.0, -1.0], [-sin, cos, 0.0]),
        ([0.0, 1.0, 0.0], [sin, 0.0, -cos], [cos, 0.0, sin]),
        ([-1.0, 0.0, 0.0], [0.0, -sin, -cos], [0.0, cos, -sin]),
    ] {
        let temperature = |p: &[f64; 3]| {
            let along = |d: [f64; 3]| (0..3).map(|a| p[a] * d[a]).sum::<f64>();
            let parts = [
                along(travel) / half[0],
                along(across) / half[1],
                along(beam) / half[2],
            ];
            2000.0 - 500.0 * parts.iter().map(|x| x * x).sum::<f64>()
        };
        let temperature: Vec<f64> = positions.iter().map(temperature).collect();
        let source = SourceState {
            position: [0.0; 3],
            travel: Some(travel),
            beam,
            is_on: true,
            path: 0.0,
        };
        let aim = Aim {
            sources: &[source],
            ..Aim::fixed(Travel::X)
        };
        let pool = gauge(&positions, 3)
            .measure(&temperature, aim)
            .expect("a pool");
        // dx^2 / (8 R) on either side, R >= b^2 / a
        let tolerance = 2.0 * SPACING.powi(2) * half[0] / (8.0 * half[1].powi(2)) + SPACING / 20.0;
        assert!(
            (pool.length() - 2.0 * half[0]).abs() < tolerance,
            "{pool:?}"
        );
        assert!(
            (pool.width.expect("3D") - 2.0 * half[1]).abs() < tolerance,
            "{pool:?}"
        );
        // from the face z = 30 above the hottest point, along the beam
        let surface = 30.0 * SPACING / -beam[2];
        let depth = pool.depth.expect("3D") - surface;
        assert!((depth - half[2]).abs() < tolerance + SPACING, "{pool:?}");
    }
}

/// The centre line lies between the points, as it does in every block of even width.
#[test]
fn pool_between_lattice_lines_along_y_has_its_whole_width() {
    let positions = lattice([-10.3, -20.0, -8.0], [21, 40, 8]);
    let half = [7.2e-4, 13.7e-4, 5.1e-4];
    let temperature = ellipsoid(&positions, [0.0; 3], half);
    let pool = measured(&positions, 3, Travel::Y, &temperature);
    let pool = pool.expect("a pool");
    close(pool.front, half[1]);
    close(pool.rear, -half[1]);
    close(pool.width.expect("3D") / 2.0, half[0]);
    close(pool.depth.expect("3D"), half[2]);
}

#[test]
fn plane_body_has_no_depth_and_a_bar_no_width() {
    let positions = lattice([-20.0, -10.0, -0.5], [40, 20, 1]);
    let temperature = ellipsoid(&positions, [0.0; 3], [12e-4, 6.3e-4, 1.0]);
    let pool = measured(&positions, 2, Travel::X, &temperature);
    let pool = pool.expect("a pool");
    close(pool.width.expect("2D") / 2.0, 6.3e-4);
    assert_eq!(pool.depth, None);

    let positions = lattice([-20.0, -0.5, -0.5], [40, 1, 1]);
    let temperature = ellipsoid(&positions, [0.0; 3], [12e-4, 1.0, 1.0]);
    let pool = measured(&positions, 1, Travel::X, &temperature);
    let pool = pool.expect("a pool");
    close(pool.front, 12e-4);
    assert_eq!((pool.width, pool.depth), (None, None));
}

#[test]
fn pool_ends_at_the_faces_of_the_body() {
    let positions = lattice([0.0, 0.0, -4.0], [10, 6, 4]);
    let temperature = vec![1800.0; positions.len()];
    let pool = measured(&positions, 3, Travel::X, &temperature);
    let pool = pool.expect("a pool");
    // rounding only
    assert!((pool.length() - 10.0 * SPACING).abs() < 1e-15);
    assert!((pool.width.expect("3D") - 6.0 * SPACING).abs() < 1e-15);
    assert!((pool.depth.expect("3D") - 4.0 * SPACING).abs() < 1e-15);
    assert_eq!(pool.peak, 1800.0);
}

#[test]
fn depth_counts_from_the_surface_above_the_pool() {
    // a base of four layers, and a web on one of its sides
    let mut positions = lattice([0.0, 0.0, -4.0], [10, 12, 4]);
    positions.extend(lattice([0.0, 0.0, 0.0], [10, 3, 8]));
    let hot = |p: &[f64; 3]| p[1] > 6.0 * SPACING && p[2] > -2.0 * SPACING;
    let temperature: Vec<f64> = positions
        .iter()
        .map(|p| if hot(p) { 1800.0 } else { 1200.0 })
        .collect();
    let pool = measured(&positions, 3, Travel::X, &temperature).expect("a pool");
    // the parabola around the largest temperature overshoots at a step
    assert!((pool.depth.expect("3D") - 2.0 * SPACING).abs() < 0.2 * SPACING);
}

#[test]
fn temperature_that_is_not_a_number_shows_in_every_extent() {
    let positions = lattice([0.0; 3], [4, 4, 4]);
    let mut temperature = vec![1800.0; positions.len()];
    temperature[7] = f64::NAN;
    let pool = measured(&positions, 3, Travel::X, &temperature).expect("not cold");
    assert!(pool.length().is_nan() && pool.depth.is_some_and(f64::is_nan));
}

#[test]
fn cold_body_has_no_pool() {
    let positions = lattice([0.0; 3], [4, 4, 4]);
    let cold = vec![300.0; positions.len()];
    assert_eq!(measured(&positions, 3, Travel::X, &cold), None);
}

#[test]
fn a_second_pool_is_no_part_of_the_first() {
    let positions = lattice([-30.0, -20.0, -8.0], [60, 40, 8]);
    let half = [7.2e-4, 5.1e-4, 5.1e-4];
    // side by side, so that their profiles along x overlap; the first is the hottest
    let first = ellipsoid(&positions, [-4e-4, -8e-4, 0.0], half);
    let second = ellipsoid(&positions, [8e-4, 8e-4, 0.0], [9e-4, 5e-4, 6e-4]);
    let both = first.iter().zip(&second).map(|(a, b)| a.max(b - 40.0));
    let both: Vec<f64> = both.collect();
    let pool = measured(&positions, 3, Travel::X, &both).expect("a pool");
    close(pool.front, -4e-4 + half[0]);
    close(pool.rear, -4e-4 - half[0]);
    close(pool.width.expect("3D") / 2.0, half[1]);
    close(pool.depth.expect("3D"), half[2]);
}

#[test]
fn metal_over_a_pool_that_is_not_molten_is_no_depth() {
    // a base of eight layers, a web on one of its sides, and a pool that reaches below the web
    let mut positions = lattice([0.0, 0.0, -8.0], [20, 24, 8]);
    positions.extend(lattice([0.0, 0.0, 0.0], [20, 8, 12]));
    let half = [6e-4, 7.2e-4, 5.6e-4];
    let temperature = ellipsoid(&positions, [10e-4, 10e-4, 0.0], half);
    let cold = |(p, t): (&[f64; 3], f64)| if p[2] > 0.0 { t.min(1400.0) } else { t };
    let temperature: Vec<f64> = positions.iter().zip(temperature).map(cold).collect();
    let pool = measured(&positions, 3, Travel::X, &temperature).expect("a pool");
    close(pool.depth.expect("3D"), half[2]);
}

#[test]
fn the_depth_in_a_fillet_lies_along_its_beam() {
    // base and web with the metal of the fillet, whose face is normal to the torch at 45 degrees
    let mut positions = lattice([0.0, -10.0, -10.0], [20, 40, 10]);
    positions.extend(lattice([0.0, -10.0, 0.0], [20, 10, 30]));
    let is_metal = |p: &[f64; 3]| p[1] + p[2] < 16.5 * SPACING;
    let fillet = lattice([0.0, 0.0, 0.0], [20, 16, 16]).into_iter();
    positions.extend(fillet.filter(is_metal));
    let half = [8e-4, 7e-4, 9.2e-4];
    // in the middle of the face
    let (s, corner) = (0.5_f64.sqrt(), [10e-4, 8.25e-4, 8.25e-4]);
    let temperature = |p: &[f64; 3]| {
        let along = |d: [f64; 3]| (0..3).map(|a| (p[a] - corner[a]) * d[a]).sum::<f64>();
        let parts = [
            along([1.0, 0.0, 0.0]) / half[0],
            along([0.0, s, -s]) / half[1],
            along([0.0, -s, -s]) / half[2],
        ];
        2000.0 - 500.0 * parts.iter().map(|x| x * x).sum::<f64>()
    };
    let temperature: Vec<f64> = positions.iter().map(temperature).collect();
    let source = SourceState {
        position: corner,
        travel: Some([1.0, 0.0, 0.0]),
        beam: [0.0, -s, -s],
        is_on: true,
        path: 0.0,
    };
    let aim = Aim {
        sources: &[source],
        ..Aim::fixed(Travel::X)
    };
    let pool = gauge(&positions, 3)
        .measure(&temperature, aim)
        .expect("a pool");
    let depth = pool.depth.expect("3D");
    // the face is a stair of cells, whose diagonal has 1.4 spacings
    assert!((depth - half[2]).abs() < SPACING, "{depth}");
}

//! Sums of derivatives against all derivatives.

use rayon::prelude::*;

use super::*;

#[test]
fn sums_of_derivatives_are_those_of_all_of_them() {
    for cells in [[9, 8, 1], [7, 6, 5]] {
        let dimension = if cells[2] > 1 { 3 } else { 2 };
        // one inverse behind mirrored layers, one for each point without
        for mirrored in [true, false] {
            let body = block(cells, 0.1);
            let pddo = operator(&body, 3.015, 2, mirrored);
            let field = |axis: usize| {
                let at = |slot: usize| ((slot * (axis + 3)) as f64).sin();
                let mut field = SlotField::default();
                field.set((0..pddo.family().slots()).into_par_iter().map(at));
                field
            };
            let fields: Vec<SlotField> = (0..dimension).map(field).collect();
            let all: Vec<Derivatives> = fields
                .iter()
                .map(|field| {
                    let mut all = Derivatives::default();
                    pddo.differentiate(field, &mut all);
                    all
                })
                .collect();
            let mut work = Derivatives::default();
            let [
                mut gradient,
                mut both,
                mut laplacian,
                mut divergence,
                mut slope,
            ] = [const { Vec::new() }; 5];
            pddo.gradient(&fields[0], &mut work, &mut gradient);
            pddo.gradient_and_laplacian(&fields[0], &mut work, &mut both);
            pddo.laplacian(&fields[0], &mut work, &mut laplacian);
            pddo.divergence(&fields, &mut work, &mut divergence);
            pddo.gradient_of_divergence(&fields, &mut work, &mut slope);
            let near = |ours: f64, theirs: f64| {
                // of second derivatives on a spacing of 0.1
                assert!((ours - theirs).abs() < 1e-10, "{ours} {theirs}");
            };
            for point in 0..body.points.len() {
                let row = &both[point * (dimension + 1)..];
                let sum: f64 = (0..dimension).map(|a| all[a].gradient(point)[a]).sum();
                for a in 0..dimension {
                    near(gradient[point * dimension + a], all[0].gradient(point)[a]);
                    near(row[a], all[0].gradient(point)[a]);
                    let of = |b: usize| all[b].second(point)[(a, b)];
                    near(slope[point * dimension + a], (0..dimension).map(of).sum());
                }
                near(row[dimension], all[0].laplacian(point));
                near(laplacian[point], all[0].laplacian(point));
                near(divergence[point], sum);
            }
        }
    }
}

use super::*;

#[test]
fn values_move_by_whole_points_along_every_axis() {
    let size = [4, 3, 2];
    let at = |[x, y, z]: [i64; 3]| (x + 10 * y + 100 * z) as f64;
    let cells = || (0..24i64).map(|n| [n % 4, n / 4 % 3, n / 12]);
    for step in [
        [1, 0, 0],
        [-2, 0, 0],
        [0, 1, 0],
        [1, -1, 1],
        [-1, 2, -1],
        [5, 0, 0],
    ] {
        let mut values: Vec<f64> = cells().map(at).collect();
        shift(&mut values, size, step);
        for (n, cell) in cells().enumerate() {
            let from: [i64; 3] = std::array::from_fn(|a| cell[a] + step[a]);
            if (0..3).all(|a| from[a] >= 0 && from[a] < size[a] as i64) {
                assert_eq!(values[n], at(from), "{step:?} {cell:?}");
            }
        }
    }
}

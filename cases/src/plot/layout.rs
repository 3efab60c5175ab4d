//! Sizes of the views of a picture.

use super::snapshot::{LEFT, RIGHT};
use super::unit;

/// Largest height of a single view over the width of the picture.
const HIGHEST_ALONE: f64 = 0.75;
/// Largest height of one of several views over the width of the picture.
const HIGHEST: f64 = 0.45;
/// A view that would be lower than this is stretched, pixels.
const LOWEST: f64 = 120.0;

/// A view in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ViewPanel {
    /// lower left and upper right corner of what is shown, m
    pub bounds: [[f64; 2]; 2],
    /// width and height, pixels
    pub size: [f64; 2],
    /// heights are drawn this many times as large as widths
    pub stretch: f64,
    /// upper left corner, pixels
    pub corner: [f64; 2],
}

impl ViewPanel {
    /// The caption of the view, with its scale if heights and widths have different ones.
    pub(super) fn caption(&self, view: &str) -> String {
        if self.stretch == 1.0 {
            return view.to_owned();
        }
        let comma = if view.is_empty() { "" } else { ", " };
        format!("{view}{comma}heights {} ×", unit::number(self.stretch, 4))
    }
}

/// Panels for views with these bounds (m) and axes in a picture of this width (pixels). Views with the same horizontal axis have
/// the same scale, so that places below each other belong together.
pub(super) fn panels(bounds: &[[[f64; 2]; 2]], axes: &[[usize; 2]], width: f64) -> Vec<ViewPanel> {
    let room = width - LEFT - RIGHT;
    let highest = if bounds.len() > 1 {
        HIGHEST
    } else {
        HIGHEST_ALONE
    } * width;
    let extent = |b: &[[f64; 2]; 2]| [b[1][0] - b[0][0], b[1][1] - b[0][1]];
    let scale = |b: &[[f64; 2]; 2]| {
        let [wide, high] = extent(b);
        (room / wide).min(highest / high)
    };
    let panel = |(b, own): (&[[f64; 2]; 2], &[usize; 2])| {
        let alike = bounds
            .iter()
            .zip(axes)
            .filter(|(_, axes)| axes[0] == own[0]);
        let pixels_per_metre = alike.map(|(b, _)| scale(b)).fold(f64::INFINITY, f64::min);
        let [wide, high] = extent(b).map(|metres| metres * pixels_per_metre);
        let stretch = stretch(high, highest);
        ViewPanel {
            bounds: *b,
            size: [wide, high * stretch],
            stretch,
            corner: [0.0; 2],
        }
    };
    bounds.iter().zip(axes).map(panel).collect()
}

/// The smallest round factor that makes a height (pixels) large enough to be seen.
fn stretch(height: f64, highest: f64) -> f64 {
    if height >= LOWEST {
        return 1.0;
    }
    let factors = [2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0];
    let fits = |factor: &f64| factor * height >= LOWEST && factor * height <= highest;
    factors.into_iter().find(fits).unwrap_or(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thin_sections_are_stretched_and_say_so() {
        let bounds = |wide, high| [[0.0, 0.0], [wide, high]];
        // a plate of 100 x 60 x 6 mm from above, along and across
        let all = [bounds(0.1, 0.06), bounds(0.1, 0.006), bounds(0.06, 0.006)];
        let panels = panels(&all, &[[0, 1], [0, 2], [1, 2]], 1200.0);
        assert_eq!(panels[0].stretch, 1.0);
        assert_eq!(panels[0].size[0], panels[1].size[0]);
        assert_eq!(panels[1].stretch, 3.0);
        assert_eq!(panels[1].caption("section A"), "section A, heights 3 ×");
        assert_eq!(panels[0].caption("above"), "above");
        // the section across has a scale of its own
        assert!((panels[2].size[0] - 910.0).abs() < 1e-9);
        for panel in panels {
            assert!(panel.size[1] >= LOWEST && panel.size[1] <= 0.45 * 1200.0 + 1e-9);
        }
    }

    #[test]
    fn a_body_of_any_shape_has_a_picture() {
        for (wide, high) in [(1.0, 1e-9), (1e-9, 1.0), (1.0, 1.0)] {
            let panel = panels(&[[[0.0, 0.0], [wide, high]]], &[[0, 1]], 600.0)[0];
            assert!(panel.size.iter().all(|size| *size > 0.0 && *size < 700.0));
        }
    }
}

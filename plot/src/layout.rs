//! Sizes of the views of a picture.

/// Left of the views, pixels.
pub(crate) const LEFT: f64 = 125.0;
/// Room for the colours at the right of the views.
const RIGHT: f64 = 165.0;
/// Between views one below the other, for the axes.
const GAP: f64 = 112.0;
/// Largest height of a single view over the width of the picture.
const HIGHEST_ALONE: f64 = 0.75;
/// Largest height of one of several views over the width of the picture.
const HIGHEST: f64 = 0.45;
/// A view that would be lower than this is stretched, pixels.
const LOWEST: f64 = 120.0;

/// A view in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ViewPanel {
    /// lower left and upper right corner of what is shown, m
    pub bounds: [[f64; 2]; 2],
    /// width and height, pixels
    pub size: [f64; 2],
    /// heights are drawn this many times as large as widths
    pub stretch: f64,
    /// height of its upper edge in the picture, pixels
    pub top: f64,
}

impl ViewPanel {
    /// The caption of the view, with its scale if heights and widths have different ones.
    pub(crate) fn caption(&self, view: &str) -> String {
        if self.stretch == 1.0 {
            return view.to_owned();
        }
        let comma = if view.is_empty() { "" } else { ", " };
        format!("{view}{comma}heights {} ×", self.stretch)
    }
}

/// Panels for views with these bounds (m) and axes in a picture of this width (pixels). Views with the same horizontal axis
/// have the same scale, so that places below each other belong together.
pub(crate) fn panels(views: &[([[f64; 2]; 2], [usize; 2])], width: f64) -> Vec<ViewPanel> {
    let room = width - LEFT - RIGHT;
    let part = if views.len() > 1 {
        HIGHEST
    } else {
        HIGHEST_ALONE
    };
    let highest = part * width;
    let extent = |[low, high]: [[f64; 2]; 2]| [high[0] - low[0], high[1] - low[1]];
    let panel = |&(bounds, own): &([[f64; 2]; 2], [usize; 2])| {
        let alike = views.iter().filter(|(_, axes)| axes[0] == own[0]);
        let scales = alike.map(|(bounds, _)| {
            let [wide, high] = extent(*bounds);
            (room / wide).min(highest / high)
        });
        let pixels_per_metre = scales.fold(f64::INFINITY, f64::min);
        let [wide, high] = extent(bounds).map(|metres| metres * pixels_per_metre);
        let stretch = stretch(high, highest);
        ViewPanel {
            bounds,
            size: [wide, high * stretch],
            stretch,
            top: 0.0,
        }
    };
    views.iter().map(panel).collect()
}

/// Height of all panels one below the other, pixels.
pub(crate) fn height_of(panels: &[ViewPanel]) -> f64 {
    let heights = panels.iter().map(|panel| panel.size[1]);
    heights.sum::<f64>() + (panels.len() as f64 - 1.0) * GAP
}

/// Places panels one below the other from a height (pixels) on.
pub(crate) fn stack(panels: &mut [ViewPanel], mut top: f64) {
    for panel in panels {
        panel.top = top;
        top += panel.size[1] + GAP;
    }
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

    fn bounds(wide: f64, high: f64) -> [[f64; 2]; 2] {
        [[0.0, 0.0], [wide, high]]
    }

    /// A plate of 100 x 60 x 6 mm from above, along and across.
    fn plate() -> Vec<ViewPanel> {
        let views = [
            (bounds(0.1, 0.06), [0, 1]),
            (bounds(0.1, 0.006), [0, 2]),
            (bounds(0.06, 0.006), [1, 2]),
        ];
        panels(&views, 1200.0)
    }

    #[test]
    fn thin_sections_are_stretched_and_say_so() {
        let panels = plate();
        assert_eq!(panels[0].stretch, 1.0);
        assert_eq!(panels[0].size[0], panels[1].size[0]);
        assert_eq!(panels[1].stretch, 3.0);
        assert_eq!(panels[1].caption("section A"), "section A, heights 3 ×");
        assert_eq!(panels[1].caption(""), "heights 3 ×");
        assert_eq!(panels[0].caption("above"), "above");
        // the section across has a scale of its own
        assert!((panels[2].size[0] - 910.0).abs() < 1e-9);
        for panel in panels {
            assert!(panel.size[1] >= LOWEST && panel.size[1] <= 0.45 * 1200.0 + 1e-9);
        }
    }

    #[test]
    fn views_do_not_overlap_and_stay_in_the_picture() {
        let mut panels = plate();
        stack(&mut panels, 80.0);
        let bottom = |panel: &ViewPanel| panel.top + panel.size[1];
        let gaps = panels.windows(2).map(|pair| pair[1].top - bottom(&pair[0]));
        assert!(gaps.into_iter().all(|gap| (gap - GAP).abs() < 1e-9));
        assert_eq!(panels[0].top, 80.0);
        assert!((bottom(&panels[2]) - 80.0 - height_of(&panels)).abs() < 1e-9);
        let right = panels.iter().map(|panel| LEFT + panel.size[0]);
        assert!(right.fold(0.0, f64::max) <= 1200.0 - RIGHT + 1e-9);
    }

    #[test]
    fn a_body_of_any_shape_has_a_picture() {
        for (wide, high) in [(1.0, 1e-9), (1e-9, 1.0), (1.0, 1.0)] {
            let panel = panels(&[(bounds(wide, high), [0, 1])], 600.0)[0];
            assert!(panel.size.iter().all(|size| *size > 0.0 && *size < 700.0));
        }
    }
}

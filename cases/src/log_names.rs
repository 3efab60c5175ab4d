//! Names in the logs of runs.

/// Name of the time series of the reports of couplers, such as the power of a source.
pub const REPORTS: &str = "reports";

/// End of the names of columns of the balance with the error over the size of the quantity.
pub const RELATIVE_ERROR: &str = ".relative_error";

/// Field of the spacings of points, logged for clouds because pictures need it.
pub const SPACING: &str = "spacing";

/// Field of the plies of the points of a lay-up, counted from 1 from below, logged so that programs can choose plies.
pub const PLY: &str = "ply";

/// Largest error of a balance over its size. Rounding of sums over points and steps stays below 1e-14 in all cases of
/// the level everyday; what a scheme loses is larger.
pub const BALANCE_LIMIT: f64 = 1e-10;

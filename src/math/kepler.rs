//! Kepler's equation.

use super::real::{Real, sin_cos};

/// Eccentricities beyond which one more iteration of [`eccentric_anomaly`] is needed.
const MORE_ITERATIONS: [f64; 2] = [0.9, 0.4];

/// E with E − e sin E = M, and its sine and cosine, for |M| ≤ π and 0 ≤ e ≤ 0.99.
///
/// Two to four iterations of Householder's method of order four (A. S. Householder, *The Numerical Treatment of a Single Nonlinear
/// Equation* (1970), section 4.4, with three derivatives; one division each) from E = M ± 0.85 e (J. M. A. Danby, *The solution of Kepler's
/// equation III*, Celest. Mech. 40 (1987) 303), as many as leave an error below rounding. The last iteration changes E by less than 4e-4,
/// so that sine and cosine follow from those before it by their series. Rounding is at most 4 units of roundoff of π, divided by 1 − e.
#[inline(always)]
pub fn eccentric_anomaly<R: Real>(mean_anomaly: R, eccentricity: R) -> (R, R, R) {
    let start = R::splat(0.85) * eccentricity;
    let mut anomaly = mean_anomaly + R::select(mean_anomaly.less_than(R::splat(0.0)), -start, start);
    for greatest in MORE_ITERATIONS {
        let is_beyond = R::splat(greatest).less_than(eccentricity);
        if R::any(is_beyond) {
            let (change, ..) = anomaly_change(anomaly, mean_anomaly, eccentricity);
            anomaly = R::select(is_beyond, anomaly + change, anomaly);
        }
    }
    let (change, ..) = anomaly_change(anomaly, mean_anomaly, eccentricity);
    anomaly = anomaly + change;
    let (change, sin, cos) = anomaly_change(anomaly, mean_anomaly, eccentricity);
    // 1 − cos and the sine of the change.
    let square = change * change;
    let short = (square * square).mul_add(R::splat(-1.0 / 24.0), R::splat(0.5) * square);
    let turn = (square * change).mul_add(R::splat(-1.0 / 6.0), change);
    (anomaly + change, sin + (-sin).mul_add(short, cos * turn), cos - cos.mul_add(short, sin * turn))
}

/// The change of E by one iteration of [`eccentric_anomaly`], and the sine and cosine of E before it: with f = E − e sin E − M it is
/// −f (f'² − f f''/2) / (f' (f'² − f f'') + f² f'''/6).
#[inline(always)]
fn anomaly_change<R: Real>(anomaly: R, mean_anomaly: R, eccentricity: R) -> (R, R, R) {
    let (one, half, sixth) = (R::splat(1.0), R::splat(0.5), R::splat(1.0 / 6.0));
    let (sin, cos) = sin_cos(anomaly);
    let (e_sin, e_cos) = (eccentricity * sin, eccentricity * cos);
    let excess = (anomaly - mean_anomaly) - e_sin;
    let slope = one - e_cos;
    let (square, bend) = (slope * slope, excess * e_sin);
    let above = excess * half.mul_add(-bend, square);
    let below = slope.mul_add(square - bend, excess * excess * (sixth * e_cos));
    (-(above / below), sin, cos)
}

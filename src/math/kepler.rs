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
    // On a circle the iterations below change nothing, to the bit.
    if !R::any(R::splat(0.0).less_than(eccentricity)) {
        let (sin, cos) = sin_cos(mean_anomaly);
        return (mean_anomaly, sin, cos);
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::lanes::{LaneScalar, LaneTask};
    use crate::math::real::Scalar;

    /// Whether bodies on circles have the same result beside others on circles and beside others on ellipses.
    struct CirclesAmongEllipses;
    impl<T: Scalar> LaneTask<T> for CirclesAmongEllipses {
        type Output = ();
        #[inline(always)]
        fn run<R: Real<Scalar = T>>(self) {
            for part in -40..=40 {
                let mean = R::from_lanes(|lane| T::from_f64(0.07 * f64::from(part) + 0.003 * lane as f64 + 1e-3));
                let mixed = R::from_lanes(|lane| T::from_f64(if lane % 2 == 0 { 0.0 } else { 0.15 * lane as f64 }));
                let (circles, both) = (eccentric_anomaly(mean, R::splat(0.0)), eccentric_anomaly(mean, mixed));
                for (alone, among) in [(circles.0, both.0), (circles.1, both.1), (circles.2, both.2)] {
                    let [mut expected, mut found] = [[T::default(); 16]; 2];
                    alone.store(&mut expected);
                    among.store(&mut found);
                    for lane in (0..R::LANES).step_by(2) {
                        let [expected, found] = [expected[lane], found[lane]].map(|x| x.to_f64().to_bits());
                        assert_eq!(expected, found, "{part}, lane {lane} of {}", R::LANES);
                    }
                }
            }
        }
    }

    #[test]
    fn a_circle_needs_no_iteration() {
        f64::dispatch(CirclesAmongEllipses);
        f32::dispatch(CirclesAmongEllipses);
    }
}

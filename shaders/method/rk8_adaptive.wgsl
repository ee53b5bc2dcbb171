// rk8 with adaptive steps for each body, by its own estimate of each step's error. Twin: src/kernel/method/rk8_adaptive.rs, which
// describes the method, its controller and its limits.

// Tolerance and least step.
struct Limits {
    tolerance: real,
    least_step: real,
}

// The progress of a body in its interval, and the state of its step controller.
struct Controller {
    // The step to try next, in units of the body's own scale; 0 until one has been tried.
    step: real,
    // The remainder of the interval, in the same units; 0 at its end.
    left: TwoWordsReal,
    // 1 if the last attempt was rejected, otherwise 0.
    retried: real,
    // Accepted steps, and rejected ones, which were tried again with a smaller size.
    accepted: real,
    rejected: real,
}

// A body after some attempts.
struct Attempted {
    state: State,
    controller: Controller,
}

// The controller at the start of an interval of `span`.
fn over(controller: Controller, span: TwoWordsReal) -> Controller {
    return Controller(controller.step, span, controller.retried, controller.accepted, controller.rejected);
}

// Whether there is something left to do.
fn under_way(controller: Controller, state: State) -> bool {
    return 0.0 < controller.left.value && state.status < 0.5;
}

fn advance(
    body: Body,
    span: TwoWordsReal,
    limits: Limits,
    attempts: u32,
    controller: Controller,
    state: State,
) -> Attempted {
    var attempted = Attempted(state, controller);
    for (var n = 0u; n < attempts; n += 1u) {
        if (!under_way(attempted.controller, attempted.state)) {
            break;
        }
        attempted = attempt(body, span, limits, attempted.controller, attempted.state);
    }
    return attempted;
}

// The time of an attempt.
struct StepPlace {
    start: Start,
    h: real,
}

fn epoch_at(place: StepPlace, fraction: real) -> Epoch {
    return epoch_after(place.start, place.h * fraction);
}

// Tries one step; a body with nothing left to do does not change.
fn attempt(body: Body, span: TwoWordsReal, limits: Limits, controller: Controller, state: State) -> Attempted {
    let trying = under_way(controller, state);
    var step = controller.step;
    if (!(0.0 < step)) {
        step = first_step(body, span.value, limits.tolerance, state);
    }
    let left = controller.left;
    // A last step that would leave almost nothing takes the rest as well.
    let last = left.value < step * 1.01;
    let h = TwoWordsReal(select(step, left.value, last), select(real(0.0), left.residue, last));
    let difference = two_difference_real(span.value, left.value);
    let gone = TwoWordsReal(difference.value, difference.residue + (span.residue - left.residue));
    let place = StepPlace(start_at(gone), h.value);
    let tried = slopes(body, place, h.value, state);
    let next_state = advanced(tried, h, state);
    // NaN means that the step was far too long.
    let error = finite_or(estimated_error(tried, h.value, limits.tolerance, state, next_state), 1e30);
    let taken = trying && error < 1.0;
    let refused = trying && !taken;

    let remaining = two_difference_real(left.value, h.value);
    let rest = renormalised(remaining.value, remaining.residue + (left.residue - h.residue));

    let eighth_root = sqrt(sqrt(sqrt(max(error, 1e-20))));
    var factor = max(min(0.9 / eighth_root, 6.0), 1.0 / 3.0);
    // A step does not grow right after a rejection, and one that the end cut short says nothing about the next.
    factor = select(factor, min(factor, 1.0), 0.5 < controller.retried);
    var next = h.value * factor;
    next = select(next, max(next, step), taken && last);
    // A short first step, or a short last one, is no sign of difficulty.
    let shrunk = refused || (taken && !last && factor < 1.0);
    let too_small = shrunk && next < limits.least_step;

    var attempted = Attempted(state, controller);
    if (taken) {
        attempted.state = next_state;
        attempted.controller.left = rest;
        attempted.controller.accepted = controller.accepted + 1.0;
    }
    if (refused) {
        attempted.controller.rejected = controller.rejected + 1.0;
    }
    if (trying) {
        attempted.controller.step = next;
        attempted.controller.retried = select(real(0.0), real(1.0), refused);
    }
    attempted.state.status = flagged(attempted.state.status, too_small, STEP_BELOW_LIMIT);
    return attempted;
}

// a - b and its rounding error, exactly (Knuth, TAOCP vol. 2, 4.2.2, theorem B).
fn two_difference_real(a: real, b: real) -> TwoWordsReal {
    let difference = separated(a - b);
    let b_taken = separated(a - difference);
    let a_taken = separated(difference + b_taken);
    return TwoWordsReal(difference, separated(a - a_taken) - separated(b - b_taken));
}

// The two words of a sum a + b, for |a| >= |b| (Dekker, Numer. Math. 18 (1971) 224, equation 4.14).
fn renormalised(a: real, b: real) -> TwoWordsReal {
    let value = separated(a + b);
    return TwoWordsReal(value, b - separated(value - a));
}

// The first step: the angle whose eighth power is the tolerance, at the present rate or, if that is less, at one radian per unit of the
// body's own scale; at most the whole span.
fn first_step(body: Body, span: real, tolerance: real, state: State) -> real {
    let omega = body.inverse_moments.value * state.angular_momentum_principal.value;
    let rate = max(sqrt(dot_vector(omega, omega)), 1.0);
    return min(sqrt(sqrt(sqrt(tolerance))) / rate, span);
}

// DOP853's estimate of a step's error, in units of the tolerance.
fn estimated_error(tried: Slopes, h: real, tolerance: real, state: State, next_state: State) -> real {
    // Both sets of weights add up to 0, so that the first slope does not contribute to the sums of differences.
    let fifth = weighted(
        tried,
        0.0,
        -1.225156446376204440720569753,
        -4.957589496572501915214079952e-1,
        1.664377182454986536961530415,
        -3.503288487499736816886487290e-1,
        3.341791187130174790297318841e-1,
        8.192320648511571246570742613e-2,
        -2.235530786388629525884427845e-2,
    );
    let third = weighted(
        tried,
        0.0,
        4.45031289275240888144113950566,
        1.89151789931450038304281599044,
        -5.8012039600105847814672114227,
        3.1116436695781989440891606237e-1 - 7.33846688281611857341361741547e-1,
        -1.52160949662516078556178806805e-1,
        2.01365400804030348374776537501e-1,
        4.47106157277725905176885569043e-2 - 2.20588235294117647058823529412e-2,
    );
    let m = state.angular_momentum_principal.value;
    let m_next = next_state.angular_momentum_principal.value;
    let m_squared = max(max(dot_vector(m, m), dot_vector(m_next, m_next)), 1e-30);
    let inverse = 1.0 / tolerance;
    let e5 = squared(fifth, m_squared, inverse);
    let e3 = squared(third, m_squared, inverse);
    let sum = max(mul_add(e3, 0.01, e5), 1e-30);
    return abs(h) * e5 / sqrt(sum * 7.0);
}

// The square of a slope, with the angular momentum's part relative to m, in units of the tolerance.
fn squared(slope: Slope, m_squared: real, inverse_tolerance: real) -> real {
    let q = slope.q * inverse_tolerance;
    let m = slope.m * inverse_tolerance;
    return norm_squared(q) + dot_vector(m, m) / m_squared;
}

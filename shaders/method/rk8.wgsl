// rk8: Dormand and Prince's Runge-Kutta method of order 8 on (q, m). Twin: src/kernel/method/rk8.rs, which describes the method.
// The time of a step is a StepPlace, declared by the chunk that takes the step: rk8_equal.wgsl or rk8_adaptive.wgsl.

// A slope minus the first one.
fn less(slope: Slope, first: Slope) -> Slope {
    return Slope(slope.q - first.q, slope.m - first.m);
}

// A sum of slopes, with one more added.
fn more(sum: Slope, weight: real, difference: Slope) -> Slope {
    return Slope(axpy_quaternion(difference.q, weight, sum.q), axpy_vector(difference.m, weight, sum.m));
}

// The rates at the end of a stage's sum of slopes, minus the first.
fn stage(body: Body, epoch: Epoch, correction: Correction, h: real, state: State, first: Slope, sum: Slope) -> Slope {
    let q = axpy_quaternion(sum.q, h, state.orientation.value);
    let m = axpy_vector(sum.m, h, state.angular_momentum_principal.value);
    return less(rates(body, epoch, correction, q, m), first);
}

// A slope times a number.
fn times(slope: Slope, factor: real) -> Slope {
    return Slope(slope.q * factor, slope.m * factor);
}

// The slope at the start of a step, and the differences of those of the other stages from it; the second to the fifth do not contribute to
// a step's end or its error.
struct Slopes {
    first: Slope,
    d6: Slope,
    d7: Slope,
    d8: Slope,
    d9: Slope,
    d10: Slope,
    d11: Slope,
    d12: Slope,
}

// first * first_weight + the sum of weights * differences.
fn weighted(slopes: Slopes, first: real, w6: real, w7: real, w8: real, w9: real, w10: real, w11: real, w12: real) -> Slope {
    var sum = times(slopes.first, first);
    sum = more(sum, w6, slopes.d6);
    sum = more(sum, w7, slopes.d7);
    sum = more(sum, w8, slopes.d8);
    sum = more(sum, w9, slopes.d9);
    sum = more(sum, w10, slopes.d10);
    sum = more(sum, w11, slopes.d11);
    sum = more(sum, w12, slopes.d12);
    return sum;
}

// The slopes of all stages of a step of h at a given time.
fn slopes(body: Body, place: StepPlace, h: real, state: State) -> Slopes {
    let q = state.orientation.value;
    let c = correction(body, state);
    let first = rates(body, epoch_at(place, 0.0), c, q, state.angular_momentum_principal.value);
    var sum: Slope;

    sum = times(first, 5.26001519587677318785587544488e-2);
    let d2 = stage(body, epoch_at(place, 5.26001519587677318785587544488e-2), c, h, state, first, sum);

    sum = times(first, 7.89002279381515978178381316732e-2);
    sum = more(sum, 5.91751709536136983633785987549e-2, d2);
    let d3 = stage(body, epoch_at(place, 7.89002279381515978178381316732e-2), c, h, state, first, sum);

    sum = times(first, 1.1835034190722739672675719751e-1);
    sum = more(sum, 8.87627564304205475450678981324e-2, d3);
    let d4 = stage(body, epoch_at(place, 1.1835034190722739672675719751e-1), c, h, state, first, sum);

    sum = times(first, 2.8164965809277260327324280249e-1);
    sum = more(sum, -8.84549479328286085344864962717e-1, d3);
    sum = more(sum, 9.24834003261792003115737966543e-1, d4);
    let d5 = stage(body, epoch_at(place, 2.8164965809277260327324280249e-1), c, h, state, first, sum);

    sum = times(first, 1.0 / 3.0);
    sum = more(sum, 1.70828608729473871279604482173e-1, d4);
    sum = more(sum, 1.25467687566822425016691814123e-1, d5);
    let d6 = stage(body, epoch_at(place, 1.0 / 3.0), c, h, state, first, sum);

    sum = times(first, 0.25);
    sum = more(sum, 1.70252211019544039314978060272e-1, d4);
    sum = more(sum, 6.02165389804559606850219397283e-2, d5);
    sum = more(sum, -1.7578125e-2, d6);
    let d7 = stage(body, epoch_at(place, 0.25), c, h, state, first, sum);

    sum = times(first, 4.0 / 13.0);
    sum = more(sum, 1.70383925712239993810214054705e-1, d4);
    sum = more(sum, 1.07262030446373284651809199168e-1, d5);
    sum = more(sum, -1.53194377486244017527936158236e-2, d6);
    sum = more(sum, 8.27378916381402288758473766002e-3, d7);
    let d8 = stage(body, epoch_at(place, 4.0 / 13.0), c, h, state, first, sum);

    sum = times(first, 127.0 / 195.0);
    sum = more(sum, -3.36089262944694129406857109825, d4);
    sum = more(sum, -8.68219346841726006818189891453e-1, d5);
    sum = more(sum, 2.75920996994467083049415600797e1, d6);
    sum = more(sum, 2.01540675504778934086186788979e1, d7);
    sum = more(sum, -4.34898841810699588477366255144e1, d8);
    let d9 = stage(body, epoch_at(place, 127.0 / 195.0), c, h, state, first, sum);

    sum = times(first, 0.6);
    sum = more(sum, -2.48811461997166764192642586468, d4);
    sum = more(sum, -5.90290826836842996371446475743e-1, d5);
    sum = more(sum, 2.12300514481811942347288949897e1, d6);
    sum = more(sum, 1.52792336328824235832596922938e1, d7);
    sum = more(sum, -3.32882109689848629194453265587e1, d8);
    sum = more(sum, -2.03312017085086261358222928593e-2, d9);
    let d10 = stage(body, epoch_at(place, 0.6), c, h, state, first, sum);

    sum = times(first, 6.0 / 7.0);
    sum = more(sum, 5.18637242884406370830023853209, d4);
    sum = more(sum, 1.09143734899672957818500254654, d5);
    sum = more(sum, -8.14978701074692612513997267357, d6);
    sum = more(sum, -1.85200656599969598641566180701e1, d7);
    sum = more(sum, 2.27394870993505042818970056734e1, d8);
    sum = more(sum, 2.49360555267965238987089396762, d9);
    sum = more(sum, -3.0467644718982195003823669022, d10);
    let d11 = stage(body, epoch_at(place, 6.0 / 7.0), c, h, state, first, sum);

    sum = times(first, 1.0);
    sum = more(sum, -1.05344954667372501984066689879e1, d4);
    sum = more(sum, -2.00087205822486249909675718444, d5);
    sum = more(sum, -1.79589318631187989172765950534e1, d6);
    sum = more(sum, 2.79488845294199600508499808837e1, d7);
    sum = more(sum, -2.85899827713502369474065508674, d8);
    sum = more(sum, -8.87285693353062954433549289258, d9);
    sum = more(sum, 1.23605671757943030647266201528e1, d10);
    sum = more(sum, 6.43392746015763530355970484046e-1, d11);
    let d12 = stage(body, epoch_at(place, 1.0), c, h, state, first, sum);

    return Slopes(first, d6, d7, d8, d9, d10, d11, d12);
}

// The state after a step of dt with these slopes.
fn advanced(slopes: Slopes, dt: TwoWordsReal, state: State) -> State {
    let sum = weighted(
        slopes,
        1.0,
        4.45031289275240888144113950566,
        1.89151789931450038304281599044,
        -5.8012039600105847814672114227,
        3.1116436695781989440891606237e-1,
        -1.52160949662516078556178806805e-1,
        2.01365400804030348374776537501e-1,
        4.47106157277725905176885569043e-2,
    );
    let q = state.orientation.value;
    let restoring = norm_correction_of_step(q, axpy_quaternion(sum.q, dt.value, q));
    let q_increment = axpy_quaternion(
        sum.q, dt.value, rounded_quaternion(axpy_quaternion(sum.q, dt.residue, restoring)));
    let m_increment = axpy_vector(sum.m, dt.value, rounded_vector(sum.m * dt.residue));
    return State(
        accumulate_quaternion(state.orientation, q_increment),
        accumulate_vector(state.angular_momentum_principal, m_increment),
        state.status,
    );
}

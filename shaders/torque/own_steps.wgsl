// Times of adaptive steps, which start independently for each body. Twin: src/torque/sum/columns.rs and ticks_in in src/math/clock.rs.

// The start of a step.
struct Start {
    // Whole ticks since the initial state, low word first.
    ticks: vec2<u32>,
    // Seconds in a unit of the body's own time: a power of two.
    seconds: real,
}

// The start of a step `time` after the start of the interval, in units of the body's own scale.
fn start_at(time: TwoWordsReal) -> Start {
    let rate = torque_column(RATE_COLUMN);
    // The rate is a power of two, so one correction makes the quotient exact, which a driver may compute only to a few units.
    let estimate = 1.0 / rate;
    let seconds = mul_add(estimate, 1.0 - rate * estimate, estimate);
    let ticks = ticks_in(TwoWordsReal(time.value * seconds, time.residue * seconds));
    return Start(sum_64(settings.ticks, ticks), seconds);
}

// What depends only on time, `elapsed` after the start of the step, in the same units.
fn epoch_after(start: Start, elapsed: real) -> Epoch {
    let instant = Instant(start.ticks, elapsed * start.seconds);
    return Epoch(instant, vector(0.0, 0.0, 0.0), change_at(instant));
}

// a + b modulo 2^64.
fn sum_64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = add_with_carry(a.x, b.x, 0u);
    return vec2<u32>(low.x, a.y + b.y + low.y);
}

// Whole ticks in a time (s) in two words, each rounded towards 0: wrong by at most two ticks, 2^-59 of the span.
fn ticks_in(time: TwoWordsReal) -> vec2<u32> {
    return sum_64(whole_ticks(time.value), whole_ticks(time.residue));
}

// Whole ticks in less than the span of a run, which has below 2^61; negative ones as their complement.
fn whole_ticks(seconds: real) -> vec2<u32> {
    // In units of 2^32 ticks; exact, as is all that follows. The scale alone would leave the range of f32 for short spans.
    let ticks = abs(seconds) * settings.tick_scale * 268435456.0;
    let high = u32(ticks);
    let low = u32((ticks - real(high)) * 4294967296.0);
    let magnitude = vec2<u32>(low, high);
    return select(magnitude, sum_64(~magnitude, vec2<u32>(1u, 0u)), seconds < 0.0);
}

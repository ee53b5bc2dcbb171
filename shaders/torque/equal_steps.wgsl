// Times of equal steps, and the random torques drawn for them. Twin: src/torque/sum/columns.rs and src/torque/sum/noise.rs.

fn epoch(step: u32, fraction: real) -> Epoch {
    // Steps since the dispatch's first one, whose time is in the settings.
    let steps = step - settings.first_step;
    let now = sum_128(settings.clock, product_128(settings.clock_step, steps));
    let low = settings.run_step.x + steps;
    let run_step = vec2<u32>(low, settings.run_step.y + select(0u, 1u, low < steps));
    let elapsed = fraction * settings.dt_value;
    let instant = Instant(now.zw, elapsed);
    return Epoch(instant, noise(run_step), change_at(instant));
}

// The torque of all instances of white noise over a step.
fn noise(step: vec2<u32>) -> vector {
    var sum = vector(0.0, 0.0, 0.0);
    for (var k = 0u; k < white_noise_count; k += 1u) {
        let first = white_noise_first + k * WHITE_NOISE_COLUMNS;
        let draws = u32(torque_column(first + 1u));
        let body = vec2<u32>(word_at(first + 2u), word_at(first + 4u));
        let seed = vec2<u32>(word_at(first + 6u), word_at(first + 8u));
        // step * draws, in two words.
        let low = wide_product(step.x, draws);
        var draw = vec2<u32>(low.x, low.y + step.y * draws);
        var draw_sum = vector(0.0, 0.0, 0.0);
        for (var n = 0u; n < draws; n += 1u) {
            draw_sum = draw_sum + normal_vector(philox(vec4<u32>(body, draw), seed));
            draw.x += 1u;
            draw.y += select(0u, 1u, draw.x == 0u);
        }
        sum = axpy_vector(draw_sum, torque_column(first) * settings.inverse_root_dt, sum);
    }
    return sum;
}

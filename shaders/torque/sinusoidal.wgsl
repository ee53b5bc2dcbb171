// sinusoidal: a torque in body axes that oscillates; the phase is in turns. Twin: src/torque/sinusoidal.rs.

fn sinusoidal(sine: vector, cosine: vector, phase: real) -> vector {
    let angle = sin_cos(phase * TAU);
    return axpy_vector(sine, angle.sin, cosine * angle.cos);
}

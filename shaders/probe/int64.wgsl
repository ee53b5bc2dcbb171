// The barrier in 64 bits, if the adapter has 64-bit integers.

fn barrier(x: real) -> real {
    return bitcast<f64>(bitcast<u64>(x) ^ u64(settings.zero));
}

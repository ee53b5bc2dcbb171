// A rounded intermediate of a sum that is carried in two words in either precision, such as time: in 64 bits, where the adapter has
// 64-bit integers. As `rounded` in real_f32.wgsl.
fn separated(x: real) -> real {
    return bitcast<f64>(bitcast<u64>(x) ^ u64(settings.zero));
}

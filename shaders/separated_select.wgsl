// The same without 64-bit integers, where the bits of an f64 are not accessible. Compilers of some drivers re-associate through a choice
// (NVIDIA 580 does): there times of adaptive steps are wrong by an ulp or two. The probe says whether it holds.
fn separated(x: real) -> real {
    return select(x, real(0.0), settings.zero != 0u);
}

#!/usr/bin/env bash
# The unsafe code under Miri, which finds what Rust does not define: the token of an instruction set and what is computed with it, in
# lanes of AVX2 and one by one. Miri is installed where it is missing. It interprets, so that only the tests of lanes run, for minutes.
#
#     bash tests/miri.sh
set -eu
cd "$(dirname "$0")/.."
rustup toolchain list | grep -q '^nightly' || rustup toolchain install nightly --profile minimal
rustup component add --toolchain nightly miri rust-src
# A folder of its own, as in `msrv.sh`.
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-target}/miri"
for features in "+avx2,+fma" ""; do
    RUSTFLAGS="-C target-feature=$features" cargo +nightly miri test --no-default-features --lib math::lanes "$@"
done

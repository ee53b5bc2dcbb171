#!/usr/bin/env bash
# Builds the library, the command and the tests with the oldest compiler that Cargo.toml promises. It is installed where it is missing.
set -eu
cd "$(dirname "$0")/.."
version="$(sed -n 's/^rust-version = "\(.*\)"$/\1/p' Cargo.toml)"
# It may be installed by its full number, as 1.2.3 for 1.2.
toolchain="$(rustup toolchain list | sed -n "s/^\(${version//./\\.}\(\.[0-9]*\)\?\)-.*/\1/p" | head -n 1)"
if [ -z "$toolchain" ]; then
    rustup toolchain install "$version" --profile minimal
    toolchain="$version"
fi
# A folder of its own: two compilers in one would build everything anew in turn.
CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-target}/msrv" cargo "+$toolchain" check --all-targets "$@"
CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-target}/msrv" cargo "+$toolchain" check --no-default-features "$@"
echo "Rust $version builds everything"

#!/usr/bin/env bash
# Builds the library, the command and the tests with the oldest compiler that Cargo.toml promises. It is installed where it is missing.
set -eu
cd "$(dirname "$0")/.."
version="$(sed -n 's/^rust-version = "\(.*\)"$/\1/p' Cargo.toml)"
rustup toolchain list | grep -q "^$version" || rustup toolchain install "$version" --profile minimal
# A folder of its own: two compilers in one would build everything anew in turn.
CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-target}/msrv" cargo "+$version" check --all-targets "$@"
CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-target}/msrv" cargo "+$version" check --no-default-features "$@"
echo "Rust $version builds everything"

#!/usr/bin/env bash
# Builds the wheel, installs it in a fresh virtual environment and tests it there: bash python/test.sh [pytest arguments]
#
# Needs Rust, a C compiler and Python from 3.10 on. What was built and installed stays in python/target.
set -eu
cd "$(dirname "$0")"
python="${PYTHON:-python3}"

step() { printf '\n== %s (%s s)\n' "$1" "$SECONDS"; }

step "tools"
tools=target/tools
[ -x "$tools/bin/maturin" ] || { "$python" -m venv "$tools" && "$tools/bin/pip" install --quiet "maturin>=1.9,<2"; }

step "wheel"
rm -rf target/wheels
"$tools/bin/maturin" build --release --locked --quiet --interpreter "$python" --out target/wheels
wheel=$(echo target/wheels/*.whl)
size=$(stat -c '%s' "$wheel" 2>/dev/null || stat -f '%z' "$wheel")
printf '%s: %s MB\n' "$(basename "$wheel")" "$(awk "BEGIN { printf \"%.1f\", $size / 1e6 }")"
[ "$size" -lt 15000000 ] || { echo "the wheel is larger than 15 MB"; exit 1; }

step "fresh environment"
rm -rf target/fresh
"$python" -m venv target/fresh
target/fresh/bin/pip install --quiet "$wheel[test]"

# From another folder, so that the installed package is tested and not the sources beside it.
step "tests"
tests=$PWD/tests
fresh=$PWD/target/fresh
(cd "$fresh" && bin/python -I -m pytest -q -p no:cacheprovider -c "$tests/../pyproject.toml" --rootdir "$tests" "$tests" "$@")

step "formatting and lints"
cargo fmt --all -- --check
cargo clippy --release --all-targets -- -D warnings

step "done"

#!/usr/bin/env bash
# Writes the table of docs/grid.md anew: methods × torques × precisions × engines. By hand: four to six minutes on two cores.
set -euo pipefail
cd "$(dirname "$0")/.."
export NODEVICE_SELECT=1
found="$(mktemp)"
trap 'rm -f "$found" "$found.all"' EXIT
cargo test --test mirror verify::grid::the_grid -- --ignored --nocapture | tee "$found.all" | grep '^[|#]' >"$found" || { tail -20 "$found.all"; exit 1; }
grep -q '^| largest part' "$found"
# What stands above the first table stays.
head="$(sed '/^## /,$d; /^Commit /d' docs/grid.md)"
{
    printf '%s\n\n' "$head"
    echo "Commit $(git rev-parse --short HEAD), $(date +%F), $(rustc --version)."
    sed 's/^## .*/\n&\n/' "$found"
} >docs/grid.md.new
mv docs/grid.md.new docs/grid.md

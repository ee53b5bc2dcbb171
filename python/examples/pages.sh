#!/usr/bin/env bash
# Runs the examples and writes them as pages with their output and pictures: bash python/examples/pages.sh [name ...]
#
# Needs a Python with polhode[all] and what requirements.txt here lists; PYTHON names another than python3. Pages go to docs/python.
set -eu
cd "$(dirname "$0")"
python="${PYTHON:-python3}"
pages=../../docs/python
[ $# -gt 0 ] || set -- intermediate_axis bdot debris comparison
notebooks=$(mktemp -d)
# A page is no place for a bar.
export TQDM_DISABLE=1
trap 'rm -rf "$notebooks"' EXIT
mkdir -p "$pages"
for name in "$@"; do
    "$python" -m jupytext --quiet --to ipynb --output "$notebooks/$name.ipynb" "$name.py"
    rm -rf "$pages/${name}_files"
    "$python" -m nbconvert --log-level ERROR --execute --to markdown --output-dir "$pages" "$notebooks/$name.ipynb"
    echo "docs/python/$name.md"
done

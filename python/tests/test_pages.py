"""What the pages show runs: the READMEs' code and the examples."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1]
EXAMPLES = ["intermediate_axis", "bdot", "debris"]
"""Those that need nothing but the package and matplotlib."""


def blocks(file):
    return re.findall(r"```python\n(.*?)```", file.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("file, count", [(SOURCE / "README.md", 3), (SOURCE.parent / "README.md", 1)], ids=["package", "repository"])
def test_the_code_of_the_readme_runs(file, count):
    found = blocks(file)
    assert len(found) == count
    for block in found:
        exec(block, {})


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_run(name, tmp_path):
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    script = str(SOURCE / "examples" / f"{name}.py")
    done = subprocess.run([sys.executable, "-W", "error::DeprecationWarning", script], capture_output=True, text=True, cwd=tmp_path, env=environment)
    assert done.returncode == 0, done.stderr
    assert "failed   none" in done.stdout


@pytest.mark.parametrize("name", [*EXAMPLES, "comparison"])
def test_pages_hold_the_code_of_their_scripts(name):
    """Else `bash python/examples/pages.sh` is to be run again."""
    script = (SOURCE / "examples" / f"{name}.py").read_text(encoding="utf-8")
    cells = [cell.split("\n", 1) for cell in script.split("# %%")[1:]]
    code = [text.strip() for mark, text in cells if "markdown" not in mark]
    page = SOURCE.parent / "docs" / "python" / f"{name}.md"
    assert [block.strip() for block in blocks(page)] == code
    assert re.search(rf"!\[png\]\({name}_files/.*\.png\)", page.read_text(encoding="utf-8"))

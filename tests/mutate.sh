#!/usr/bin/env bash
# Plants the faults of tests/mutations.txt, one at a time, in a copy of the tree, runs the test that stands beside each, and says which
# are caught. By hand: the copy is built anew, which takes a quarter of an hour on two cores.
#
#   bash tests/mutate.sh [--check] [--only TEXT] [--numbers 1,2] [--record] [--alone] [--keep FOLDER]
#
#   --check         says which entries no longer apply and builds nothing; tests/mirror/planted_faults.rs holds them to it in every run
#   --only TEXT     only entries whose name or file contains TEXT; may be given several times
#   --record        writes what came of each into the table
#   --alone         rewrites and rebuilds the copy for each fault, without the switch: slow, for one that is doubted
#   --numbers 1,2   only these, as they are printed
#   --keep FOLDER   works in this folder and leaves it there (else one under $TMPDIR, which is removed)
#
# So that one build does for all, each expression of the copy is written as `if fault N is on { faulty } else { right }`, and texts of shaders
# are changed as they are loaded; the variable POLHODE_FAULT says which. A fault is CAUGHT when its test fails with it and passes without it.
# It is not when the test passes, fails by itself, or fails because a faulty shader does not compile. Exit status 1 where one is not caught.
set -eu
cd "$(dirname "$0")/.."
exec nice -n 19 python3 - "$@" <<'PYTHON'
import argparse, collections, datetime, json, os, pathlib, re, shutil, subprocess, sys, tempfile

TABLE = pathlib.Path("tests/mutations.txt")
TIMEOUT = 900

FAULT_RS = '''//! Which fault is on, in a copy of the tree that tests/mutate.sh has made.
#![allow(missing_docs)]
use std::borrow::Cow;
use std::sync::atomic::{AtomicU32, Ordering};

static ON: AtomicU32 = AtomicU32::new(u32::MAX);

#[cold]
fn first() -> u32 {
    let on = std::env::var("POLHODE_FAULT").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
    ON.store(on, Ordering::Relaxed);
    on
}

#[cold]
fn reached() {
    if let Ok(mark) = std::env::var("POLHODE_FAULT_MARK") {
        if !std::path::Path::new(&mark).exists() {
            let _ = std::fs::write(mark, "");
        }
    }
}

#[inline(always)]
pub fn is(fault: u32) -> bool {
    let mut on = ON.load(Ordering::Relaxed);
    if on == u32::MAX {
        on = first();
    }
    if on == fault {
        reached();
    }
    on == fault
}

pub fn shader(file: &'static str, text: &'static str) -> Cow<'static, str> {
    for &(fault, faulty, from, to) in SHADERS {
        if faulty == file && is(fault) {
            return Cow::Owned(text.replace(from, to));
        }
    }
    Cow::Borrowed(text)
}

static SHADERS: &[(u32, &str, &str, &str)] = &[
%s];
'''


class Fault:
    def __init__(self, number, lines):
        self.number, self.lines = number, lines
        self.name, self.file = lines[0], lines[1]
        part = lambda mark: next(line[2:] for line in lines if line.startswith(mark + " "))
        self.old, self.new = part("-"), part("+")
        self.test, _, self.filter = part("=").partition(" ")
        self.is_shader = self.file.startswith("shaders/")
        text = pathlib.Path(self.file).read_text()
        plain = self.old.replace("«", "").replace("»", "")
        self.applies = text.count(plain) == 1 or (self.is_shader and plain in text)
        self.plain = plain

    def parts(self):
        """What stands before, the expression, and what stands behind."""
        if "«" not in self.old:
            return "", self.old, ""
        before, rest = self.old.split("«")
        expression, after = rest.split("»")
        return before, expression, after


def read_table():
    blocks, block = [], []
    for line in TABLE.read_text().splitlines() + [""]:
        if line.startswith("#"):
            continue
        if line.strip():
            block.append(line)
        elif block:
            blocks.append(block)
            block = []
    return [Fault(number + 1, block) for number, block in enumerate(blocks)]


def copy_tree(folder, changed):
    """The tree with the texts of some files changed; what is the same is not touched, so that it is not built again."""
    names = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "-z"], capture_output=True, check=True).stdout
    for name in filter(None, names.decode().split("\0")):
        source, target = pathlib.Path(name), folder / name
        if not source.exists():
            continue
        wanted = changed[name].encode() if name in changed else source.read_bytes()
        target.parent.mkdir(parents=True, exist_ok=True)
        if not target.exists() or target.read_bytes() != wanted:
            target.write_bytes(wanted)
            shutil.copymode(source, target)
    for name, text in changed.items():
        target = folder / name
        if not pathlib.Path(name).exists() and not (target.exists() and target.read_text() == text):
            target.write_text(text)


def all_planted(faults):
    """The files that change when every fault is there behind its switch."""
    texts = {}
    same = collections.defaultdict(list)
    for fault in faults:
        if not fault.is_shader:
            same[(fault.file, fault.old)].append(fault)
    for (file, _), group in same.items():
        before, expression, after = group[0].parts()
        text = texts.get(file) or pathlib.Path(file).read_text()
        switch = "".join(f"if crate::fault::is({fault.number}) {{ {fault.new} }} else " for fault in group)
        assert text.count(before + expression + after) == 1, group[0].name
        texts[file] = text.replace(before + expression + after, f"{before}({switch}{{ {expression} }}){after}")
    raw = lambda text: 'r###"' + text + '"###'
    rows = "".join(
        f"    ({fault.number}, {raw(fault.file.removeprefix('shaders/'))}, {raw(fault.plain)}, {raw(fault.new)}),\n"
        for fault in faults
        if fault.is_shader
    )
    texts["src/fault.rs"] = FAULT_RS % rows
    lib = texts.get("src/lib.rs") or pathlib.Path("src/lib.rs").read_text()
    texts["src/lib.rs"] = lib.replace("\npub mod ", "\n#[doc(hidden)]\npub mod fault;\npub mod ", 1)
    shader = texts.get("src/engine/gpu/shader.rs") or pathlib.Path("src/engine/gpu/shader.rs").read_text()
    plain = 'Cow::Borrowed(include_str!(concat!("../../../shaders/", $file)))'
    assert shader.count(plain) == 1
    switched = 'crate::fault::shader($file, include_str!(concat!("../../../shaders/", $file)))'
    texts["src/engine/gpu/shader.rs"] = shader.replace(plain, switched)
    return texts


def one_planted(fault):
    before, _, after = fault.parts()
    return {fault.file: pathlib.Path(fault.file).read_text().replace(fault.plain, before + fault.new + after)}


def build(folder, tests):
    command = ["cargo", "test", "--offline", "--no-run", "--message-format=json"]
    for test in tests:
        command += ["--test", test]
    found = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, text=True)
    if found.returncode != 0:
        for line in found.stdout.splitlines():
            message = json.loads(line).get("message") or {}
            if isinstance(message, dict) and message.get("level") == "error":
                print(message.get("rendered", ""))
        return None
    binaries = {}
    for line in found.stdout.splitlines():
        message = json.loads(line)
        if message.get("executable") and "test" in message["target"]["kind"]:
            binaries[message["target"]["name"]] = message["executable"]
    return binaries


def run(folder, binary, only, number):
    mark = folder / "reached"
    mark.unlink(missing_ok=True)
    environment = dict(os.environ, POLHODE_FAULT=str(number), POLHODE_FAULT_MARK=str(mark), NODEVICE_SELECT="1",
                       CARGO_MANIFEST_DIR=str(folder), INSTA_UPDATE="no")
    try:
        found = subprocess.run([binary] + ([only] if only else []), cwd=folder, env=environment, text=True, errors="replace",
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=TIMEOUT)
        output, status = found.stdout, found.returncode
    except subprocess.TimeoutExpired:
        output, status = "", "no end"
    count = re.search(r"^running (\d+) test", output, re.M)
    return status, int(count.group(1)) if count else 0, output, mark.exists()


def judged(fault, status, output, reached, has_switch):
    if status == 0:
        return "NOT CAUGHT" + ("" if reached or not has_switch else " (its place is never reached)")
    if status == "no end":
        return "caught, as the test does not end"
    if re.search(r"\.wgsl:\d+: |Shader \{ file|recorded text.*:\d+: ", output):
        return "DOES NOT COMPILE"
    names = re.findall(r"^test (\S+) \.\.\. FAILED", output, re.M)
    return "caught by " + ", ".join(names[:2]) if names else "FAILED WITHOUT A TEST"


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--check", action="store_true")
    arguments.add_argument("--only", action="append", default=[])
    arguments.add_argument("--record", action="store_true")
    arguments.add_argument("--alone", action="store_true")
    arguments.add_argument("--keep")
    arguments.add_argument("--numbers", type=lambda text: {int(number) for number in text.split(",")})
    options = arguments.parse_args()
    every = read_table()
    if options.numbers:
        options.only = [""]
    faults = [f for f in every if not options.only or any(only in f.name or only in f.file for only in options.only)]
    faults = [f for f in faults if not options.numbers or f.number in options.numbers]
    results = {fault.number: "DOES NOT APPLY" for fault in faults if not fault.applies}
    usable = [fault for fault in faults if fault.applies]
    if options.check:
        for number in results:
            print(f"{number:3} {every[number - 1].name} ({every[number - 1].file}): DOES NOT APPLY")
        print(f"{len(usable)} of {len(faults)} faults apply")
        sys.exit(1 if results else 0)
    folder = pathlib.Path(options.keep or tempfile.mkdtemp(prefix="polhode-faults-"))
    folder.mkdir(parents=True, exist_ok=True)
    tests = sorted({fault.test for fault in usable})
    baselines = {}

    def judge_baseline(fault, binaries):
        """Whether its test passes while no fault is on."""
        key = (fault.test, fault.filter)
        if key in baselines:
            return
        status, count, output, _ = run(folder, binaries[fault.test], fault.filter, 0)
        baselines[key] = None if status == 0 and count > 0 else "NO SUCH TEST" if count == 0 else "FAILS BY ITSELF"
        if baselines[key]:
            print(output[-2000:])

    def tried(fault, binaries, number):
        if baselines[(fault.test, fault.filter)]:
            return baselines[(fault.test, fault.filter)]
        status, count, output, reached = run(folder, binaries[fault.test], fault.filter, number)
        panic = re.search(r"panicked at [^\n]*\n([^\n]*)", output)
        if panic:
            print("      " + panic.group(1)[:160])
        return "NO SUCH TEST" if count == 0 and status == 0 else judged(fault, status, output, reached, not options.alone)

    try:
        copy_tree(folder, {} if options.alone else all_planted([fault for fault in every if fault.applies]))
        binaries = build(folder, tests)
        if binaries is None:
            sys.exit("the copy does not compile")
        for fault in usable:
            judge_baseline(fault, binaries)
        for fault in usable:
            if options.alone:
                copy_tree(folder, one_planted(fault))
                binaries = build(folder, [fault.test])
                results[fault.number] = "DOES NOT COMPILE" if binaries is None else tried(fault, binaries, 0)
            else:
                results[fault.number] = tried(fault, binaries, fault.number)
            print(f"{fault.number:3} {fault.name}: {results[fault.number]}", flush=True)
    finally:
        if not options.keep:
            shutil.rmtree(folder)

    caught = [n for n, result in results.items() if result.startswith("caught")]
    print(f"\n{len(caught)} of {len(results)} faults are caught")
    for fault in faults:
        if not results[fault.number].startswith("caught"):
            print(f"{fault.number:3} {fault.name} ({fault.file}): {results[fault.number]}")
    if options.record:
        today = datetime.date.today().isoformat()
        text = TABLE.read_text()
        for fault in faults:
            block = "\n".join(fault.lines)
            kept = "\n".join(line for line in fault.lines if not line.startswith(": "))
            assert text.count(block + "\n") == 1, fault.name
            text = text.replace(block + "\n", f"{kept}\n: {today} {results[fault.number]}\n")
        TABLE.write_text(text)
    sys.exit(0 if len(caught) == len(results) else 1)


main()
PYTHON

"""Tables and pictures from the rows of peers.csv."""

import csv
import math
import os
import platform
import re

from problems import PROBLEMS

COLUMNS = (
    "date commit platform cpu cores python threads clock machine_note load problem span_s bodies bodies_run program "
    "program_version setting asked_rad rounds seconds_min seconds_median cpu_share body_seconds_per_second "
    "attitude_rad_median attitude_rad_p99 attitude_rad_max sample truth_check_rad compile_seconds process_seconds "
    "plan_seconds compute_seconds sample_seconds method precision met note"
).split()
TARGETS = [10.0**-digits for digits in range(3, 14)]
SHORT_TARGETS = [10.0**-digits for digits in (3, 5, 7, 9, 11, 13)]
PROGRAMS = ("polhode", "polhode taylor", "polhode rk8", "heyoka", "numba", "SciPy")
# Points further apart than this are not joined by a line to read values from.
FARTHEST = 100.0
MARKS = "<!-- benches/peers: from here", "<!-- benches/peers: to here -->"


def processor():
    """The processor's name as the system gives it."""
    try:
        with open("/proc/cpuinfo") as file:
            names = re.findall(r"^model name\s*:\s*(.+)$", file.read(), re.MULTILINE)
    except OSError:
        names = []
    return names[0].strip() if names else platform.processor() or platform.machine()


def machine_folder():
    return re.sub(r"[^a-z0-9]+", "-", f"{processor()} {os.cpu_count()} cores".lower()).strip("-")


def write_rows(path, rows, columns=COLUMNS):
    partial = path.with_suffix(".partial")
    with open(partial, "w", newline="") as file:
        writer = csv.DictWriter(file, columns, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    partial.replace(path)


def read_rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def points(rows, problem, bodies, program):
    """(error, speed) of a program, by error; SciPy's and the pinned methods' only where they were run."""
    return sorted(
        (float(row["attitude_rad_p99"]), float(row["body_seconds_per_second"]))
        for row in rows
        if (row["problem"], int(row["bodies"]), row["program"]) == (problem, bodies, program)
        and row["attitude_rad_p99"]
    )


def front(measured):
    """Those points that no other beats in both error and speed, by error; both rise along it."""
    result = []
    for error, speed in sorted(measured, key=lambda point: (point[0], -point[1])):
        if not result or speed > result[-1][1]:
            result.append((error, speed))
    return result


def speed_at(measured, error):
    """The speed at an error no worse than `error`: on the front, between its points by a line in logarithms.

    None where no point is as accurate.
    """
    edge = front(measured)
    below = [point for point in edge if point[0] <= error]
    above = [point for point in edge if point[0] > error]
    if not below:
        return None
    (low, slow) = below[-1]
    if not above or above[0][0] > FARTHEST * low:
        return slow
    (high, fast) = above[0]
    part = math.log(error / low) / math.log(high / low)
    return slow * (fast / slow) ** part


def number(value):
    if value is None:
        return "–"
    digits, exponent = f"{value:.1e}".split("e")
    return f"{digits}e{int(exponent)}"


def ratio(ours, theirs):
    if ours is None or theirs is None:
        return "–"
    value = ours / theirs
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}" if value >= 1 else f"{value:.2f}"


def power(value):
    return f"1e-{round(-math.log10(value))}"


def sizes(rows):
    return sorted({int(row["bodies"]) for row in rows})


def described(rows):
    """What a reader must know of a run: machine, versions, date."""
    row = rows[0]
    versions = {entry["program"].split()[0]: entry["program_version"] for entry in rows}
    loads = [float(entry["load"]) for entry in rows]
    shares = sorted(float(entry["cpu_share"]) for entry in rows if entry["cpu_share"])
    clock = "wall time" if row["clock"] == "wall" else "processor time"
    programs = ", ".join(f"{name} {version}" for name, version in versions.items())
    threads = "one core" if row["threads"] == "1" else f"{row['threads']} threads"
    share = 100 * shares[len(shares) // 20]
    text = (
        f"{row['cpu']}, {threads} of {row['cores']}, {clock}, {row['date'][:10]}; {programs} "
        f"(commit {row['commit'][:7]}), Python {row['python']}; load {min(loads):.1f} to {max(loads):.1f}, "
        f"in 95 % of cases the programs had {share:.0f} % of their core or more"
    )
    return text + (f". {row['machine_note']}" if row["machine_note"] else "")


def short_table(rows):
    """polhode's speed and its ratio to heyoka's, a line a problem and size."""
    lines = [
        "| problem, span | bodies | " + " | ".join(power(error) for error in SHORT_TARGETS) + " |",
        "| --- | --- |" + " --- |" * len(SHORT_TARGETS),
    ]
    for name in names(rows):
        problem = PROBLEMS[name]
        for size in sizes(rows):
            ours, theirs = (points(rows, name, size, program) for program in ("polhode", "heyoka"))
            cells = []
            for error in SHORT_TARGETS:
                here, there = speed_at(ours, error), speed_at(theirs, error)
                cells.append(
                    number(here) if here is None or there is None else f"{number(here)} ({ratio(here, there)})"
                )
            lines.append(f"| {problem.title}, {problem.span:g} s | {size:,} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def names(rows):
    present = {row["problem"] for row in rows}
    return [name for name in PROBLEMS if name in present]


def full_tables(rows, targets):
    lines = ["# polhode beside its peers", "", described(rows) + ".", ""]
    lines += [
        "Body·s/s at the 99th percentile of the attitude error in the first column, read from the measured points by",
        "lines in logarithms (the best of the rounds). –: not reached. *asked*: what polhode does when the study asks for",
        "that error: speed, and the error that came out. `benches/peers/README.md` says what is charged.",
        "",
    ]
    for name in names(rows):
        problem = PROBLEMS[name]
        for size in sizes(rows):
            measured = {program: points(rows, name, size, program) for program in PROGRAMS}
            shown = [program for program in PROGRAMS if measured[program]]
            lines += [f"## {problem.title}, {problem.span:g} s, {size:,} bodies", ""]
            lines.append(
                "| error (rad) | " + " | ".join(shown) + " | polhode / heyoka | best polhode / heyoka | asked |"
            )
            lines.append("| --- |" + " --- |" * (len(shown) + 3))
            for error in targets or TARGETS:
                speeds = {program: speed_at(measured[program], error) for program in shown}
                best = max((speeds[p] for p in shown if p.startswith("polhode") and speeds[p]), default=None)
                cells = [number(speeds[program]) for program in shown]
                cells += [ratio(speeds.get("polhode"), speeds.get("heyoka")), ratio(best, speeds.get("heyoka"))]
                lines.append(f"| {power(error)} | " + " | ".join(cells) + f" | {asked(rows, name, size, error)} |")
            lines += ["", compile_times(rows, name, size), ""]
    return "\n".join(lines)


def asked(rows, name, size, error):
    for row in rows:
        if (row["problem"], int(row["bodies"]), row["program"]) == (name, size, "polhode") and math.isclose(
            float(row["asked_rad"]), error
        ):
            if not row["attitude_rad_p99"]:
                return "stopped" if row["note"].startswith("stopped") else "refused"
            return f"{number(float(row['body_seconds_per_second']))}, {number(float(row['attitude_rad_p99']))}"
    return "–"


def compile_times(rows, name, size):
    texts = []
    for program in ("heyoka", "numba"):
        seconds = sorted(
            float(row["compile_seconds"])
            for row in rows
            if (row["problem"], int(row["bodies"]), row["program"]) == (name, size, program)
        )
        if seconds:
            texts.append(
                f"{program} {seconds[0]:.2g} to {seconds[-1]:.2g} s"
                if seconds[0] != seconds[-1]
                else f"{program} {seconds[0]:.2g} s"
            )
    return "Compiling, not charged: " + ", ".join(texts) + "." if texts else ""


def write(folder, rows, targets):
    (folder / "peers.md").write_text(full_tables(rows, targets) + "\n")
    for size in sizes(rows):
        picture(folder / f"peers-{size}.svg", rows, size)


def write_readme(path, folder, rows):
    text = path.read_text()
    start, end = text.find(MARKS[0]), text.find(MARKS[1])
    if start < 0 or end < start:
        raise SystemExit(f"{path.name} has no marks {MARKS[0]} ... --> and {MARKS[1]}")
    start = text.index("\n", start) + 1
    relative = folder.resolve().relative_to(path.resolve().parent).as_posix()
    largest = max(sizes(rows))
    image = f"![Speed against attitude error, {len(names(rows))} problems]({relative}/peers-{largest}.svg)"
    body = f"{short_table(rows)}\n\n{described(rows)}.\n\n{image}\n\n[All points and tables]({relative}/peers.md).\n"
    path.write_text(text[:start] + body + text[end:])


STYLES = {
    "polhode": {"color": "#0b5fa5", "marker": "o", "linewidth": 2.0},
    "polhode taylor": {
        "color": "#0b5fa5",
        "marker": "^",
        "linestyle": "--",
        "linewidth": 1.0,
        "markerfacecolor": "white",
    },
    "polhode rk8": {"color": "#0b5fa5", "marker": "s", "linestyle": ":", "linewidth": 1.0, "markerfacecolor": "white"},
    "heyoka": {"color": "#c8401e", "marker": "D", "linewidth": 1.5},
    "numba": {"color": "#3c8d2f", "marker": "v", "linewidth": 1.5},
    "SciPy": {"color": "#7a7a7a", "marker": "x", "linewidth": 1.5},
}
LABELS = {
    "polhode": "polhode, error asked for",
    "polhode taylor": "polhode, taylor",
    "polhode rk8": "polhode, adaptive rk8",
}


def picture(path, rows, size):
    import matplotlib

    matplotlib.use("svg")
    # Text stays text, and the same rows make the same file.
    matplotlib.rcParams.update(
        {"svg.fonttype": "none", "svg.hashsalt": "peers", "font.size": 9, "font.family": "sans-serif"}
    )
    from matplotlib import pyplot

    shown = names(rows)
    columns = min(3, len(shown))
    lines = -(-len(shown) // columns)
    figure, axes = pyplot.subplots(lines, columns, figsize=(3.7 * columns, 3.0 * lines + 0.7), squeeze=False)
    for axis in axes.flat[len(shown) :]:
        axis.set_visible(False)
    for axis, name in zip(axes.flat, shown):
        for program in PROGRAMS:
            # SciPy's speed does not depend on the size: it is run on the sample alone.
            measured = points(rows, name, min(sizes(rows)) if program == "SciPy" else size, program)
            if measured:
                style = dict(STYLES[program])
                line = {key: style.pop(key) for key in ("linestyle", "linewidth") if key in style}
                # All points; a line through those that the tables are read from.
                axis.plot(*zip(*measured), linestyle="none", markersize=4, **style)
                axis.plot(*zip(*front(measured)), label=LABELS.get(program, program), markersize=4, **style, **line)
        axis.set(
            xscale="log", yscale="log", title=f"{PROBLEMS[name].title}, {PROBLEMS[name].span:g} s", xlim=(3e-2, 1e-16)
        )
        axis.set_xticks([10.0**-digits for digits in (2, 5, 8, 11, 14)])
        axis.grid(True, color="#e1e1e1", linewidth=0.6)
    for axis in axes[:, 0]:
        axis.set_ylabel("body·s/s")
    for axis in axes[-1]:
        axis.set_xlabel("attitude error, 99th percentile (rad)")
    handles, labels = max(
        (axis.get_legend_handles_labels() for axis in axes.flat[: len(shown)]), key=lambda pair: len(pair[1])
    )
    figure.legend(handles, labels, loc="lower center", ncols=len(labels), frameon=False)
    row = rows[0]
    figure.suptitle(
        f"{size:,} bodies; {row['cpu']}, {row['threads']} of {row['cores']} cores; {row['date'][:10]}", fontsize=10
    )
    figure.tight_layout(rect=(0, 0.05, 1, 1))
    figure.savefig(path, metadata={"Date": None, "Creator": None})
    pyplot.close(figure)

"""Runs the benchmarks of carom piece by piece and writes their pages: `./dev report`.

usage: report.py --bin FOLDER --work FOLDER --out FOLDER [--peers PYTHON] [--quick] [--again] [PART...]

A part is made of pieces; what a piece prints is kept in the work folder, so that an interrupted run
goes on where it was, and a part that is done is not repeated unless --again says so."""

import argparse
import datetime
import glob
import json
import os
import platform
import shutil
import subprocess
import sys
import time

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))

N_PRECISION = 21
# with a reference: a pile has none
SCENE_FILES = sorted(path for path in glob.glob(os.path.join(ROOT, "tests", "data", "scenes", "*.json"))
                     if not os.path.basename(path).startswith("j_"))
GROWTH = ("free", "chain", "stack", "pyramid", "pile", "islands", "rest", "hub")


# A piece is one command; `scene` pipes a scene of the program into a script of the peers' Python; `count`
# hands the program to the part's count.py.
def precision_pieces():
    scenes = [*map(str, range(N_PRECISION)), *SCENE_FILES]
    return [piece for scene in scenes for piece in ([scene], ["scene", scene])]


def step_pieces():
    return [[str(k)] for k in range(12)]


def growth_pieces():
    return [[family] for family in GROWTH]


def phases_pieces():
    return [["count", str(k)] for k in (2, 3, 4, 5, 11)]


def whole():
    return [[]]


# name: (program below the folder of benchmarks, its pieces, what it shows)
PARTS = {
    "precision": ("precision/bench_precision", precision_pieces, "error against run time"),
    "step": ("step/bench_step", step_pieces, "microseconds per step beside peers, and what rests"),
    "phases": ("step/bench_step", phases_pieces, "instructions of a step by phase"),
    "growth": ("growth/bench_growth", growth_pieces, "time, memory and work against the number of bodies"),
    "gradient": ("gradient/bench_gradient", whole, "cost and error of gradients"),
    "stability": ("stability/bench_stability", whole, "the stability atlas"),
    "leave_out": ("leave_out/bench_leave_out", whole, "what scenes do not need, and what that saves"),
}


# Programs that print their page themselves, and know no --quick: their rounds are short.
PLAIN = ("step",)
ALWAYS_WHOLE = (*PLAIN, "phases")


class Stopped(Exception):
    """A program failed or was interrupted; what was done is kept."""


def say(text):
    print(text, flush=True)


def run_piece(command, path, reader=None, optional=False):
    """The output of a command, or of a reader of it, in path: whole or not at all."""
    partial = path + ".partial"
    with open(partial, "w", encoding="utf-8") as out, open(path + ".log", "w", encoding="utf-8") as log:
        if reader:
            scene = subprocess.run(command, stdout=subprocess.PIPE, stderr=log, check=True).stdout
            # MuJoCo leaves a log where it runs
            code = subprocess.run(reader, input=scene, stdout=out, stderr=log, check=False,
                                  cwd=os.path.dirname(path)).returncode
        else:
            code = subprocess.run(command, stdout=out, stderr=log, check=False).returncode
    # the atlas counts black cells in its code: its figures are whole all the same
    if code < 0 or (os.path.getsize(partial) == 0 and not (reader or optional)):
        raise Stopped(f"{' '.join(command)} ended with {code}; see {path}.log")
    os.replace(partial, path)


def commits_in(folder):
    """Those at which the pieces of the folder were run."""
    path = os.path.join(folder, "commits")
    if not os.path.exists(path):
        return []
    with open(path, encoding="ascii") as file:
        return file.read().split()


def note_commit(folder):
    now = output("git", "rev-parse", "--short", "HEAD")
    known = commits_in(folder)
    if now not in known:
        with open(os.path.join(folder, "commits"), "w", encoding="ascii") as file:
            file.write(" ".join([*known, now]) + "\n")


def seconds_of(piece):
    """Zero where the run ended before it could be said."""
    if not os.path.exists(piece + ".seconds"):
        return 0.0
    with open(piece + ".seconds", encoding="ascii") as file:
        return float(file.read())


def join(pieces, path):
    """All pieces with the header of the first."""
    with open(path, "w", encoding="utf-8") as out:
        for k, piece in enumerate(pieces):
            with open(piece, encoding="utf-8", errors="replace") as file:
                lines = file.readlines()
            header = next((i for i, line in enumerate(lines) if not line.startswith("#")), 0)
            if k:
                del lines[header:header + 1]
            out.writelines(lines)


def write_page(title, pieces, path):
    """The tables of all pieces as one; other lines are what a peer says of itself."""
    rows = []
    for piece in pieces:
        with open(piece, encoding="utf-8", errors="replace") as file:
            rows += [line for line in file if line.startswith("|") and line not in rows[:2]]
    with open(path, "w", encoding="ascii", errors="replace") as out:
        out.write(f"# {title.capitalize()}\n\nOne thread, the least of several rounds' means; what the columns are: [performance.md](../performance.md).\n\n")
        out.writelines(rows)


class Facts:
    """What is known of each part, kept in a file."""

    def __init__(self, path):
        self.path = path
        self.parts = {}
        if os.path.exists(path):
            with open(path, encoding="utf-8") as file:
                self.parts = json.load(file)

    def of(self, part):
        return self.parts.get(part, {})

    def set(self, part, facts):
        self.parts[part] = facts
        with open(self.path, "w", encoding="utf-8") as file:
            json.dump(self.parts, file, indent=1)
            file.write("\n")


class Report:
    def __init__(self, options):
        self.options = options
        self.kind = "quick" if options.quick else "full"
        # what the pages show, wherever it ran; what this work folder has itself run
        self.shown = Facts(os.path.join(options.out, "parts.json"))
        self.done = Facts(os.path.join(options.work, "parts.json"))

    def remember(self, part, facts):
        self.shown.set(part, facts)
        self.done.set(part, facts)

    def is_done(self, part):
        return self.done.of(part).get("kind") == self.kind and not self.options.again

    def program(self, part):
        return os.path.join(self.options.bin, PARTS[part][0])

    def run(self, part):
        program, pieces, _ = PARTS[part]
        if not os.path.exists(self.program(part)):
            say(f"  {part:<12} left out: {program} is not built")
            return
        if self.is_done(part):
            say(f"  {part:<12} done before; --again repeats it")
            return
        folder = os.path.join(self.options.work, f"{part}-{self.kind}")
        if self.options.again:
            shutil.rmtree(folder, ignore_errors=True)
        os.makedirs(folder, exist_ok=True)
        files, commands = [], []
        quick = ["--quick"] if self.options.quick and part not in ALWAYS_WHOLE else []
        for k, arguments in enumerate(pieces()):
            piped = arguments[:1] == ["scene"]
            words = arguments if piped else quick + arguments
            reader = [self.options.peers, os.path.join(ROOT, "bench", part, "peers.py"), *quick]
            command = [self.program(part), *words]
            if arguments[:1] == ["count"]:
                archives = glob.glob(os.path.join(self.options.bin, "..", "lib*", "*.a"))
                script = os.path.join(ROOT, "bench", part, "count.py")
                command = [sys.executable, script, self.program(part), arguments[1], *archives]
            commands.append(" ".join([os.path.basename(program), *words]) +
                            (f" | peers.py {' '.join(quick)}" if piped else ""))
            files.append(os.path.join(folder, f"{k:02d}.csv"))
            self.progress(part, k, len(pieces()), arguments)
            if not os.path.exists(files[-1]):
                note_commit(folder)
                since = time.time()
                run_piece(command, files[-1], reader if piped else None, command[0] == sys.executable)
                with open(files[-1] + ".seconds", "w", encoding="ascii") as file:
                    file.write(f"{time.time() - since:.1f}\n")
        path = os.path.join(self.options.out, f"{part}.{'md' if part in PLAIN else 'csv'}")
        if part in PLAIN:
            write_page(PARTS[part][2], files, path)
        else:
            join(files, path)
        self.plot(part, path)
        seconds = sum(map(seconds_of, files))
        self.remember(part, {"kind": self.kind, "seconds": seconds, "commands": commands, "commits": commits_in(folder),
                             "date": datetime.date.today().isoformat()})
        say(f"  {part:<12} done in {seconds:.0f} s")

    @staticmethod
    def progress(part, k, n, arguments):
        bar = "#" * (20 * k // n) + "." * (20 - 20 * k // n)
        say(f"  {part:<12} [{bar}] {k}/{n} {' '.join(arguments)}")

    def plot(self, part, path):
        script = os.path.join(ROOT, "bench", part, "plot.py")
        if os.path.exists(script) and part not in PLAIN:
            subprocess.run([sys.executable, script, path, self.options.out], check=True)
        precision = os.path.join(self.options.out, "precision.csv")
        if part in ("precision", "step", "gradient") and os.path.exists(precision):
            subprocess.run([sys.executable, os.path.join(HERE, "marks.py"), precision, self.options.out], check=True)

    def page(self):
        lines = ["# Reports", "",
                 "Made by `./dev report`; nothing on these pages is written by hand. `--quick` takes minutes, the full run hours.", "",
                 "| part | shows | run | commit | date | took |", "|---|---|---|---|---|---|"]
        for part, (_, _, shows) in PARTS.items():
            facts = self.shown.of(part)
            page = f"[{part}]({part}.md)" if os.path.exists(os.path.join(self.options.out, f"{part}.md")) else part
            if facts:
                lines.append(f"| {page} | {shows} | {facts['kind']} | {', '.join(facts.get('commits', []))} | {facts['date']} | {facts['seconds']:.0f} s |")
            else:
                lines.append(f"| {page} | {shows} | not run | | | |")
        if os.path.exists(os.path.join(self.options.out, "marks.md")):
            lines.append("| [marks](marks.md) | carom beside every mark of its peers | with precision | | | |")
        lines += ["", "## Machine and versions", "", *machine(), "", "## Commands", ""]
        for part in PARTS:
            commands = self.shown.of(part).get("commands", [])
            for command in commands[:2]:
                lines.append(f"* `{command}`" + (" and so on, piece by piece" if len(commands) > 2 else ""))
        with open(os.path.join(self.options.out, "README.md"), "w", encoding="ascii", errors="replace") as file:
            file.write("\n".join(lines) + "\n")


def output(*command):
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def cpu():
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            return next(line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown"


def package(name):
    return output("pkg-config", "--modversion", name)


def machine():
    return [
        f"* {os.cpu_count()} cores, {cpu()}; {platform.system()} {platform.release()}, {platform.machine()}",
        f"* {output('cc', '--version').splitlines()[0]}; Release",
        f"* Box2D {package('box2d')}, Chipmunk {chipmunk()}; Python {platform.python_version()}",
        "* Other programs may have run beside it: ratios within a run count, not seconds.",
    ]


def chipmunk():
    found = glob.glob("/usr/lib/*/libchipmunk.so.7*")
    return os.path.basename(max(found, default="unknown", key=len)).replace("libchipmunk.so.", "")


def main():
    parser = argparse.ArgumentParser(prog="./dev report")
    parser.add_argument("--bin", required=True)
    parser.add_argument("--work", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--peers", default=sys.executable, help="a Python that has the peers' packages")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    options = parser.parse_args()
    unknown = [p for p in options.parts if p not in PARTS]
    if unknown:
        parser.error(f"no such part: {', '.join(unknown)}; there are {', '.join(PARTS)}")
    os.makedirs(options.work, exist_ok=True)
    os.makedirs(options.out, exist_ok=True)
    report = Report(options)
    try:
        for part in options.parts or PARTS:
            report.run(part)
    except (Stopped, KeyboardInterrupt) as stop:
        say(f"stopped: {stop or 'interrupted'}; the same command goes on from here")
        return 1
    finally:
        report.page()
    say(f"pages: {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

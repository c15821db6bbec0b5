"""Where the instructions of a step go, by callgrind: no timers in the library.

usage: count.py BENCH_STEP SCENE ARCHIVE...  (prints CSV: scene, phase, instructions per step, share)

Each function's own instructions count for the phase of the source file that it comes from, which the
archives of the build tell; what lies outside of them (libm, memcpy) stands apart.  Without valgrind nothing is
printed, and a line on stderr says so."""

import os
import re
import shutil
import subprocess
import sys
import tempfile

CONTENDER = "carom located"
TOO_LONG = 240  # [s]

# phase: files without their ending; a function with "factor" in its name is factorization
PHASES = {
    "collision": "detect box_tree sweep_few sweep_few_avx2 islands grid broadphase",
    "assembly": "rows joint limit drive damping system entries sparse scale graph block_pattern block_order substep solvers",
    "solution": "solve contact pass active_set interior_point damped ladder path crossover sweeps lemke interior polish "
                "kkt certify check residual island random farkas euler block_lu modes anderson",
    "events": "locate stop change slip further smooth joints_alone extrapolate stiff step energy",
    "tape": "tape checkpoint",
}
GEOMETRY = "libcarom_geom.a"


def phase_of_file(archive, name):
    stem = name.split(".")[0]
    if os.path.basename(archive) == GEOMETRY:
        return "collision"
    found = [phase for phase, files in PHASES.items() if stem in files.split()]
    return found[0] if found else "rest of the step"


def phases_of_functions(archives):
    """{function: phase}; of two functions of one name the first."""
    phases = {}
    for archive in archives:
        listing = subprocess.run(["nm", "--defined-only", archive], capture_output=True, text=True, check=True).stdout
        phase = None
        for line in listing.splitlines():
            words = line.split()
            if line.endswith(":"):
                phase = phase_of_file(archive, line[:-1])
            elif len(words) == 3 and words[1] in "tT":
                phases.setdefault(words[2], "factorization" if "factor" in words[2] else phase)
    return phases


def counts(bench, scene):
    """({function: own instructions}, steps taken, name of the scene)."""
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "counts")
        page = subprocess.run(
            ["valgrind", "--tool=callgrind", "--toggle-collect=carom_world_step", f"--callgrind-out-file={out}",
             bench, scene, CONTENDER], capture_output=True, text=True, check=True, timeout=TOO_LONG).stdout
        listing = subprocess.run(["callgrind_annotate", "--threshold=100", "--auto=no", out], capture_output=True, text=True,
                                 check=True).stdout
        with open(out, encoding="ascii", errors="replace") as file:
            steps = calls_of_step(file.read())
    name = next(line for line in page.splitlines() if CONTENDER in line).split("|")[1].strip()
    own = {}
    for line in listing.splitlines():
        m = re.match(r"\s*([\d,]+) \([ \d.]+%\)\s+\S*?:(\S+)", line)
        if m and "PROGRAM" not in line:
            function = m.group(2).split(".")[0]
            own[function] = own.get(function, 0) + int(m.group(1).replace(",", ""))
    return own, steps, name


def calls_of_step(text):
    """How often carom_world_step was called: it is named once, then by its number alone."""
    number = re.search(r"fn=(\(\d+\)) carom_world_step\b", text)
    if not number:
        return 0
    calls = re.findall(r"^cfn=" + re.escape(number.group(1)) + r"[^\n]*\ncalls=(\d+)", text, re.MULTILINE)
    return sum(map(int, calls))


def main(bench, scene, *archives):
    if not shutil.which("valgrind"):
        print("count.py: no valgrind here; phases are left out", file=sys.stderr)
        return
    phases = phases_of_functions(archives)
    try:
        own, steps, name = counts(bench, scene)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
        print(f"count.py: scene {scene} is left out: {error}", file=sys.stderr)
        return
    sums = dict.fromkeys([*PHASES, "factorization", "rest of the step", "outside"], 0)
    for function, n in own.items():
        sums[phases.get(function, "outside")] += n
    total = sum(sums.values())
    print("scene,phase,instructions,share")
    for phase, n in sums.items():
        print(f"{name},{phase},{n / max(steps, 1):.0f},{n / max(total, 1):.3f}")


if __name__ == "__main__":
    main(*sys.argv[1:])

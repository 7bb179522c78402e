"""``python -m tests.mutations``: change the verdict's sources and the physics a little at a time, and see tests fail.

Each mutant is tried in a copy of the sources with the tests that cover it, two at a time; the list and its order are
the same each time.  Printed: killed and alive by part; ``runs/mutations.json`` holds every trial as it ends, so that
``--go-on`` goes on with a run of the same sources that was stopped.  Exit code 1 where more than `MAX_SURVIVAL` of them
survive, or any change of a limit.
"""

import argparse
import json
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from queue import SimpleQueue

from tests.mutations.choice import PARTS, chosen_mutants
from tests.mutations.covering import covering_tests, kernels_on, limits_at
from tests.mutations.mutant import ROOT, Mutant
from tests.mutations.workplace import Trial, Workplace
from tests.soak import sources
from world.files import write_atomically

TARGET = Path("runs") / "mutations.json"
# Share of the mutants that may survive: some change nothing that anyone could see.
MAX_SURVIVAL = 0.05


def main() -> int:
    """Try mutants out; the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutations", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=200, help="how many mutants (0: all; default 200)")
    parser.add_argument("--part", action="append", choices=PARTS, help="may be given more than once; default: all")
    parser.add_argument("--match", default="", help="only mutants of files or texts with this in them")
    parser.add_argument("--at-once", type=int, default=2, help="how many are tried at the same time (2)")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds after which a mutant counts as noticed")
    parser.add_argument("--keep", type=Path, help="folder of the copies, kept for the next run of the same sources")
    parser.add_argument("--go-on", action="store_true", help=f"try only what {TARGET} does not hold for these sources")
    parser.add_argument("--list", action="store_true", help="list the mutants and try none")
    args = parser.parse_args()
    chosen = chosen_mutants(None if args.match else args.count or None, args.part or PARTS)
    mutants = [mutant for mutant in chosen if args.match in _text(mutant)][: args.count or None]
    if args.list:
        for mutant in mutants:
            print(_text(mutant))
        return 0
    known = _known(mutants) if args.go_on else []
    left = [mutant for mutant in mutants if mutant not in {trial.mutant for trial in known}]
    folder = args.keep or Path(tempfile.mkdtemp(prefix="planfly-mutations-"))
    try:
        trials = _tried(left, known, folder, args.at_once, args.limit) if left else known
    finally:
        if args.keep is None:
            shutil.rmtree(folder, ignore_errors=True)
    return _report(trials)


def _known(mutants: list[Mutant]) -> list[Trial]:
    """Of these mutants, what a run of the same sources found before it was stopped."""
    if not TARGET.is_file():
        return []
    kept = json.loads(TARGET.read_text(encoding="utf-8"))
    if kept["sources"] != sources():
        return []
    trials = [Trial(Mutant(**one["mutant"]), one["status"], one["by"], one["seconds"]) for one in kept["trials"]]
    return [trial for trial in trials if trial.mutant in mutants]


def _tried(mutants: list[Mutant], known: list[Trial], folder: Path, at_once: int, limit: float) -> list[Trial]:
    """Try all of them, each in the workplace that is free next; what is known comes first."""
    places = [Workplace(folder / str(k), limit) for k in range(at_once)]
    # Looked up before the first trial, so that the repository may change meanwhile.
    asked = {mutant: (covering_tests(mutant), kernels_on(mutant)) for mutant in mutants}
    tests = sorted({test for stages, _ in asked.values() for stage in stages for test in stage})
    free: SimpleQueue[Workplace] = SimpleQueue()

    def try_out(mutant: Mutant) -> Trial:
        place = free.get()
        try:
            return place.try_out(mutant, *asked[mutant])
        finally:
            free.put(place)

    with ThreadPoolExecutor(at_once) as pool:
        for place, failure in zip(places, pool.map(lambda place: place.warm(tests), places), strict=True):
            if failure:
                raise SystemExit(f"the tests fail without a mutant, so none can be tried: {failure}")
            free.put(place)
        trials, whole = list(known), len(known) + len(mutants)
        for number, trial in enumerate(pool.map(try_out, mutants), len(known) + 1):
            print(f"{number:4d} of {whole}  {trial.status:8} {trial.seconds:5.0f} s  {_text(trial.mutant)}")
            sys.stdout.flush()
            trials.append(trial)
            _keep(trials)
    for place in places:
        place.close()
    return trials


def _report(trials: list[Trial]) -> int:
    """Print and write what became of the mutants; the exit code."""
    alive = [trial for trial in trials if trial.status == "alive"]
    parts = Counter((trial.mutant.part, trial.status == "alive") for trial in trials)
    print()
    for part in sorted({trial.mutant.part for trial in trials}):
        print(f"{part:10} {parts[part, False]:4d} killed {parts[part, True]:4d} alive")
    for trial in alive:
        print(f"alive: {_text(trial.mutant)}")
    _keep(trials)
    print(f"written to {TARGET}")
    limits = any(trial.mutant.part == "limits" for trial in alive)
    return int(limits or len(alive) > MAX_SURVIVAL * len(trials))


def _keep(trials: list[Trial]) -> None:
    TARGET.parent.mkdir(exist_ok=True)
    kept = {"sources": sources(), "trials": [_record(trial) for trial in trials]}
    write_atomically(TARGET, json.dumps(kept, indent=1) + "\n")


def _record(trial: Trial) -> dict[str, object]:
    return asdict(trial) | {"line": _line(trial.mutant), "seconds": round(trial.seconds, 1)}


def _line(mutant: Mutant) -> int:
    return mutant.line((ROOT / mutant.file).read_bytes())


def _text(mutant: Mutant) -> str:
    limits = f"{', '.join(limits_at(mutant))}: " if mutant.part == "limits" else ""
    return f"{mutant.part:9}{mutant.file}:{_line(mutant)}: {limits}{_short(mutant.old)} -> {_short(mutant.new)}"


def _short(text: str) -> str:
    words: Iterable[str] = text.split()
    line = " ".join(words)
    return line if len(line) <= 70 else f"{line[:33]} … {line[-33:]}"


if __name__ == "__main__":
    sys.exit(main())

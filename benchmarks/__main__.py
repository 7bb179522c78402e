"""``make bench``: measured side by side in one run, printed as tables and written to ``runs/bench.json``.

``python -m benchmarks [chain] [planner] [ablation] [peers] [flight] [aircraft] [autopilot] [airspace] [campaigns]
[start] [--runs N] [--seconds S] [--seeds N] [--flights N] [--long]``: parts to measure (default: all), seeds of each
whole planner run (15), what OMPL is given (10 s), seeds of flights (20), flights of a campaign (90), and the rows of
campaigns that take an hour.
"""

import argparse
import json
import os
import platform
from pathlib import Path

# All programs use one thread: a linear algebra library that used all cores would have more of the machine than others.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

PARTS = (
    "chain",
    "planner",
    "ablation",
    "peers",
    "flight",
    "aircraft",
    "autopilot",
    "airspace",
    "campaigns",
    "start",
)
TARGET = Path("runs") / "bench.json"


def main() -> None:
    """Measure the requested parts; keep the stored results of the others."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("parts", nargs="*", default=[], help=f"of {', '.join(PARTS)}; default: all")
    parser.add_argument("--runs", type=int, default=15, help="seeds of each whole planner run")
    parser.add_argument("--seconds", type=float, default=10.0, help="what OMPL is given")
    parser.add_argument("--seeds", type=int, default=20, help="seeds of each kind of flight")
    parser.add_argument("--flights", type=int, default=90, help="flights of a campaign whose rate is taken")
    parser.add_argument("--long", action="store_true", help="campaigns: winds, client's memory and step rates, too")
    args = parser.parse_args()
    if unknown := set(args.parts) - set(PARTS):
        parser.error(f"{', '.join(sorted(unknown))}: not a part")
    # Imported here: the setting above must come first.
    from benchmarks import aircraft, autopilot, chain, flight, peers, planner, start
    from benchmarks.airspace import check_log
    from benchmarks.campaigns import campaign_rows
    from benchmarks.planning import ablation

    TARGET.parent.mkdir(exist_ok=True)
    kept = json.loads(TARGET.read_text(encoding="utf-8")) if TARGET.exists() else {}
    record = {part: kept[part] for part in PARTS if part in kept}
    record |= {"machine": platform.machine(), "python": platform.python_version(), "cores": os.cpu_count()}
    work = {
        "chain": chain.run,
        "planner": lambda: planner.measure(args.runs),
        "ablation": lambda: ablation.measure(args.runs),
        "peers": lambda: peers.measure(args.seconds),
        "flight": lambda: flight.run(args.seeds),
        "aircraft": aircraft.run,
        "autopilot": autopilot.run,
        "airspace": check_log.run,
        "campaigns": lambda: campaign_rows.run(args.flights, whole=args.long),
        "start": start.run,
    }
    for part in args.parts or PARTS:
        record[part] = work[part]()
        TARGET.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print(f"\nwritten to {TARGET}")


if __name__ == "__main__":
    main()

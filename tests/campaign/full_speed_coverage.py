"""How often intervals of a simulated campaign hold the truth: contact in bins, and full aquaplaning from slopes.

`python -m tests.campaign.full_speed_coverage FOLDER`, after `aqualog simulate campaign thesis -o FOLDER` and `aqualog
bin-slipslope FOLDER/campaign.toml --json > FOLDER/slopes.json`.
"""

import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import polars as pl

from aqualog.campaign.bins import KMH
from aqualog.io.mdf.reader import MdfReader
from aqualog.io.reader import ReadOptions

WHEELS = ("fl", "fr", "rl", "rr")
TRUTH = {"on_water", "true_v_x", *(f"true_{x}_{w}" for x in ("contact", "full_speed") for w in WHEELS)}
KEYS = ("vehicle", "tyre", "pressure_rear_bar", "water_depth_mm", "load_front_kg", "load_rear_kg")


def truths(folder):
    """Speeds [km/h], contacts [-] and speeds of full aquaplaning [km/h] (3, n) on the lanes, by configuration and wheel."""
    out = defaultdict(list)
    for run in pl.read_csv(folder / "runs.csv").iter_rows(named=True):
        with MdfReader(folder / run["log"], ReadOptions()) as reader:
            wanted = {c.name: c for c in reader.channels() if c.name in TRUTH}
            c = dict(zip(wanted, (x.values for x in reader.read(list(wanted.values()))), strict=True))
        if "on_water" not in c:  # a dry run
            continue
        on = np.flatnonzero(c["on_water"] > 0.5)
        at = on[on.size // 10 : -(on.size // 10) or None]
        key = tuple(Path(run[k]).stem if k == "vehicle" else run[k] for k in KEYS)
        for w in WHEELS:
            rows = c["true_v_x"] / KMH, c[f"true_contact_{w}"], c[f"true_full_speed_{w}"] / KMH
            out[(*key, w)].append(np.array(rows)[:, at])
    return {k: np.concatenate(v, axis=1) for k, v in out.items()}


def main(folder):
    document, known = json.loads((folder / "slopes.json").read_text(encoding="utf-8")), truths(folder)

    def truth(row):
        return known[(*(row[k] for k in KEYS), row["wheel"])]

    bins = []
    for r in (r for r in document["rows"] if r["road"] == "wet" and r["contact_ratio_ci95"]):
        v, contact, _ = truth(r)
        inside = (v >= r["v_low_kmh"]) & (v < r["v_high_kmh"])
        low, high = r["contact_ratio_ci95"]
        bins.append(low <= np.nanmedian(contact[inside]) <= high)
    speeds = []
    for r in (r for r in document["full_aquaplaning"] if r["way"] == "slip_slope" and r["v_full_ci95_kmh"]):
        v, _, full = truth(r)
        low, high = r["v_full_ci95_kmh"]
        at = np.nanmedian(full[v > np.quantile(v, 0.9)])  # at the fastest passes
        speeds.append((r["wheel"], low <= at <= (high or np.inf)))
    rear = [held for w, held in speeds if w[0] == "r"]
    print(f"contact, bins: {sum(bins)} of {len(bins)}; full aquaplaning from slopes, rear: {sum(rear)} of {len(rear)}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))

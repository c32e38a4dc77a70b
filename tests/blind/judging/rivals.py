"""Other methods on the same sealed cases: each sees the residuals that the engine itself sees, and is judged by one truth."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from aqualog.align.load import load_signals
from aqualog.config.vehicle import load_vehicle
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.channels import block_step
from aqualog.model.term import Model
from tests.blind.judging.answers import Form, exact_twins
from tests.blind.judging.cases import Judged, fits
from tests.blind.judging.figures import STRONG
from tests.blind.judging.run import Place
from tests.blind.judging.work import log_of
from tests.blind.metrics.engine import prepare, residual
from tests.blind.metrics.measure import Measure, quantity, share
from tests.blind.rivals.columns import Residuals
from tests.blind.rivals.compare import Claim, claims

__all__ = ["OWN", "Said", "all_claims", "table"]

OWN = "aqualog"
Said = dict[str, Claim]


def all_claims(done: Sequence[Place], *, jobs: int) -> dict[str, Said]:
    """What the methods say of each case, by its key; kept in the folders of the run."""
    with ProcessPoolExecutor(jobs) as pool:
        return dict(zip((f"{p.out.parent.name}/{p.out.name}" for p in done), pool.map(_claims, done), strict=True))


def _claims(place: Place) -> Said:
    kept = place.out / "rivals.json"
    if not kept.is_file():
        vehicle = load_vehicle(place.case / "vehicle.toml")
        drive, held = (log_of(place.case, stem) for stem in ("drive", "held"))
        assert drive is not None
        unseen = None if held is None else _residuals(held, vehicle)
        said = {n: c._asdict() for n, c in claims(_residuals(drive, vehicle), unseen, vehicle).items()}
        kept.write_text(json.dumps(said) + "\n", encoding="utf-8")
    said = {n: Claim(**c) for n, c in json.loads(kept.read_text(encoding="utf-8")).items()}
    return {OWN: Claim(False, gain=_own_gain(place.out)), **said}


def _residuals(log: Path, vehicle: Vehicle) -> Residuals:
    drive = prepare(load_signals([log], vehicle=vehicle), vehicle, "log")
    found = residual(drive, Model())
    coordinates = {k: x[: found.shape[1]] for k, x in drive.coordinates.items()}
    return Residuals(drive.channels, found, drive.mask, coordinates, block_step(drive.dt))


def _own_gain(out: Path) -> float:
    """As `error_taken`, from the errors that the verdict states for the held-out drive; nothing where nothing is named."""
    gain = json.loads((out / "verdict.json").read_text(encoding="utf-8")).get("gain") or {}
    changes = [c["rmse_change"] for c in (gain.get("channel") or {}).values() if c.get("rmse_change") is not None]
    return float(np.mean([1.0 - (1.0 + x) ** 2 for x in changes])) if changes and gain.get("heldout") else 0.0


def table(cases: Sequence[Judged], said: dict[str, Said]) -> str:
    """A line of markdown for each method: all on the same drives."""
    counted = [c for c in cases if not c.is_baseline and not c.row.error]
    nulls = [c for c in counted if c.kind == "null"]
    known = [c for c in counted if c.kind == "known" and c.row.truth[0].z >= STRONG]
    forms = [c for c in counted if c.kind == "unknown"]
    lines = [
        f"| method | finds something where nothing is ({len(nulls)}) | right name first ({len(known)}) "
        f"| held-out error taken away, median ({len(known)}) | right form first ({len(forms)}) |",
        "|---|---|---|---|---|",
    ]
    for method in dict.fromkeys(n for s in said.values() for n in s):
        found = [_found(c, method, said[c.row.key]) for c in nulls]
        named = [_named(c, method, said[c.row.key]) for c in known]
        gains = [said[c.row.key][method].gain for c in known]
        shapes = [_formed(c, method, said[c.row.key]) for c in forms]
        cells = [share(13, "", x, "-") for x in (found, named, shapes)]
        cells.insert(2, quantity(13, "", gains, lambda x: float(np.median(x)), "-"))
        lines.append(f"| {method} | {' | '.join(map(_cell, cells))} |")
    return "\n".join(lines)


def _found(c: Judged, method: str, said: Said) -> bool:
    return c.row.found if method == OWN else said[method].found


def _named(c: Judged, method: str, said: Said) -> bool:
    """Of a rival the effect alone is asked, not its place."""
    if method == OWN:
        return c.first_is_right
    effect = c.row.truth[0].effect
    return bool({effect, *exact_twins(effect)} & set(said[method].effects))


def _formed(c: Judged, method: str, said: Said) -> bool:
    if method == OWN:
        return c.form_is_right
    claim = said[method]
    if set(claim.effects) & c.accepted:
        return True
    form = Form(claim.mechanisms, frozenset(claim.depends_on))
    return c.unknown is not None and claim.found and fits(form, c.unknown, exact=True)


def _cell(m: Measure) -> str:
    return f"{m.value:.2f} ({m.low:.2f} to {m.high:.2f})" if m.count and math.isfinite(m.value) else "-"

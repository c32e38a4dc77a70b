"""The test matrix of a campaign as text for a terminal and as a document."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from aqualog import __version__
from aqualog.campaign.logs import LogState, missing_lines
from aqualog.campaign.matrix import FEW, TOO_FEW, Configuration, Matrix
from aqualog.campaign.propose_files import NEEDED
from aqualog.campaign.records import Campaign
from aqualog.campaign.tables import StoredRun
from aqualog.core.vehicle import Vehicle
from aqualog.report.text import table

__all__ = ["matrix_document", "matrix_text"]

MOST_ROWS = 200  # configurations that are printed; the document has all
MOST_GAPS = 20
_UNKNOWN = "?"


def matrix_text(
    campaign: Campaign,
    matrix: Matrix,
    logs: Sequence[LogState],
    vehicles: Mapping[str, Vehicle],
    measured: Mapping[int, StoredRun],
    lanes: Sequence[str] = (),
) -> str:
    """Summary of the campaign, its configurations, and missing combinations."""
    lines = [
        f"{campaign.name}: {_count(len(campaign.runs), 'run')} in {_count(len(matrix.configurations), 'configuration')}"
    ]
    lines.append(_logs(logs))
    if measured:
        done = sum(m.state == "done" for m in measured.values())
        lines.append(f"measured by a batch: {done} of {_count(len(campaign.runs), 'run')}")
    lines += [f"vehicle {name}: {_vehicle(v)}" for name, v in vehicles.items()]
    if matrix.constants:
        lines.append("same in all runs: " + ", ".join(f"{k} = {v}" for k, v in matrix.constants.items()))
    for factor in dict.fromkeys(matrix.together.values()):
        keys = ", ".join(k for k, f in matrix.together.items() if f == factor)
        lines.append(f"{factor} fixes {keys}: their effects cannot be distinguished")
    if matrix.others:
        lines.append("further keys: " + ", ".join(f"{k} ({_count(n, 'value')})" for k, n in matrix.others.items()))
    if matrix.factors:
        lines += ["", "varied:"]
        lines += [f"  {f.key}: {_levels(f.values, f.runs)}" for f in matrix.factors]
    lines += ["", _table(matrix), ""]
    missing = [*_missing(matrix, logs), *lanes[:10], *_failed(measured), *_unset(vehicles)] or [
        "no configuration key in the campaign file"
    ]
    lines += ["missing:", *(f"  {m}" for m in missing)]
    return "\n".join(lines) + "\n"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _logs(logs: Sequence[LogState]) -> str:
    sizes = [s.size for s in logs if s.size is not None]
    size = sum(sizes)
    amount = f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.1f} MB"
    kinds: dict[str, int] = {}
    for state in logs:
        kind = state.path.suffix.lower().lstrip(".") or "folder"
        kinds[kind] = kinds.get(kind, 0) + 1
    told = ", ".join(f"{n} {k}" for k, n in sorted(kinds.items()))
    there = f"{len(sizes)} of {_count(len(logs), 'log')} there" if len(sizes) < len(logs) else "all there"
    return f"logs: {told}; {there}, {amount}"


def _vehicle(vehicle: Vehicle) -> str:
    return f"{vehicle.name}, {vehicle.drivetrain}, {vehicle.mass:g} kg"


def _failed(measured: Mapping[int, StoredRun], most: int = 5) -> list[str]:
    reasons = list(dict.fromkeys(m.reason for m in measured.values() if m.state != "done"))
    more = [f"and {len(reasons) - most} more runs could not be measured"] if len(reasons) > most else []
    return [*(f"not measured: {r}" for r in reasons[:most]), *more]


def _unset(vehicles: Mapping[str, Vehicle]) -> list[str]:
    """Keys missing in the vehicle files, for which default values are used."""
    unset = {name: [k for k in NEEDED if k not in v.given] for name, v in vehicles.items()}
    return [
        f"{name} does not give {', '.join(keys)}: a mid-size car with rear-wheel drive is assumed"
        for name, keys in unset.items()
        if keys
    ]


def _levels(values: Sequence[str], runs: Sequence[int]) -> str:
    return ", ".join(f"{v or 'not given'} ({_count(n, 'run')})" for v, n in zip(values, runs, strict=True))


def _table(matrix: Matrix) -> str:
    has_speed = any(c.speeds for c in matrix.configurations)
    has_manoeuvre = any(any(c.manoeuvres) for c in matrix.configurations)
    header = [*(f.key for f in matrix.factors), "runs", *(["km/h"] if has_speed else [])]
    header += ["manoeuvres"] if has_manoeuvre else []
    rows = []
    for c in matrix.configurations[:MOST_ROWS]:
        row = [*(v or _UNKNOWN for v in c.values), f"{len(c.runs)}{_mark(c)}"]
        row += [_speeds(c.speeds)] if has_speed else []
        row += [", ".join(f"{m or 'not given'} {n}" for m, n in c.manoeuvres.items())] if has_manoeuvre else []
        rows.append(row)
    more = len(matrix.configurations) - len(rows)
    text = table([*header, ""], [[*r, ""] for r in rows])
    return f"{text}\nand {_count(more, 'configuration')} more (--json has all)" if more else text


def _mark(configuration: Configuration) -> str:
    runs = len(configuration.runs)
    return " !" if runs < TOO_FEW else " ~" if runs < FEW else ""


def _speeds(speeds: Sequence[float]) -> str:
    if not speeds:
        return _UNKNOWN
    if len(speeds) <= 4:
        return " ".join(f"{v:g}" for v in speeds)
    return f"{speeds[0]:g}...{speeds[-1]:g} ({len(speeds)})"


def _missing(matrix: Matrix, logs: Sequence[LogState]) -> list[str]:
    lines = missing_lines(logs)
    too_few = sum(len(c.runs) < TOO_FEW for c in matrix.configurations)
    few = sum(TOO_FEW <= len(c.runs) < FEW for c in matrix.configurations)
    total = len(matrix.configurations)
    if too_few:
        lines.append(
            f"! {too_few} of {_count(total, 'configuration')} with fewer than {TOO_FEW} runs: no reliable interval"
        )
    if few:
        lines.append(f"~ {few} of {_count(total, 'configuration')} with fewer than {FEW} runs: wide intervals")
    lines += matrix.notes
    if matrix.gaps:
        keys = ", ".join(f.key for f in matrix.factors)
        lines.append(f"never driven although neighbours were ({keys}):")
        lines += [f"  {', '.join(v or _UNKNOWN for v in g.values)}" for g in matrix.gaps[:MOST_GAPS]]
        if len(matrix.gaps) > MOST_GAPS:
            lines.append(f"  and {len(matrix.gaps) - MOST_GAPS} more (--json has all)")
    return lines


def matrix_document(
    campaign: Campaign,
    matrix: Matrix,
    logs: Sequence[LogState],
    vehicles: Mapping[str, Vehicle],
    measured: Mapping[int, StoredRun],
    lanes: Sequence[str] = (),
) -> dict[str, Any]:
    """The same as a document of plain values; `runs` are indices from 0 in the order of the campaign file."""
    keys = [f.key for f in matrix.factors]
    return {
        "schema_version": 1,
        "tool_version": __version__,
        "campaign": str(campaign.path),
        "name": campaign.name,
        "runs": len(campaign.runs),
        "logs": {
            "files": len(logs),
            "bytes": sum(s.size or 0 for s in logs),
            "missing": [
                {"log": str(s.path), "place": s.place, "runs": s.runs, "near": s.near or None}
                for s in logs if s.size is None
            ],
        },
        "vehicles": {
            name: {"name": v.name, "drivetrain": v.drivetrain, "mass": v.mass, "given": sorted(v.given)}
            for name, v in vehicles.items()
        },
        "constants": dict(matrix.constants),
        "factors": {f.key: dict(zip(f.values, f.runs, strict=True)) for f in matrix.factors},
        "together": dict(matrix.together),
        "others": dict(matrix.others),
        "configurations": [
            {
                "values": {k: v or None for k, v in zip(keys, c.values, strict=True)},
                "runs": list(c.runs),
                "manoeuvres": dict(c.manoeuvres),
                "speeds_kmh": list(c.speeds),
                "interval": "none" if len(c.runs) < TOO_FEW else "wide" if len(c.runs) < FEW else "usable",
            }
            for c in matrix.configurations
        ],
        "gaps": [
            {"values": dict(zip(keys, g.values, strict=True)), "beside": g.beside} for g in matrix.gaps
        ],
        "measured": {
            "runs": sum(m.state == "done" for m in measured.values()),
            "failed": [{"run": i, "reason": m.reason} for i, m in measured.items() if m.state != "done"],
        },
        "notes": [*matrix.notes, *lanes],
    }  # fmt: skip

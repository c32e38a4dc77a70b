"""The test matrix of a campaign as sections and as a document."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from aqualog import __version__
from aqualog.campaign.definition import Campaign, LogState, missing_lines
from aqualog.campaign.matrix import FEW, TOO_FEW, Configuration, Matrix
from aqualog.campaign.propose_files import NEEDED
from aqualog.campaign.tables import StoredRun
from aqualog.core.vehicle import Vehicle
from aqualog.report.sections import Lines, Para, Report, Section, Table
from aqualog.report.values import counted

__all__ = ["matrix_document", "matrix_report"]

MOST_ROWS = 200  # configurations that are printed; the document has all
MOST_GAPS = 20
_UNKNOWN = "?"
_NOT_GIVEN = "not given"


def matrix_report(
    campaign: Campaign,
    matrix: Matrix,
    logs: Sequence[LogState],
    vehicles: Mapping[str, Vehicle],
    measured: Mapping[int, StoredRun],
    lanes: Sequence[str] = (),
) -> Report:
    """Summary of the campaign, its configurations, and missing combinations."""
    runs, configurations = counted(len(campaign.runs), "run"), counted(len(matrix.configurations), "configuration")
    lines = [f"{campaign.name}: {runs} in {configurations}", _logs(logs)]
    if measured:
        lines.append(f"measured by a batch: {sum(m.state == 'done' for m in measured.values())} of {runs}")
    lines += [f"vehicle {name}: {v.name}, {v.drivetrain}, {v.mass:g} kg" for name, v in vehicles.items()]
    if matrix.constants:
        lines.append("same in all runs: " + ", ".join(f"{k} = {v}" for k, v in matrix.constants.items()))
    for factor in dict.fromkeys(matrix.together.values()):
        keys = ", ".join(k for k, f in matrix.together.items() if f == factor)
        lines.append(f"{factor} fixes {keys}: their effects cannot be distinguished")
    if matrix.others:
        lines.append("further keys: " + ", ".join(f"{k} ({counted(n, 'value')})" for k, n in matrix.others.items()))
    varied = [
        (f.key, ", ".join(f"{v or _NOT_GIVEN} ({counted(n, 'run')})" for v, n in zip(f.values, f.runs, strict=True)))
        for f in matrix.factors
    ]
    more = len(matrix.configurations) - MOST_ROWS
    rest = f"and {counted(more, 'configuration')} more (--json has all)" if more > 0 else ""
    missing = [*_missing(matrix, logs), *lanes[:10], *_failed(measured), *_unset(vehicles)]
    sections = [
        Section("", [Para("\n".join(lines), "everywhere")]),
        Section("Varied:", [Lines(varied, most=1000)]),
        Section("", [_table(matrix), Para(rest, "everywhere")]),
        Section("Missing:", [Lines(missing or ["no configuration key in the campaign file"], most=1000)]),
    ]
    return Report("matrix", "test matrix of a campaign", sections)


def _logs(logs: Sequence[LogState]) -> str:
    sizes = [s.size for s in logs if s.size is not None]
    size = sum(sizes)
    amount = f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.1f} MB"
    kinds = Counter(state.path.suffix.lower().lstrip(".") or "folder" for state in logs)
    told = ", ".join(f"{n} {k}" for k, n in sorted(kinds.items()))
    there = f"{len(sizes)} of {counted(len(logs), 'log')} there" if len(sizes) < len(logs) else "all there"
    return f"logs: {told}; {there}, {amount}"


def _failed(measured: Mapping[int, StoredRun], most: int = 5) -> list[str]:
    reasons = list(dict.fromkeys(m.reason for m in measured.values() if m.state != "done"))
    more = [f"and {len(reasons) - most} more runs could not be measured"] if len(reasons) > most else []
    return [*(f"not measured: {r}" for r in reasons[:most]), *more]


def _unset(vehicles: Mapping[str, Vehicle]) -> list[str]:
    """Keys missing in the vehicle files, for which default values are used."""
    return [
        f"{name} does not give {', '.join(keys)}: a mid-size car with rear-wheel drive is assumed"
        for name, v in vehicles.items()
        if (keys := [k for k in NEEDED if k not in v.given])
    ]


def _table(matrix: Matrix) -> Table:
    configurations = matrix.configurations
    columns: list[tuple[str, Callable[[Configuration], str]]] = [
        ("runs", lambda c: f"{len(c.runs)}{' !' if len(c.runs) < TOO_FEW else ' ~' if len(c.runs) < FEW else ''}")
    ]
    if any(c.speeds for c in configurations):
        columns.append(("km/h", lambda c: _speeds(c.speeds)))
    if any(any(c.manoeuvres) for c in configurations):
        columns.append(("manoeuvres", lambda c: ", ".join(f"{m or _NOT_GIVEN} {n}" for m, n in c.manoeuvres.items())))
    rows = [[*(v or _UNKNOWN for v in c.values), *(text(c) for _, text in columns)] for c in configurations[:MOST_ROWS]]
    heads = [*(f.key for f in matrix.factors), *(name for name, _ in columns)]
    return Table(heads, rows, words=range(len(heads)))


def _speeds(speeds: Sequence[float]) -> str:
    if len(speeds) > 4:
        return f"{speeds[0]:g}...{speeds[-1]:g} ({len(speeds)})"
    return " ".join(f"{v:g}" for v in speeds) or _UNKNOWN


def _missing(matrix: Matrix, logs: Sequence[LogState]) -> list[str]:
    lines = missing_lines(logs)
    too_few = sum(len(c.runs) < TOO_FEW for c in matrix.configurations)
    few = sum(TOO_FEW <= len(c.runs) < FEW for c in matrix.configurations)
    total = counted(len(matrix.configurations), "configuration")
    if too_few:
        lines.append(f"! {too_few} of {total} with fewer than {TOO_FEW} runs: no reliable interval")
    if few:
        lines.append(f"~ {few} of {total} with fewer than {FEW} runs: wide intervals")
    lines += matrix.notes
    if matrix.gaps:
        gaps = [f"never driven although neighbours were ({', '.join(f.key for f in matrix.factors)}):"]
        gaps += [", ".join(v or _UNKNOWN for v in g.values) for g in matrix.gaps[:MOST_GAPS]]
        gaps += [f"and {len(matrix.gaps) - MOST_GAPS} more (--json has all)"] if len(matrix.gaps) > MOST_GAPS else []
        lines.append("\n".join(gaps))
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

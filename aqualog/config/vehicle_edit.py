"""Write a vehicle file with calibrated values, each with its interval and its origin."""

from __future__ import annotations

from aqualog.calibrate.apply import calibrated, told
from aqualog.calibrate.records import Calibration, Parameter
from aqualog.core.vehicle import KEYS, POLYNOMIALS, Vehicle, spread_lines

__all__ = ["calibrated_toml"]


def calibrated_toml(vehicle: Vehicle, calibration: Calibration) -> str:
    """Return the text of a vehicle file that `config.vehicle.load_vehicle` reads.

    Keys that neither the old file gives nor the drives identify stand as comments: no default looks like a given value.
    Values have seven digits.
    """
    new = calibrated(vehicle, calibration.parameters, calibration.transfers, calibration.spread)
    values = told(calibration.parameters, vehicle)
    name = new.name.replace("\\", "").replace('"', "")
    drives = ", ".join(_plain(d.name) for d in calibration.drives)
    lines = [f"# calibrated from {drives}", f'name = "{name}"', f'drivetrain = "{new.drivetrain}"']
    section = ""
    for key in KEYS.values():
        if key.section != section:
            section = key.section
            lines += ["", f"[{section}]"]
        value = getattr(new, key.name)
        line = f"{key.name} = {value!r}  # [{key.unit}] {key.meaning}"
        if key.path in values:
            line += "; " + _source(values[key.path][1])
        elif key.path not in new.given:
            line = f"# {line}; not identified, default"
        lines.append(line)
    if new.spread:
        lines += ["", "[spread]", "# standard deviation by which one more drive differs", *spread_lines(new)]
    for part in POLYNOMIALS:
        table = getattr(new, part)
        if not table:
            continue
        lines += ["", f"[{part}]"]
        fit = calibration.transfers.get(part)
        if fit is not None:
            lines.append(f"# from {fit.seconds:.0f} s of dry driving; explains {fit.explained:.1%} of the variance")
        lines += [f"{n} = {list(c)!r}" for n, c in table.items()]
    if calibration.cannot_tell:
        lines += ["", "# what the drives could not identify", *(f"# - {_plain(s)}" for s in calibration.cannot_tell)]
    return "\n".join(lines) + "\n"


def _source(p: Parameter) -> str:
    if p.remark == "given":
        return "given"
    low, high = p.ci95
    return f"calibrated, 95 %: {low:.5g} ... {high:.5g}" + (f" ({p.remark})" if p.remark else "")


def _plain(text: str) -> str:
    """One printable line."""
    return "".join(c if c.isprintable() else "?" for c in text)

"""Read vehicle files, and write them with calibrated values, each with its interval and its origin."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

from aqualog.config.reader import Table, is_real, quoted, read
from aqualog.core import vehicle as core
from aqualog.core.errors import ConfigError
from aqualog.core.intervals import same_decimals

if TYPE_CHECKING:
    from aqualog.calibrate.records import Calibration, Parameter

__all__ = ["calibrated_toml", "load_vehicle"]

MOST_POWERS = 5  # of a polynomial; calibration fits fewer
LARGEST_TERM = 1e4  # [N], [N*m] constant and spread: as much as the whole force of a tie rod (K)
LARGEST_GAIN = 100.0  # [-], [m] of the first power; a rod bears a tenth to a half of the tyre's force (K)
TYPICAL_FORCE = 1000.0  # [N] at which a higher power may give as much as the first (D)

_SECTIONS = tuple(dict.fromkeys(k.section for k in core.KEYS.values() if k.section))
_TABLES = (*_SECTIONS, *core.POLYNOMIALS, "spread", "provenance", "known", "water")
_TABLES_AND_WORDS = ("name", "drivetrain", "torque_arm", *_TABLES)


def load_vehicle(path: Path) -> core.Vehicle:
    """Read and check a vehicle file.

    A key that is left out takes its default (see `aqualog.core.vehicle.KEYS`); unknown keys are errors.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    file = read(path, "vehicle file")
    values: dict[str, Any] = {"name": str(file.get("name", path.stem))}
    if not values["name"].isprintable():
        file.add("name", f"name = {values['name']!r:.60} is not one line of printable characters")
    given = {"name", *(n for n in ("drivetrain",) if n in file)}
    values["drivetrain"] = file.choice("drivetrain", core.SPLIT, "rwd")
    values["torque_arm"] = file.choice("torque_arm", get_args(core.TorqueArm), "effective")
    for section in core.POLYNOMIALS:
        values[section] = _polynomial(file.table(section), section)
    values["spread"] = file.table("spread").numbers(
        {n: _Deviation(core.KEYS[n].high, core.KEYS[n].unit) for n in core.SPREAD}
    )
    for name, value in file.values.items():
        if isinstance(value, dict) and name not in _TABLES:
            file.unknown(name, _TABLES)
    top = {k: x for k, x in file.values.items() if not isinstance(x, dict) and k not in _TABLES_AND_WORDS}
    _numbers(file, "", top, values, given)
    for section in _SECTIONS:
        table = file.table(section)
        _numbers(table, section, table.values, values, given)
    values["known"] = _known(file.table("known"))
    values["water"] = _water(file.table("water"))
    values["provenance"] = _provenance(file.table("provenance"), given)
    file.faults.raise_if_any()
    car = core.Vehicle(**values, given=frozenset(given))
    unset = {k.name: core.usual(car, k) for k in core.KEYS.values() if k.path not in given}
    return replace(car, **unset)  # type: ignore[arg-type]


def _numbers(table: Table, section: str, names: Iterable[str], values: dict[str, Any], given: set[str]) -> None:
    """Read plain keys of a table into `values`, their paths into `given`."""
    known = {k.name: k for k in core.KEYS.values() if k.section == section}
    for name in names:
        if name in known:
            number = table.number(name, known[name])
            if number is not None:
                values[name] = number
                given.add(known[name].path)
        elif section and (name in core.POLYNOMIALS or name in core.KEYS):
            own = f"expected [{name}], a table of its own" if name in core.POLYNOMIALS else "expected above all tables"
            table.add(name, f"{name} stands in [{section}]; {own}")
        else:
            table.unknown(name, known if section else [*known, *_TABLES_AND_WORDS])


def _provenance(table: Table, given: set[str]) -> dict[str, core.Provenance]:
    """Read where values come from: a word, or a table with `source` and `sd`."""
    found: dict[str, core.Provenance] = {}
    for name, value in table.values.items():
        if name in _SECTIONS and isinstance(value, dict):  # `wheels.r_e_f = ...`, where the quotes were left out
            table_of = table.child(name, value)
            rows = [(table_of, n, f"{name}.{n}", v) for n, v in value.items()]
        else:
            rows = [(table, name, name, value)]
        for own, key, path, said in rows:
            if path not in core.KEYS:
                within = key != path
                own.unknown(key, [k.name for k in core.KEYS.values() if k.section == name] if within else core.KEYS)
                continue
            entry = _source_and_sd(own, key, path, said)
            if entry is None:
                continue
            if path not in given and entry.source != "guess":
                own.add(key, f'provenance.{path} = "{entry.source}", but the file sets no {path}; expected its value')
            found[path] = entry
    return found


def _source_and_sd(table: Table, name: str, path: str, said: Any) -> core.Provenance | None:
    """Read one entry; None with the fault noted."""
    own = table.child(name, said) if isinstance(said, dict) else None
    source = said if own is None else own.get("source")
    if own is not None:
        own.check_names("source", "sd")
    if not isinstance(source, str) or source not in core.SOURCES:
        shown = "has no source" if source is None else f"= {repr(source)[:40]} is no source"
        table.add(name, f"provenance.{path} {shown}; expected one of {quoted(core.SOURCES)}")
        return None
    sd = None if own is None else own.number("sd", _Deviation(core.KEYS[path].high, core.KEYS[path].unit))
    return core.Provenance(source, sd)  # type: ignore[arg-type]


def _known(table: Table) -> dict[str, core.Known]:
    """Read known faults: `"signal_delay@torque" = { delay = 0.03, spread = 0.005 }`."""
    found: dict[str, core.Known] = {}
    if not table.values:
        return found
    # the effects bring the simulator's records, a tenth of a second: few vehicle files need them
    from aqualog.model.effects import EFFECTS
    from aqualog.model.term import Term

    for key, value in table.values.items():
        name, _, where = key.partition("@")
        effect = EFFECTS.get(name)
        if effect is None:
            table.unknown(key, EFFECTS, what="effect")
            continue
        names = [p.name for p in effect.parameters]
        if not isinstance(value, dict) or not set(names) & set(value):
            table.add(key, f"known.{key} has no value; expected {{ {names[0]} = ..., spread = ... }}")
            continue
        own, first = table.child(key, value), effect.parameters[0]
        values = own.numbers({p.name: p for p in effect.parameters}, "spread")
        spread = own.number("spread", _Deviation(first.high - first.low, first.unit))
        try:
            place = Term(effect, values, where or None).place
        except ConfigError as error:
            table.add(key, error.line())
            continue
        found[name if place is None else f"{name}@{place}"] = core.Known(values, spread or 0.0)
    return found


def _water(table: Table) -> dict[str, core.WaterNumber]:
    """Read numbers of the law of water: `v_anchor = { value = 33.1, sd = 0.4 }`, or the plain number."""
    table.check_names(*core.WATER)
    found: dict[str, core.WaterNumber] = {}
    if not table.values:
        return found
    from aqualog.model.tyre import TYRE_KEYS

    for name in (n for n in table.values if n in core.WATER):
        given, key = table.get(name), TYRE_KEYS[name]
        own = table.child(name, given if isinstance(given, dict) else {name: given})
        own.check_names("value", "sd", "source") if isinstance(given, dict) else None
        value = own.number("value" if isinstance(given, dict) else name, key)
        if value is None:
            if isinstance(given, dict) and "value" not in given:
                table.add(name, f"water.{name} has no value; expected {{ value = ..., sd = ... }}")
            continue
        sd = own.number("sd", _Deviation(key.high, key.unit)) if isinstance(given, dict) else None
        source = own.choice("source", core.SOURCES, "calibrated") if isinstance(given, dict) else "data_sheet"
        found[name] = core.WaterNumber(value, sd or 0.0, source)  # type: ignore[arg-type]
    return found


class _Deviation(NamedTuple):
    """Bounds of a standard deviation: at most as large as its key may be."""

    high: float
    unit: str
    low: float = 0.0


def _polynomial(table: Table, section: str) -> dict[str, tuple[float, ...]]:
    """Read `F = c0 + c_y F_y + c_x F_x`, higher powers as lists."""
    result: dict[str, tuple[float, ...]] = {}
    for name, value in table.values.items():
        if name not in core.COEFFICIENTS:
            table.unknown(name, core.COEFFICIENTS)
            continue
        numbers = value if isinstance(value, list) else [value]
        wrong = _wrong(name, numbers)
        if wrong:
            table.add(name, f"[{section}] {name} = {str(value)[:60]} {wrong}")
        else:
            result[name] = tuple(float(n) for n in numbers)
    return result


def _wrong(name: str, numbers: list[Any]) -> str:
    """Say what is wrong with the numbers of a coefficient; empty if they are valid."""
    if not numbers or not all(is_real(n) for n in numbers):
        return "is not a number or a list of numbers"
    most = 1 if name in ("c0", "sigma") else MOST_POWERS
    if len(numbers) > most:
        return f"has {len(numbers)} values; expected {'one' if most == 1 else f'at most {most} powers'}"
    if name == "sigma":
        return "" if 0.0 < numbers[0] <= LARGEST_TERM else f"is outside 0 ... {LARGEST_TERM:g}, 0 excluded"
    for power, n in enumerate(numbers, 0 if name == "c0" else 1):
        bound = LARGEST_TERM if power == 0 else LARGEST_GAIN / TYPICAL_FORCE ** (power - 1)
        if not abs(n) <= bound:
            return f"is outside -{bound:g} ... {bound:g}" + (f" in power {power}" if power > 1 else "")
    return ""


def calibrated_toml(vehicle: core.Vehicle, calibration: Calibration) -> str:
    """Return the text of a vehicle file that `load_vehicle` reads.

    Keys that neither the old file gives nor the drives identify stand as comments: no default looks like a given value.
    Values have seven digits.
    """
    from aqualog.calibrate.derive import calibrated, identified_values

    new = calibrated(vehicle, calibration.parameters, calibration.transfers, calibration.spread)
    values = identified_values(calibration.parameters, vehicle)
    name = new.name.replace("\\", "").replace('"', "")
    drives = ", ".join(_plain(d.name) for d in calibration.drives)
    # a comment where the driven axle is not known, so that no assumption looks given
    axle = f'drivetrain = "{new.drivetrain}"' if new.knows_drivetrain else '# drivetrain: SET "rwd", "fwd" or "awd"'
    lines = [f"# calibrated from {drives}", f'name = "{name}"', axle, *core.arm_lines(new)]
    section = ""
    for key in core.KEYS.values():
        if key.section != section:
            section = key.section
            lines += ["", f"[{section}]"]
        value = getattr(new, key.name)
        line = f"{key.name} = {value!r}  # [{key.unit}] {key.meaning}"
        kept = next((p for p in calibration.parameters if p.kept and p.name == key.name), None)
        if kept is not None:
            line += "; kept, the drives show {} ({} ... {})".format(*same_decimals(kept.value, kept.ci95))
        elif key.path in values:
            line += "; " + _source(values[key.path][1])
        elif key.path not in new.given:
            line = f"# {line}; not identified, default"
        lines.append(line)
    if new.spread:
        lines += ["", "[spread]", "# standard deviation by which one more drive differs", *core.spread_lines(new)]
    if new.provenance:
        lines += ["", "[provenance]", "# where a value comes from; sd: its standard deviation"]
        lines += core.provenance_lines(new)
    if new.known:
        lines += ["", "[known]", "# faults of this car that are known", *core.known_lines(new)]
    if new.water:
        lines += ["", "[water]", "# how its tyres float", *core.water_lines(new)]
    for part in core.POLYNOMIALS:
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
    _, low, high = same_decimals(p.value, p.ci95)
    return f"calibrated, 95 %: {low} ... {high}" + (f" ({p.remark})" if p.remark else "")


def _plain(text: str) -> str:
    """One printable line."""
    return "".join(c if c.isprintable() else "?" for c in text)

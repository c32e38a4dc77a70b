"""The generated reference holds every option, key, signal, variable and exit code, and is what the generator makes."""

import re
import tomllib
from pathlib import Path

import pytest

import aqualog
from aqualog.book.__main__ import generated
from aqualog.book.markdown import table, units
from aqualog.book.reference import PAGES
from aqualog.book.reference.model import EFFECTS_EXAMPLE, vehicle_example
from aqualog.book.reference.settings import BOUNDARIES_EXAMPLE, MAP_EXAMPLE, THRESHOLDS_EXAMPLE
from aqualog.book.topics import DOCS
from aqualog.campaign.definition import GROUP_NAMES
from aqualog.cli.commands import loaded
from aqualog.config.boundary import BOUNDARY_KEYS, load_boundaries
from aqualog.config.campaign import CAMPAIGN_KEYS, RUN_KEYS
from aqualog.config.labels import LABEL_KEYS
from aqualog.config.model import load_model
from aqualog.config.scenario import SCENARIO_KEYS
from aqualog.config.signal_map import MAP_KEYS, load_signal_map
from aqualog.config.thresholds import JOINT_KEYS, load_settings, load_thresholds
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ExitCode
from aqualog.core.notation import ACCEPTED, SYMBOLS
from aqualog.core.units import spellings
from aqualog.core.vehicle import COEFFICIENTS, KEYS, POLYNOMIALS, SOURCES, SPREAD
from aqualog.detect.registry import DETECTORS, RIVALS
from aqualog.detect.slip_slope.tuning import MEANINGS, TUNING
from aqualog.model.effects import EFFECTS, EMPIRICAL
from aqualog.model.simulate import TRUTH_SYMBOLS
from aqualog.model.tyre import TYRE_KEYS, TYRES

PACKAGE = Path(aqualog.__file__).parent
FILES = generated()


def page(name):
    return (DOCS / "reference" / f"{name}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(DOCS)))
def test_files_are_what_the_generator_makes(path):
    """Red: run `python -m aqualog.book`."""
    assert path.read_text(encoding="utf-8") == FILES[path]


def test_no_page_of_the_reference_is_left_over():
    assert {p.stem for p in (DOCS / "reference").iterdir()} == set(PAGES)


def commands():
    for name, command in loaded().items():
        yield name, command
        yield from ((f"{name} {n}", c) for n, c in getattr(command, "commands", {}).items())


@pytest.mark.parametrize(("name", "command"), list(commands()), ids=lambda x: x if isinstance(x, str) else "")
def test_every_option_and_example_of_a_command(name, command):
    entry = page("commands").split(f"\n## `aqualog {name}`\n")[1].split("\n## ")[0]
    flat = " ".join(entry.split())
    for param in command.params:
        for option in (*param.opts, *param.secondary_opts):
            assert f"`{option}`" in entry or param.param_type_name == "argument"
        assert units(" ".join((param.help or "").split())).replace("|", "\\|") in flat
        if param.metavar:
            assert param.metavar.replace("|", "\\|") in entry
        if param.param_type_name == "option" and not param.is_flag:
            value = re.search(rf"`{max(param.opts, key=len)}`[^|]*\| ([^|]*)", entry)[1]
            assert re.match(r"[A-Za-z]", value), param.name
    examples = re.findall(r"^ *(aqualog .+)$", (command.help or "").partition("Examples:")[2], re.M)
    assert all(e in entry for e in examples)
    assert examples or getattr(command, "commands", None)


NAMES = {
    "signals": [*SYMBOLS, *ACCEPTED, *TRUTH_SYMBOLS, *(s for _, listed in spellings() for s in listed)],
    "map": [k.name for k in MAP_KEYS],
    "vehicle": [
        "name", "drivetrain", *KEYS, *(f"{p}.{c}" for p in POLYNOMIALS for c in COEFFICIENTS),
        *(f"spread.{s}" for s in SPREAD), *SOURCES,
    ],
    "campaign": [*(k.name for k in CAMPAIGN_KEYS), *RUN_KEYS, *GROUP_NAMES, *(k.name for k in LABEL_KEYS)],
    "scenario": [*SCENARIO_KEYS, *TYRE_KEYS, *TYRES],
    "effects": [*EFFECTS, *EMPIRICAL, *(p.name for e in EFFECTS.values() for p in e.parameters), "knots", "where"],
    "thresholds": [*DETECTORS, *RIVALS, *(k.name for k in JOINT_KEYS), *TUNING._asdict()],
    "boundaries": [k.name for k in BOUNDARY_KEYS],
    "exit_codes": [str(int(c)) for c in ExitCode],
    "python": [f"aq.{n}" for n in aqualog.__all__ if not n.startswith("__")],
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_every_name_of_the_tables(name):
    text = page(name)
    assert [n for n in NAMES[name] if f"`{n}`" not in text] == []


def test_every_variable_of_the_environment():
    code = "\n".join(p.read_text(encoding="utf-8") for p in PACKAGE.rglob("*.py") if "book" not in p.parts)
    used = set(re.findall(r"\bAQUALOG_[A-Z_]+\b", code))
    used |= set(re.findall(r"environ(?:\.get\(|\[|\.setdefault\()\"([A-Z_]+)\"", code))
    used -= {"RUST_BACKTRACE"}  # of a library, set for it
    assert used
    assert [n for n in sorted(used) if f"`{n}`" not in page("environment")] == []


def test_defaults_of_the_vehicle():
    for key in KEYS.values():
        assert re.search(rf"\| `{re.escape(key.path)}` \| [^|]+ \| {re.escape(f'{key.default:g}')} \|", page("vehicle"))


def test_every_number_of_the_tuning_has_a_meaning():
    assert set(MEANINGS) == set(TUNING._fields)


def test_the_vehicle_example_loads_with_every_key(tmp_path):
    (tmp_path / "car.toml").write_text(vehicle_example())
    car = load_vehicle(tmp_path / "car.toml")
    assert set(KEYS) <= car.given
    assert set(car.spread) == set(SPREAD)
    assert {p.source for p in car.provenance.values()} == set(SOURCES)
    assert all(set(getattr(car, p)) == set(COEFFICIENTS) for p in POLYNOMIALS)


def test_the_map_example_loads_with_every_key(tmp_path):
    (tmp_path / "map.toml").write_text(MAP_EXAMPLE)
    assert len(load_signal_map(tmp_path / "map.toml").entries) == 4
    used = tomllib.loads(MAP_EXAMPLE)
    flat = str(used)
    assert all(f"'{k.name.removeprefix('SIGNAL.')}'" in flat for k in MAP_KEYS)


def test_the_other_examples_load(tmp_path):
    (tmp_path / "m.toml").write_text(EFFECTS_EXAMPLE)
    assert len(load_model(tmp_path / "m.toml").terms) == 2
    (tmp_path / "t.toml").write_text(THRESHOLDS_EXAMPLE)
    load_thresholds(tmp_path / "t.toml")
    (tmp_path / "b.toml").write_text(BOUNDARIES_EXAMPLE)
    assert [p.name for p in load_boundaries(tmp_path / "b.toml").plots] == ["a_x over t", "a_y over steer_angle"]
    assert load_settings(tmp_path / "t.toml").joint_cusum.with_slope is False


def test_units_are_printed_outside_of_code():
    assert table(("a",), [("1 m/s^2 | `m/s^2` kg*m^2 N*m +-5 x(2.3)^2",)]).splitlines()[-1] == (
        "| 1 m/s² \\| `m/s^2` kg·m² N·m ±5 x(2.3)² |"
    )

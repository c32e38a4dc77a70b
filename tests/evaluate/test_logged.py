"""Rivals that are in the log: an exact one, a late one, one by a level, and what may be wrong with them."""

import json

import numpy as np
import polars as pl
import pytest

from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import vehicle_toml
from aqualog.evaluate.drives import LogSource
from aqualog.evaluate.labels import V_MIN
from aqualog.evaluate.logged import LoggedRival, parse_rivals
from aqualog.io.write_table import TableColumn, write_csv
from aqualog.model.log import write_simulation
from aqualog.model.simulate import simulate
from tests import commands
from tests.evaluate.made import RWD, scenario

LATE_S = 1.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two drives on water and a dry one, each with channels of detectors of its own."""
    path = tmp_path_factory.mktemp("rivals")
    (path / "car.toml").write_text(vehicle_toml(RWD), encoding="utf-8")
    for i, (name, kmh, depth) in enumerate((("deep", 118.0, 1.8), ("deep2", 122.0, 2.0), ("dry", 90.0, 0.0)), 1):
        made = simulate(scenario(RWD, "worn_summer", kmh, depth, seed=i))
        write_simulation(path / f"{name}.parquet", made, suffix=".parquet", comment="")
        frame = pl.read_parquet(path / f"{name}.parquet")
        t = frame["t"].to_numpy()
        contact = np.min([frame[f"true_contact_{w}"].to_numpy() for w in ("fl", "fr", "rl", "rr")], axis=0)
        on = (contact < 0.7) & (frame["v_x"].fill_null(0.0).to_numpy() > V_MIN)
        late = np.interp(t - LATE_S, t, on.astype(float)) > 0.5
        frame = frame.with_columns(
            pl.Series("own.exact", on), pl.Series("own.late", late), pl.Series("own.level", 1.0 - contact),
            pl.Series("own.stuck", np.zeros(t.size)), pl.Series("own.always", np.ones(t.size)),
        )  # fmt: skip
        if name != "dry":
            frame = frame.with_columns(pl.Series("own.wet_only", on))
        frame.write_parquet(path / f"{name}.parquet")
    return path


def evaluated(folder, *rivals, code=0, logs=("deep", "deep2", "dry"), more=()):
    given = [x for r in rivals for x in ("--rival", r)]
    names = [folder / f"{n}.parquet" for n in logs]
    done = commands.run("evaluate", *names, "--vehicle", folder / "car.toml", *given, *more, "--json")
    assert done.exit_code == code, done.stderr
    return done, json.loads(done.stdout) if done.stdout else None


def test_an_exact_and_a_late_rival(folder):
    _, d = evaluated(folder, "exact=own.exact", "late=own.late", "level=own.level>=0.3")
    exact, late, level = (d["detectors"][n]["partial"] for n in ("exact", "late", "level"))
    joint = d["detectors"]["joint_cusum"]["partial"]
    assert exact["episodes"] == joint["episodes"] == 2
    assert exact["recall"] == late["recall"] == level["recall"] == 1.0
    assert exact["latency_median_s"] == pytest.approx(0.0, abs=0.02)
    assert late["latency_median_s"] == pytest.approx(LATE_S, abs=0.03)
    assert level["latency_median_s"] == pytest.approx(0.0, abs=0.05)
    assert d["detectors"]["exact"]["false_alarms"]["count"] == 0
    # of full aquaplaning, which must be found within 0.5 s, the late one is on only where partial came long before
    assert d["detectors"]["exact"]["full"]["recall"] == 1.0
    assert d["detectors"]["exact"]["drives"] == 3
    assert d["logged"] == {"exact": "own.exact", "late": "own.late", "level": "own.level>=0.3"}


def test_the_same_rules_as_for_aqualog(folder):
    _, d = evaluated(folder, "always=own.always")
    always = d["detectors"]["always"]
    # on before the water: it finds nothing, and each drive has its false alarm
    assert always["partial"]["recall"] == 0.0
    assert always["false_alarms"]["count"] >= 3


def test_where_it_is_better_or_not_is_said(folder):
    _, d = evaluated(folder, "late=own.late", "always=own.always")
    assert not any("always is better" in s for s in d["sentences"])
    done, _ = evaluated(folder, "exact=own.exact", more=("--gate", "exact.recall>=0.99"))
    assert json.loads(done.stdout)["gates"][0]["kept"]
    evaluated(folder, "late=own.late", code=5, more=("--gate", "late.latency_median_s<=0.5"))


def test_table_and_page_call_it_a_rival(folder, tmp_path):
    names = [folder / "deep.parquet", folder / "dry.parquet"]
    given = ("evaluate", *names, "--vehicle", folder / "car.toml", "--rival", "my_own=own.exact", "--roc")
    done = commands.run(*given, "-o", tmp_path / "page.html")
    assert done.exit_code == 0, done.stderr
    assert "\nmy_own " in done.stdout
    assert "my_own" in (tmp_path / "page.html").read_text()


def test_a_channel_that_one_log_lacks(folder):
    done, d = evaluated(folder, "wet=own.wet_only", code=3)
    assert "rival wet: not in 1 of 3 drives, the first is " in done.stderr
    assert "dry.parquet" in done.stderr
    assert d["detectors"]["wet"]["drives"] == 2
    assert d["detectors"]["wet"]["unavailable"] == 1
    assert any('rival wet: no channel "own.wet_only"' in n for n in d["notes"])


def test_a_channel_that_no_log_has(folder):
    done, _ = evaluated(folder, "x=own.exakt", code=4)
    assert 'no channel "own.exakt" (nearest: "own.exact")' in done.stderr


def test_a_channel_that_is_never_on(folder):
    done, d = evaluated(folder, "stuck=own.stuck", code=3)
    assert 'channel "own.stuck" is never on: its values are 0 ... 0' in done.stderr
    assert d["detectors"]["stuck"]["partial"]["recall"] == 0.0
    done, _ = evaluated(folder, "high=own.level>7", code=3)
    assert "level >7" in done.stderr


def test_numbers_need_a_level(folder):
    done, _ = evaluated(folder, "level=own.level", code=4, logs=("deep",))
    assert "holds numbers (" in done.stderr
    assert "--rival 'level=own.level>=LEVEL'" in done.stderr


def test_another_sample_rate_on_its_own_clock(folder, tmp_path):
    """A channel of 5 Hz in a file of its own, whose clock begins elsewhere than the drive's."""
    frame = pl.read_parquet(folder / "deep.parquet")
    t, on = frame["t"].to_numpy(), frame["own.exact"].to_numpy()
    at = np.arange(0.07, t[-1], 0.2)
    slow = np.interp(at, t, on.astype(float)).round()
    columns = [c for c in frame.columns if c == "t" or not c.startswith("own.")]
    # the wheels come a second after the other signals: t = 0 is theirs
    wheels = [
        pl.when(pl.col("t") >= 3.0).then(pl.col(f"omega_{w}")).alias(f"omega_{w}") for w in ("fl", "fr", "rl", "rr")
    ]
    frame.select(columns).filter(pl.col("t") >= 2.0).with_columns(wheels).write_parquet(tmp_path / "drive.parquet")
    write_csv(tmp_path / "flags.csv", [TableColumn("t", "s", at), TableColumn("flag", "", slow)])
    source = LogSource(
        "d", (tmp_path / "drive.parquet", tmp_path / "flags.csv"), RWD, rivals=(LoggedRival("slow", "flag"),),
    )  # fmt: skip
    heard = source.load().heard["slow"]
    first = t[np.flatnonzero(on)[0]] - 2.0
    assert heard.spans[0][0] == pytest.approx(first, abs=0.21)
    assert "5 Hz" in heard.note
    assert "known to 0.2 s" in heard.note


@pytest.mark.parametrize(
    ("text", "told"),
    [("exact", "is no rival; expected NAME=CHANNEL"), ("spin_down=x", '"spin_down" is a detector of aqualog'),
     ("a=x>=high", '"high" is no number'), ("1a=x", "is no rival")],
)  # fmt: skip
def test_forms(text, told):
    with pytest.raises(ConfigError) as caught:
        parse_rivals([text])
    assert told in str(caught.value)
    with pytest.raises(ConfigError, match="given twice"):
        parse_rivals(["a=x", "a=y"])


def test_levels():
    assert parse_rivals(["a=Bus.Msg.Sig >= 2.5", "b=x<-1", "c=/dai/flag"]) == (
        LoggedRival("a", "Bus.Msg.Sig", ">=", 2.5), LoggedRival("b", "x", "<", -1.0), LoggedRival("c", "/dai/flag"),
    )  # fmt: skip

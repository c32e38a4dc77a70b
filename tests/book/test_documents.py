"""Every JSON document is as its schema says, the schemas come from the field tables, and the reference has every field."""

import json
from types import SimpleNamespace

import polars as pl
import pytest
from typer.testing import CliRunner

from aqualog.book.documents import DOCUMENTS
from aqualog.book.documents.fields import number, obj, paths, rows, schema, text
from aqualog.book.documents.tables import TABLES
from aqualog.book.topics import DOCS
from aqualog.cli.commands import COMMANDS
from aqualog.cli.main import app
from tests.conftest import ROOT

jsonschema = pytest.importorskip("jsonschema")

SAMPLES = ROOT / "sample_logs"
CAR = ("--vehicle", str(SAMPLES / "vehicle.toml"))
MF4 = str(SAMPLES / "lane_drive.mf4")
MONDAY, FRIDAY = (str(SAMPLES / f"loaded_{day}.parquet") for day in ("monday", "friday"))
PAGE = (DOCS / "reference" / "documents.md").read_text(encoding="utf-8")


TESTS = ("test straight", "test curve", "test braking")


def complaints(name, document):
    stored = json.loads((DOCS / "schemas" / f"{name}.schema.json").read_text(encoding="utf-8"))
    validator = jsonschema.Draft202012Validator(stored)
    return [f"{'.'.join(map(str, e.absolute_path))}: {e.message[-200:]}" for e in validator.iter_errors(document)]


def printed(*arguments):
    result = CliRunner().invoke(app, list(map(str, arguments)))
    assert result.exit_code in (0, 3), result.stderr
    return json.loads(result.stdout)


@pytest.mark.parametrize("name", DOCUMENTS)
def test_schemas_are_schemas(name):
    jsonschema.Draft202012Validator.check_schema(schema(DOCUMENTS[name]))


def test_no_schema_is_left_over():
    assert {p.name for p in (DOCS / "schemas").iterdir()} == {f"{n}.schema.json" for n in DOCUMENTS}


@pytest.mark.parametrize(
    "command", [*(c for c in COMMANDS if c not in ("campaign", "test", "watch")), "campaign init", *TESTS]
)
def test_every_command_that_prints_json_has_a_document(command):
    shown = CliRunner().invoke(app, [*command.split(), "--help"], env={"COLUMNS": "200", "NO_COLOR": "1"})
    has_document = any(f"{d.heading} ".startswith(f"aqualog {command} ") for d in DOCUMENTS.values())
    assert ("--json" in shown.stdout.split("Options:")[1]) == has_document


@pytest.mark.parametrize("document", DOCUMENTS.values(), ids=lambda d: d.name)
def test_every_field_is_explained_in_the_reference(document):
    entry = PAGE.split(f"\n## `{document.heading}`\n")[1].split("\n## ")[0]
    for path, field in paths(document.fields):
        assert field.meaning, path
        assert f"{field.name}` |" in entry, path
        assert all(f"`{v}`" in entry for v in field.values if v)


@pytest.mark.parametrize("table", TABLES, ids=lambda t: t.name)
def test_every_column_is_explained_in_the_reference(table):
    entry = PAGE.split(f"\n## `{table.name}`\n")[1].split("\n## ")[0]
    assert all(f"| `{c.name}` |" in entry and c.meaning for c in table.columns)


def test_what_is_not_in_the_table_is_an_error():
    one = SimpleNamespace(
        source="x", summary="y", fields=(number("a", "m", "b"), rows("r", "c", (text("t", "d", ("u",)),)))
    )
    validator = jsonschema.Draft202012Validator(schema(one))
    assert not list(validator.iter_errors({"a": 1.5, "r": [{"t": "u"}]}))
    for wrong in ({"a": 1.5, "r": [], "z": 0}, {"a": None, "r": []}, {"r": []}, {"a": 1, "r": [{"t": "v"}]}):
        assert list(validator.iter_errors(wrong))


def test_paths_name_lists_and_tables():
    fields = (obj("a", "m", (rows("b", "m", (text("c", "m"),)),)),)
    assert [p for p, _ in paths(fields)] == ["a", "a.b", "a.b[].c"]


DRIVES = {
    "detect": ("detect", MF4, *CAR),
    "slip_slope": ("slip-slope", MONDAY, *CAR),
    "inspect": ("inspect", MF4),
    "doctor": ("doctor", MF4, *CAR),
    "cache": ("cache",),
    "calibrate": ("calibrate", MONDAY, FRIDAY, *CAR),
    "validate": ("validate", MONDAY, *CAR, "--no-why"),
}


@pytest.mark.parametrize("name", DRIVES)
def test_documents_of_drives(name):
    assert complaints(name, printed(*DRIVES[name], "--json")) == []


def test_document_of_a_start(tmp_path):
    assert (
        complaints("init", printed("init", str(SAMPLES / "lane_drive.csv"), "-o", str(tmp_path / "work"), "--json"))
        == []
    )


def test_document_of_clocks(tmp_path):
    late = pl.read_parquet(MONDAY).select((pl.col("t") + 0.3).alias("t [s]"), pl.col("v_x").alias("v_x [m/s]"))
    late.write_csv(tmp_path / "late.csv")
    assert complaints("align", printed("align", MONDAY, tmp_path / "late.csv", "--quantity", "speed", "--json")) == []


def test_documents_that_are_files(tmp_path):
    printed(
        "detect", MF4, *CAR, "--json", "-o", tmp_path / "out", "--history", tmp_path / "slopes.json",
        "--configuration", "x",
    )  # fmt: skip
    assert complaints("detect", json.loads((tmp_path / "out" / "events.json").read_text())) == []
    assert complaints("history", json.loads((tmp_path / "slopes.json").read_text())) == []
    known = {c.name for t in TABLES if t.name == "signals.parquet" for c in t.columns}
    assert known == {"t", "SIGNAL", "DETECTOR_PLACE", "DETECTOR_PLACE_bit", "aquaplaning_margin"}
    written = pl.read_parquet_schema(tmp_path / "out" / "signals.parquet")
    assert {f"aquaplaning_margin{end}" for end in ("", "_low", "_high")} <= set(written)
    printed("slip-slope", MONDAY, *CAR, "--json", "-o", tmp_path / "slope")
    assert complaints("slip_slope", json.loads((tmp_path / "slope" / "slip_slope.json").read_text())) == []
    heading = (tmp_path / "slope" / "slip_slope.csv").read_text().splitlines()[0].split(",")
    assert heading == columns("slip_slope.csv")


def columns(name):
    return [c.name for t in TABLES if t.name == name for c in t.columns]


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """Four simulated drives as a campaign, with results."""
    folder = tmp_path_factory.mktemp("campaign")
    scenario = (
        (SAMPLES / "scenario.toml").read_text().replace('"vehicle.toml"', f'"{(SAMPLES / "vehicle.toml").as_posix()}"')
    )
    lines = ["log,tyre,water_depth_mm,x_driver,lane_start_s,lane_end_s"]
    for seed in (1, 2, 3, 4):
        (folder / "s.toml").write_text(scenario.replace("seed = 7", f"seed = {seed}"))
        document = printed("simulate", folder / "s.toml", "-o", folder / f"worn_1.3mm_{seed}.parquet", "--json")
        assert complaints("simulate", document) == []
        lines.append(f"worn_1.3mm_{seed}.parquet,worn_summer,1.3,{'ab'[seed % 2]},8,16")
    (folder / "runs.csv").write_text("\n".join(lines) + "\n")
    car = (SAMPLES / "vehicle.toml").as_posix()
    (folder / "campaign.toml").write_text(f'name = "c"\nvehicle = "{car}"\nruns = "runs.csv"\n')
    assert (
        complaints("plan", printed("plan", folder / "campaign.toml", "--jobs", "1", "--within", "1h", "--json")) == []
    )
    assert complaints("batch", printed("batch", folder / "campaign.toml", "--jobs", "1", "--json")) == []
    return folder


CAMPAIGNS = {
    "inspect_campaign": ("inspect",),
    "plan": ("plan",),
    "batch": ("batch",),
    "bin_slipslope": ("bin-slipslope", "--by", "tyre,x_driver"),
    "bin_resistance": ("bin-resistance",),
    "evaluate": ("evaluate", "--by", "tyre,x_driver", "--rivals", "--gate", "joint_criteria.drives>=1"),
}


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_documents_of_campaigns(name, campaign):
    command, *options = CAMPAIGNS[name]
    assert complaints(name, printed(command, campaign / "campaign.toml", *options, "--json")) == []


def test_document_of_a_proposed_campaign(campaign, tmp_path):
    document = printed("campaign", "init", campaign, "-o", tmp_path / "new" / "campaign.toml", "--json")
    assert complaints("campaign_init", document) == []


def test_tables_of_a_store(campaign):
    store = campaign / "campaign.store"
    assert complaints("manifest", json.loads((store / "manifest.json").read_text())) == []
    for name, given in (
        ("events.parquet", store / "events.parquet"),
        ("samples/KEY.parquet", next((store / "samples").iterdir())),
    ):
        told = [
            n.replace("WHEEL", w) for n in columns(name) for w in (("fl", "fr", "rl", "rr") if "WHEEL" in n else ("",))
        ]
        assert set(pl.read_parquet_schema(given)) <= set(told)
    told = set(columns("runs.parquet"))
    there = {f"events_{'DETECTOR'}" if c.startswith("events_") else "x_..." if c.startswith("x_") else c
             for c in pl.read_parquet_schema(store / "runs.parquet")}  # fmt: skip
    assert there == told


def test_tables_of_a_report(campaign, tmp_path):
    assert (
        CliRunner()
        .invoke(app, ["report", str(campaign / "campaign.toml"), "-o", str(tmp_path / "r"), "--by", "tyre"])
        .exit_code
        == 0
    )
    for name in (t.name for t in TABLES if t.name.startswith("data/")):
        heading = (tmp_path / "r" / name).read_text().splitlines()[0].split(",")
        keys = {"tyre", "water_depth_mm", "x_driver", "lane_start_s", "lane_end_s"}
        shown = ["KEY" if h in keys else "events_DETECTOR" if h.startswith("events_") else h for h in heading]
        assert set(shown) <= set(columns(name)), name
        assert set(columns(name)) - set(shown) <= {"place", "KEY"}, name


def test_document_of_figures(tmp_path):
    document = printed("figures", "2.25", "3.6", "-o", tmp_path / "f", "--format", "csv", "--json")
    assert complaints("figures", document) == []


def test_document_of_a_reproduction():
    from aqualog.thesis.claims import Check, Claim, Conclusion
    from aqualog.thesis.export import claims_document
    from aqualog.thesis.record import Figure

    checks = (
        Check("C7", "above 0", "1.5", "reproduced", value=1.5, ci95=(1.0, 2.0), unit="s"),
        Check("C7", "above 0", "none", "reproduced"),
    )
    conclusions = (Conclusion(Claim("C7", "2.1", "it is", "N", {}), checks, "reproduced"),)
    figure = Figure("2.25", "title", "", ())
    made = claims_document(conclusions, [figure], {"2.3": "no runs"}, {"conditions": ["so"]})
    assert complaints("reproduce", json.loads(json.dumps(made))) == []


@pytest.mark.nightly
@pytest.mark.parametrize("inputs", ["drive", "campaign"])
def test_document_of_a_diagnosis(inputs, campaign):
    given = (MONDAY, *CAR, "--holdout", FRIDAY) if inputs == "drive" else (campaign / "campaign.toml",)
    assert complaints("diagnose", printed("diagnose", *given, "--json")) == []


CONTRACT = {
    "detect": "schema_version tool_version log duration_s sample_rate_hz signals.NAME.channel signals.NAME.unit "
    "signals.NAME.rate_hz signals.NAME.missing_fraction events[].detector events[].wheel events[].side events[].start_s "
    "events[].end_s events[].severity events[].peak events[].threshold events[].evidence.v_x events[].evidence.slip_min "
    "unavailable[].detector unavailable[].missing quality.dropped_samples quality.time_jumps quality.truncated",
    "bin_slipslope": "rows[].wheel rows[].v_low_kmh rows[].v_high_kmh rows[].runs rows[].samples rows[].slope "
    "rows[].slope_ci95 rows[].intercept rows[].r2",
    "bin_resistance": "rows[].v_low_kmh rows[].v_high_kmh rows[].runs rows[].samples rows[].delta_a_x rows[].delta_a_x_ci95",
    "test_straight": "runs[].log runs[].v_15_kmh runs[].censored runs[].valid runs[].reason sets[].tyre sets[].runs "
    "sets[].mean_kmh sets[].ci95 sets[].cv sets[].index sets[].index_ci95",
    "test_curve": "runs[].log runs[].valid runs[].reason sets[].tyre sets[].runs sets[].ci95 sets[].index sets[].index_ci95",
    "test_braking": "runs[].log runs[].bfc runs[].valid runs[].reason sets[].tyre sets[].runs sets[].mean sets[].ci95 "
    "sets[].cv sets[].index sets[].index_ci95",
    "diagnose": "verdict causes[].effect causes[].where causes[].parameters.NAME.value causes[].parameters.NAME.ci95 "
    "causes[].parameters.NAME.unit causes[].explains causes[].sentence alternatives unexplained[].channel "
    "unexplained[].depends_on unexplained[].share gain.channel.NAME.rmse_before gain.channel.NAME.rmse_after "
    "gain.heldout_log_score_gain gain.ci95 gain.heldout false_alarm_level detection_limits next_manoeuvre.name "
    "next_manoeuvre.separates next_manoeuvre.sentence extended_model",
}  # fmt: skip


@pytest.mark.parametrize("name", CONTRACT)
def test_fields_that_others_rely_on_are_always_there(name):
    known = dict(paths(DOCUMENTS[name].fields))
    for path in CONTRACT[name].split():
        assert path in known, path
        is_fixed = known[path].is_always or path.startswith(("events[].evidence.", "rows[].wheel", "signals.NAME."))
        assert is_fixed, path

"""Names that mean harm, and pages that have them in every place that a user, a log or a configuration can name."""

import json
from dataclasses import replace

import numpy as np

from aqualog.calibrate.records import Calibration, DriveFit, Parameter
from aqualog.campaign.bins import plan
from aqualog.campaign.results import CampaignData, load_results
from aqualog.campaign.store import Store
from aqualog.config.configured import configure
from aqualog.core.records import Unavailable
from aqualog.detect.slip_slope.direct import DirectResult
from aqualog.detect.thresholds import DEFAULT
from aqualog.evaluate.records import Cell, DetectorRun, RunRecord
from aqualog.evaluate.run import Evaluation
from aqualog.report.calibration import calibration_report
from aqualog.report.campaign.findings import find
from aqualog.report.campaign.folder import page_names
from aqualog.report.campaign.page import campaign_page
from aqualog.report.campaign.run_page import run_page
from aqualog.report.diagnosis.sections import diagnosis_report
from aqualog.report.drive.report import drive_page
from aqualog.report.evaluation import evaluation_report
from aqualog.report.page import report_page
from aqualog.report.slope import slope_report
from aqualog.thesis.claims import DIFFERENCE, VERDICTS, Check, claims
from aqualog.thesis.page import render_figures, render_reproduction
from aqualog.thesis.record import Axis, Figure, Line, Panel, Table
from aqualog.thesis.run import Made, conclude
from tests.report import fake_result as fake
from tests.report.diagnosis.test_document import document_of
from tests.report.diagnosis_case import views_of

NAMES = {
    "script": "</script><script>alert(1)</script>",
    "image": "<img src=x onerror=alert(1)>",
    "attribute": "\"><svg onload=alert(1)> ' onmouseover='alert(1)",
    "link": '<a href="javascript:alert(1)">x</a><b>bold</b><br>%{y} $x$ &lt;i&gt;',
    "terminal": "[bold]red[/] \x1b[31mred\x1b[0m \x07 \u202eback\u2066 \x85",
    "formula": '=cmd|" /C calc"!A0',
    "path": "../../x",
    "comment": "--> <!-- ]]> {{ 7*7 }} {% raw %} /*<plotly.js>*/ \u2028",
    "long": "y" * 1_000_000,
    "long with spaces": "many words " * 100_000,
}


def drive(name):
    result = fake.make_result()
    origins = {s: replace(o, channel=name, file=name, unit=name) for s, o in result.signals.origins.items()}
    quality = replace(result.signals.quality, notes=(name,))
    tracks = tuple(replace(t, detector=name, unit=name) if t.detector == "resistance" else t for t in result.tracks)
    events = tuple(replace(e, evidence={**e.evidence, name: name}, detector=name) for e in result.events)
    missing = (Unavailable(name, (name, name)),)
    return fake.judged(replace(
        result, signals=replace(result.signals, origins=origins, files=(name, name), quality=quality), tracks=tracks,
        events=events, unavailable=missing, limited=missing, vehicle_name=name, notes=(name,),
    ))  # fmt: skip


def eventful(name):
    """With a table that the script fills."""
    result = drive(name)
    return replace(result, events=result.events * 40)


def figure(name):
    line = Line(name, np.array([0.0, 1.0]), np.array([1.0, np.nan]))
    return Figure(
        "3.1", name, name, (Panel(name, Axis(name, name), Axis(name), (line,)),),
        (Check("C81", name, name, DIFFERENCE, name, name, reason=name),), (Table(name, (name, "a"), ((name, "1"),)),),
    )  # fmt: skip


def reproduction(name):
    checks = [Check(c, name, name, VERDICTS[i % 4], reason=name, unit=name) for i, c in enumerate(claims())]
    made = Made((figure(name),), tuple(checks), {"2.4": name})
    return render_reproduction(conclude(made), made.figures, made.missing, [name])


def slopes(name):
    result = DirectResult(name, "axle", "torque", 0.3, 10.0, 100.0, (), (), (name,))
    return report_page(slope_report(result, (name,)), title=name)


def named(value, name):
    """A document with a name in the place of every text that is a name or a sentence."""
    if isinstance(value, dict):
        return {k: named(v, name) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [named(v, name) for v in value]
    return name if isinstance(value, str) and (" " in value or ".mf4" in value or "<" in value) else value


def diagnosis(name):
    document = json.loads(json.dumps(document_of("named"), allow_nan=False))
    return report_page(diagnosis_report(named(document, name), views_of("named")[:1]), title=name)


def calibration(name):
    x = np.linspace(10.0, 30.0, 5)
    fit = DriveFit(
        name, 1500.0, 10.0, (5.0, -1.0, 11.0), 0.0, 0.1, 0.0, 0.0, 0.0, 100.0, 200.0, {name: 100.0}, 0.2, 0.1, x, x, x,
        x,
    )  # fmt: skip
    parameters = (
        Parameter(name, 1.0, (0.5, 1.5), name, True, remark=name),
        Parameter("mass", 1.0, (0.0, 2.0), "kg", False, name),
    )
    made = Calibration(name, parameters, (fit, fit), {}, (name,), (name,))
    return report_page(calibration_report(made, (name,)), title=name)


def evaluation(name):
    run = DetectorRun(false_alarms=(1.0,), cells={name: Cell(1, 1, 1, 10.0)})
    records = tuple(
        RunRecord(f"{name}{k}", {"manoeuvre": f"{name}{k}", "tyre": name}, 3600.0, 3600.0, 1e5, 0.0, {"spin_down": run},
                  ("tie_rod",), (name,), is_lossy=True) for k in range(2)
    )  # fmt: skip
    made = Evaluation(records, DEFAULT, None, failed={name: name})
    return report_page(evaluation_report(made, by=("tyre",)), title=name)


def campaign(name, folder):
    """Runs without results; a campaign file takes no such names, so they are put in behind it."""
    folder.mkdir()
    rows = "".join(f"log{k}.mf4,worn,lane,note{k},1.3\n" for k in range(3))
    (folder / "runs.csv").write_text(f"log,tyre,manoeuvre,x_note,water_depth_mm\n{rows}", encoding="utf-8")
    (folder / "car.toml").write_text("mass = 1500\n", encoding="utf-8")
    text = 'name = "case"\nvehicle = "car.toml"\nruns = "runs.csv"\n'
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    configured = configure(folder / "campaign.toml")
    runs = tuple(
        replace(r, logs=(folder / f"{name[:5000]}{k}",), values={**r.values, "tyre": name, "x_note": f"{name}{k}"})
        for k, r in enumerate(configured.campaign.runs)
    )
    named = replace(configured, campaign=replace(configured.campaign, name=name, runs=runs))
    found = load_results(configured, Store(folder / "store")).runs
    told = [replace(i, name=f"{name}{k}", run=r, reason=name) for k, (i, r) in enumerate(zip(found, runs, strict=True))]
    return CampaignData(named, Store(folder / "store"), told)


def campaign_pages(name, folder):
    data = campaign(name, folder)
    findings = find(data, plan(data, ()))
    return campaign_page(data, findings, [None] * len(data.runs), page_names([r.name for r in data.runs]))


def run_pages(name, folder):
    data = campaign(name, folder)
    return run_page(data, data.runs[0], None, None, back="../index.html")


PAGES = {
    "drive": lambda name, _: drive_page(drive(name), title=name),
    "eventful drive": lambda name, _: drive_page(eventful(name), title=name),
    "slip slope": lambda name, _: slopes(name),
    "figures": lambda name, _: render_figures([figure(name), figure(name)], title=name),
    "reproduction": lambda name, _: reproduction(name),
    "diagnosis": lambda name, _: diagnosis(name),
    "calibration": lambda name, _: calibration(name),
    "evaluation": lambda name, _: evaluation(name),
    "campaign": campaign_pages,
    "run": run_pages,
}

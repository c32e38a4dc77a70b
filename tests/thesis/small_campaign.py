"""A small simulated campaign with runs for all figures of many runs, made once for all tests of the thesis."""

from functools import lru_cache
from itertools import groupby
from pathlib import Path
from tempfile import mkdtemp

from aqualog.campaign.batch import run_batch
from aqualog.campaign.results import load_results
from aqualog.campaign.store import Store
from aqualog.config.configured import configure
from aqualog.model import campaign as simulated
from aqualog.model import programme
from aqualog.thesis.evidence.campaign import Evidence
from aqualog.thesis.run import make

PER_CONFIGURATION = 4


def configuration(run):
    s = run.scenario
    car = run.vehicle or s.vehicle
    return (
        s.vehicle.name, s.tyre_front.name, s.p_front, s.load_front, s.load_rear, run.water_depth,
        "2.7" in run.figures, car.name,
    )  # fmt: skip


def small():
    """Of each configuration a few runs, spread over its programme."""
    runs = sorted(programme.thesis(), key=lambda r: repr(configuration(r)))
    found = []
    for _, members in groupby(runs, key=configuration):
        of = list(members)
        step = max(1, len(of) // PER_CONFIGURATION)
        found += of[::step][:PER_CONFIGURATION]
    return tuple(found)


@lru_cache
def folder() -> Path:
    place = Path(mkdtemp(prefix="aqualog-figures-")) / "campaign"
    place.mkdir()
    (place / "logs").mkdir()
    runs = small()
    done = {r.name: simulated._one(r, str(place / "logs" / f"{r.name}.mf4"), "") for r in runs}
    simulated._write_campaign(place, "small", runs, done)
    return place


@lru_cache
def evidence() -> Evidence:
    configured = configure(folder() / "campaign.toml")
    store = Store(folder() / "campaign.store")
    run_batch(configured, store)
    return Evidence(load_results(configured, store))


@lru_cache
def made_of_campaign(number):
    return make(number, evidence())

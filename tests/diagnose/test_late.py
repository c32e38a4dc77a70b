"""Delays that the whole drive shows are named first; beside others nothing is certain."""

import pytest

from aqualog.checks.doubts import Doubt
from aqualog.diagnose import run
from aqualog.diagnose.drive import prepare
from aqualog.diagnose.faster import Late, found_late
from aqualog.diagnose.hypotheses import hypotheses
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term
from tests.checks.made import CAR, made, signals
from tests.checks.test_delays import TORQUES, WHEELS, delayed
from tests.diagnose.test_drive import CAR as CAR_OF_DRIVES
from tests.diagnose.test_drive import term
from tests.diagnose.test_run import ask, few, noisy, told  # noqa: F401 - `few` is a fixture
from tests.diagnose.test_verdict import cause, verdict

TORQUES_OF_WHEELS = tuple(f"torque_{w}" for w in ("fl", "fr", "rl", "rr"))


def late(*names, drop=(), seconds=0.5):
    return found_late([signals(delayed(made(seed=1), names, seconds), drop=drop)], CAR, Model())


def test_one_of_three_is_a_cause_of_its_own():
    found = late("a_x")
    (own,) = found.causes
    assert own.key == "signal_delay@a_x"
    delay = own.parameters["delay"]
    assert delay.low < 0.5 < delay.high
    named = verdict([([cause("drag")], 0.0), ([], -40.0)])
    both = found.beside(named)
    assert both.verdict == "compound"
    assert [c.key for c in both.causes] == ["drag", "signal_delay@a_x"]
    assert "signal_delay" in both.certain
    shifted = verdict([([cause("signal_delay", "a_x")], 0.0), ([], -40.0)])
    assert found.beside(shifted) == shifted


def test_a_delay_beyond_its_bounds_is_a_doubt():
    found = late("a_x", seconds=2.4)
    assert not found.causes
    assert found.doubts[0].value == pytest.approx(2.4, abs=0.1)


def test_what_the_model_has_is_no_finding():
    known = Model((Term(EFFECTS["signal_delay"], {"delay": 0.5}, "omega"),))
    drive = signals(delayed(made(seed=1), WHEELS, 0.5))
    assert not found_late([drive], CAR, known).causes
    assert found_late([drive], CAR, Model()).causes


def test_nothing_is_certain_beside_a_delay_of_one_of_two():
    found = late("a_x", drop=WHEELS + TORQUES)
    assert not found.causes
    named = verdict([([cause("drag")], 0.0), ([], -40.0)])
    doubted = found.beside(named)
    assert doubted.verdict == "cannot_tell"
    assert not doubted.certain
    assert doubted.causes[0].probability == 0.5 * named.causes[0].probability
    assert "which these causes do not explain" in doubted.notes[-1]
    shifted = verdict([([cause("signal_delay", "v_x")], 0.0), ([], -40.0)])
    assert found.beside(shifted) == shifted
    nothing = verdict([([], 0.0), ([cause("drag")], -40.0)])
    assert found.beside(nothing) == nothing


def test_of_several_drives_each_has_its_own_clocks():
    drives = [signals(delayed(made(seed=s), ("v_x",), 0.5)) for s in (0, 1)]
    found = found_late(drives, CAR, Model())
    assert not found.causes
    assert isinstance(found.doubts[0], Doubt)


@pytest.mark.parametrize("mass", [0.0, 250.0])
def test_a_drive_whose_delay_the_competition_does_not_find(monkeypatch, mass):
    ask(monkeypatch, ("payload_mass", "tyre_radius@fl"))
    load = (term("payload_mass", delta_mass=mass),) if mass else ()
    found = told(*load, term("signal_delay", "v_x", delay=0.6))
    own = {c.key: c.parameters for c in found.causes}
    assert set(own) == {"signal_delay@v_x"} | ({"payload_mass"} if mass else set())
    delay = own["signal_delay@v_x"]["delay"]
    assert delay.low < 0.6 < delay.high
    assert found.verdict == ("compound" if mass else "named")
    if mass:
        assert own["payload_mass"]["delta_mass"].low < mass < own["payload_mass"]["delta_mass"].high
    assert {t.effect.name for t in found.model.terms} == {k.partition("@")[0] for k in own}
    slip = next(c for c in found.gain.channels if c.channel == "slip_fl")
    assert slip.rmse_after < 0.2 * slip.rmse_before
    assert found.gain.log_score > 100.0


def test_a_delay_with_which_the_drive_is_predicted_worse_is_no_name(monkeypatch):
    """Noise that goes with itself has a lag as well; it is seen in curves and braking, where the model does not look."""
    lag = late("v_x").causes
    monkeypatch.setattr(run, "found_late", lambda *_, **__: Late(lag))
    d = told()
    assert (d.verdict, d.causes) == ("no_effect", ())
    assert d.notes[-1].startswith(f"Not named: {lag[0].sentence}")
    assert d.notes[-1].endswith("predicted worse with it.")


def test_a_delay_that_the_competition_finds_keeps_its_interval():
    found = told(term("signal_delay", "v_x", delay=0.3))
    (own,) = found.causes
    assert own.key == "signal_delay@v_x"
    assert own.parameters["delay"].high - own.parameters["delay"].low < 0.1


def test_a_late_velocity_that_noise_takes_is_asked_about(monkeypatch):
    """Beside tolerances for all other signals no straight line of a delay of 0.14 s gains, without torque."""
    every, _ = hypotheses([prepare(noisy(drop=TORQUES_OF_WHEELS), CAR_OF_DRIVES, "a")], Model())
    ask(monkeypatch, {h.key for h in every})
    d = told(log=noisy(term("signal_delay", "v_x", delay=0.14), drop=TORQUES_OF_WHEELS))
    assert [c.key for c in d.causes] == ["signal_delay@v_x"], d.sentence
    delay = d.causes[0].parameters["delay"]
    assert delay.low < 0.14 < delay.high
    assert d.verdict == "named"

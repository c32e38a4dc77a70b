"""One damage of each kind, and a bomb, in every format; `python -m tests.damaged` looks at many more."""

from dataclasses import replace

import pytest

from tests.damaged.damage import DAMAGES, bombs
from tests.damaged.judge import OUTCOMES, attempt, missing, outcome, samples_of, verdict
from tests.damaged.logs import FORMATS

NUMBERS = {"cut": 3, "flipped": 7, "zeroed": 1, "swapped": 1, "lying size": 1, "bytes missing": 0}
ONE_EACH = [d for d in DAMAGES if NUMBERS.get(d.fault, 0) == d.number]


@pytest.mark.parametrize("name", FORMATS)
def test_a_damaged_log_is_told_of_or_refused(tmp_path, name):
    source = FORMATS[name](tmp_path)
    sound, faults = samples_of(source)
    assert replace(faults, unfinalised=False, notes=()) == type(faults)()
    data = source.read_bytes()
    for damage in [*ONE_EACH, bombs(name)[1]]:
        path = tmp_path / damage.fault.replace(" ", "_") / source.name
        path.parent.mkdir()
        path.write_bytes(damage.make(data))
        seen = attempt(path)
        found = seen if isinstance(seen, str) else verdict(name, damage, sound, seen)
        assert outcome(found) in OUTCOMES[:6], (damage.fault, damage.number, seen)
        if found == "part, told" and seen.lost is not None and not name.startswith("CSV"):
            # of a text whose line ends are damaged nobody knows how many rows it had
            assert seen.lost >= missing(sound, seen) > 0, (damage.fault, damage.number, seen.words)


def test_every_kind_is_looked_at():
    assert len({d.fault for d in ONE_EACH}) == len(ONE_EACH) == len({d.fault for d in DAMAGES})

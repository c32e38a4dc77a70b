"""Gates are read with hints, and hold scores against limits."""

import math

import pytest

from aqualog.core.errors import ConfigError
from aqualog.detect.registry import RIVALS
from aqualog.evaluate.gates import MEASURES, judge_gates, parse_gates
from aqualog.evaluate.score import Rate, Recall, Score

FOUND = Recall(10, 9, 2, (0.1,) * 9)
NONE = Recall(0, 0, 0, ())
SCORE = Score("joint_cusum", 4, 1, NONE, FOUND, NONE, FOUND, NONE, Rate(3, 7200.0, 0.0), Rate(0, 60.0, 0.0))


def judged(*texts):
    return judge_gates(parse_gates(texts), {"joint_cusum": SCORE})


@pytest.mark.parametrize(
    ("text", "value", "is_kept"),
    [("joint_cusum.recall>=0.9", 0.9, True), ("joint_cusum.recall > 0.9", 0.9, False),
     ("joint_cusum.partial.recall>=0.95", 0.9, False), ("joint_cusum.false_alarms.per_hour<=1.5", 1.5, True),
     ("joint_cusum.false_alarms.count<3", 3.0, False), ("joint_cusum.latency_95_s<=2", math.inf, False),
     ("joint_cusum.latency_median_s<=2e-1", 0.1, True), ("joint_cusum.full.recall>=0", math.nan, False),
     ("joint_cusum.false_alarms.per_100km<1e9", math.nan, False), ("joint_cusum.drives>=4", 4.0, True),
     ("spin_up.recall>=0", math.nan, False)],
)  # fmt: skip
def test_a_gate_is_kept_or_not(text, value, is_kept):
    (result,) = judged(text)
    assert result.value == pytest.approx(value, nan_ok=True)
    assert result.is_kept is is_kept
    assert result.found


def test_every_measure_can_be_asked_for():
    assert len(judged(*(f"joint_cusum.{m}>=0" for m in MEASURES))) == len(MEASURES) > 40


@pytest.mark.parametrize(
    ("text", "says"),
    [("joint_cusom.recall>=0.9", 'did you mean "joint_cusum"'), ("joint_cusum.recal>=0.9", 'did you mean "recall"'),
     ("joint_cusum.false_alarms.perhour<=1", 'did you mean "false_alarms.per_hour"'),
     ("joint_cusum.zzz>=1", "known: recall, "), ("joint_cusum.recall>=nine", '"nine" is no number'),
     ("joint_cusum.recall>=nan", '"nan" is no number'), ("joint_cusum.recall", "is no gate"),
     ("recall>=0.9", "is no gate"), (f"{next(iter(RIVALS))}.recall>=0.9", "is a rival")],
)  # fmt: skip
def test_what_is_no_gate_is_told_with_the_nearest_name(text, says):
    with pytest.raises(ConfigError) as error:
        parse_gates([text])
    assert says in error.value.line()
    assert f"--gate {text}" in error.value.line()

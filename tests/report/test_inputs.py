"""Inputs that do not fit each other, of many logs in one line."""

from aqualog.core.records import Remark
from aqualog.report.inputs import of_runs

GAIN, SIGN = Remark("torque", ("torque_gain", "mass"), "gain", ""), Remark("sign", ("v_x",), "turned", "")


def test_logs_are_named_with_their_signals():
    assert of_runs({}) == of_runs({"a": ()}) == ""
    said = of_runs({"a": (), "b": (GAIN, SIGN), "c": (SIGN, SIGN)})
    assert said.startswith("Check the inputs of 2 of 3 logs first: b (torque_gain, mass, v_x), c (v_x). Alarms")
    assert of_runs(dict.fromkeys("abcde", (SIGN,))).split(":")[1].startswith(" a (v_x), b (v_x), c (v_x) and 2 more.")

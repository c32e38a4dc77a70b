"""Model files: what they mean, and what is said of those that are wrong."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aqualog.config.model import dump_model, load_model
from aqualog.core.errors import ConfigError
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term


def load(folder, text):
    (folder / "model.toml").write_text(text, encoding="utf-8")
    return load_model(folder / "model.toml")


def test_model_file(tmp_path):
    text = """
[[term]]
effect = "payload_mass"
delta_mass = 262

[[term]]
effect = "accelerometer_bias"
where = "a_y"
bias = -0.1

[[term]]
effect = "tyre_warmup"
"""
    assert load(tmp_path, text) == Model(
        (
            Term(EFFECTS["payload_mass"], {"delta_mass": 262.0}),
            Term(EFFECTS["accelerometer_bias"], {"bias": -0.1}, "a_y"),
            Term(EFFECTS["tyre_warmup"]),
        )
    )
    assert load(tmp_path, "# nothing\n") == Model()
    assert load(tmp_path, "# nothing\n").car == ""


@pytest.mark.parametrize("name", ["", "BMW i3", '"a" \\ Ö 車 😀'])
def test_the_car_of_a_model_is_read_back(tmp_path, name):
    term = Term(EFFECTS["payload_mass"], {"delta_mass": 262.0})
    model = load(tmp_path, dump_model(Model(car=name).with_term(term)))
    assert (model.car, model.terms) == (name, (term,))


def test_faults_of_a_model_come_together(tmp_path):
    text = """[[term]]
effect = "paylod_mass"
[[term]]
effect = "payload_mass"
delta_mas = 3.0
delta_mass = 1e9
where = "fl"
[[term]]
delta_mass = 3.0
[[term]]
effect = "head_wind"
where = "f"
speed = "much"
[[term]]
effect = "road_grade"
grade = 0.1
[[term]]
effect = "road_grade"
grade = 0.01
[[tern]]
effect = "road_grade"
"""
    with pytest.raises(ConfigError) as error:
        load(tmp_path, text)
    line = str(error.value)
    assert "\n" not in line
    for part in (
        "line 2: unknown effect 'paylod_mass' (did you mean \"payload_mass\"?)", 'line 5: unknown key "delta_mas"',
        "line 6: delta_mass = 1e+09 is outside", "line 7: payload_mass cannot sit at 'fl'; expected f, r", "line 8: term names no effect",
        "line 12: head_wind cannot sit at 'f'", "line 13: speed = 'much' is not a number",
        "line 18: road_grade is in the model already", 'unknown key "tern" (did you mean "term"?)',
    ):  # fmt: skip
        assert part in line


@st.composite
def models(draw):
    model = Model()
    for name in draw(st.lists(st.sampled_from(sorted(EFFECTS)), max_size=4, unique=True)):
        effect = EFFECTS[name]
        chosen = [p for p in effect.parameters if draw(st.booleans())]
        values = {p.name: draw(st.floats(p.low, p.high)) for p in chosen}
        model = model.with_term(Term(effect, values, draw(st.sampled_from([None, *effect.places]))))
    return model


@settings(max_examples=60)
@given(model=models())
def test_written_models_read_back(tmp_path_factory, model):
    assert load(tmp_path_factory.mktemp("model"), dump_model(model)) == model

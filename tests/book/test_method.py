"""Method pages: a page per detector and estimator, with the numbers that the code has and pictures that exist."""

import re

import pytest

from aqualog.align import freezes, glitches
from aqualog.calibrate import design, online
from aqualog.campaign import full_speed, results
from aqualog.detect import braking, joint_criteria, minor_spin_down, other_surface, resistance, spin, tie_rod
from aqualog.detect.detector import JointCusumParams
from aqualog.detect.registry import DETECTORS, RIVALS
from aqualog.detect.slip_slope import activation, direct, drop, history, watch
from aqualog.detect.slip_slope.tuning import TUNING
from aqualog.detect.thresholds import DEFAULT
from aqualog.diagnose.run import Options
from aqualog.model.tyre import TYRE_KEYS, TYRES
from aqualog.physics.resistance import nominal_acceleration
from tests.conftest import ROOT

DOCS = ROOT / "aqualog" / "docs"
ESTIMATORS = (
    "slip_slope", "slip_slope_filter", "calibration", "campaign_regression", "full_aquaplaning", "reading", "alignment",
    "simulation", "diagnosis", "evaluation",
)  # fmt: skip
PAGES = (*DETECTORS, *ESTIMATORS)
DT = 0.01


def page(name):
    return (DOCS / "method" / f"{name}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", PAGES)
def test_each_page_has_its_parts(name):
    text = page(name)
    for heading in ("## Idea", "## What it needs", "## Sources"):
        assert f"\n{heading}\n" in text, heading
    assert re.search(r"^## (When it fails|How far it can be believed)$", text, re.M)
    assert re.search(r"^!\[.+\]\(\.\./pictures/\w+\.png\)$", text, re.M)
    assert f"tests.book.pictures {name}" in text or "tests.book.pictures" in text


@pytest.mark.parametrize("name", [d for d in DETECTORS if d != "margin"])  # its page has a study of distances
def test_each_detector_has_its_scores(name):
    scores = (DOCS / "validation" / "scores.md").read_text(encoding="utf-8")
    row = next(line for line in scores.splitlines() if line.startswith(f"| [`{name}`]"))
    full = re.match(r"\| [^|]+ \| (\d+)", row).group(1)
    total = re.search(r"\d+ of (\d+) \(", scores).group(1)
    assert re.search(rf"\| {full} of {total} ", page(name)), row
    assert f"({name}.md)" in page("detectors")


def test_pictures_are_small_and_shown():
    shown = " ".join(p.read_text(encoding="utf-8") for p in [*DOCS.rglob("*.md"), ROOT / "README.md"])
    for path in sorted((DOCS / "pictures").glob("*.png")):
        assert path.name in shown, path.name
        assert path.stat().st_size < 250_000, path.name


def rows():
    s = spin.SpinParams.make(-1.0, DT)
    m = minor_spin_down.MinorParams.make(DT)
    alarm = resistance.alarm_params(DT)
    o = online.OnlineParams.make(DT)
    t = tie_rod.params(DT)
    d = drop.DropParams.make(DT, "robust")
    a = activation.LIMITS
    w = other_surface.OtherParams.make(DT)
    j = JointCusumParams()
    yield "spin_down", f"| threshold `spin_down` | {DEFAULT.spin_down:g} m/s |"
    yield "spin_down", f"| drift | {s.cusum.nu:g} m/s² |"
    yield "spin_down", f"| clamp of the sum | {s.cusum.g_max:.1f} m/s,"
    yield "spin_down", f"| speed difference | {s.v_abs:g} m/s and {100 * s.v_rel:g} % of the speed |"
    yield "spin_down", f"| deep slip | a quarter of the speed for {s.t_deep:g} s |"
    yield "spin_down", f"| least speed | {s.v_min:g} m/s |"
    yield "spin_up", f"| threshold `spin_up` | {DEFAULT.spin_up:g} m/s |"
    yield "spin_up", f"| traction limit | {spin.MU_SPIN_UP:g} | an event may begin only below it"
    yield "spin_up", f"(thesis 2.1), for {spin.HELD_S:g} s |"
    yield "spin_up", f"| drift | {spin.SIDEWAYS:g} m/s² |"
    yield "spin_up", f"traction below {spin.MU_FULL:g} for most of the event, and for {spin.LOST_S:g} s |"
    yield "minor_spin_down", f"| threshold `minor_spin_down` | {DEFAULT.minor_spin_down:.1f} (m/s²)² |"
    yield "minor_spin_down", f"| variance of the wheel itself | {m.var_min / m.delta_min:g} times"
    yield "minor_spin_down", f"| own share | {m.share:g} |"
    yield "minor_spin_down", f"| one-sidedness | {m.one_sided:g} to 1 |"
    yield "minor_spin_down", f"noise of {m.v_noise:g} m/s"
    yield "minor_spin_down", f"| least speed | {m.v_min:g} m/s |"
    yield "minor_spin_down", f"| lateral acceleration | below {minor_spin_down.A_Y_MINOR:g} m/s² |"
    yield "minor_spin_down", f"| after braking | {m.warm_up:g} s |"
    yield "minor_spin_down", f"| after the start | {m.warm_up + minor_spin_down.RADIUS_KNOWN:g} s |"
    yield "minor_spin_down", f"| calm | {m.quiet:g} s |"
    yield "resistance", f"| threshold `resistance` | {DEFAULT.resistance:g} m/s |"
    yield "resistance", f"| drift | {alarm.nu:g} m/s² |"
    yield "resistance", f"| clamp of the sum | {alarm.g_max:g} m/s,"
    yield "resistance", f"| clip of the measure | ±{resistance.CLIP:g} m/s² |"
    yield "resistance", f"| least speed | {resistance.V_MIN:g} m/s"
    yield "resistance", f"| lateral acceleration | below {resistance.A_Y_MAX:g} m/s² |"
    yield "resistance", f"| time constant once the offset is known | {o.tau:g} s;"
    yield "resistance", f"faster than {resistance.V_OFFSET:g} m/s, below {resistance.A_OFFSET:g} m/s² along"
    yield "resistance", f"more than {o.guard:g} m/s² above what is known"
    yield "resistance", f"after {o.below:g} s below the guard, or {o.rest:g} s of standstill"
    yield "resistance", f"| bound | {o.bound:g} m/s² |"
    yield "slip_slope_drop", f"| threshold `slip_slope_drop` | {DEFAULT.slip_slope_drop:g} |"
    yield "slip_slope_drop", f"loss below {1.0 - d.recovered:g} |"
    yield "slip_slope_drop", f"| relative standard deviation | below {100 * d.sd_max:g} % |"
    yield "slip_slope_drop", f"variance below {watch.VARIANCE_MAX:g} (m/s²)², memory {watch.TAU_VARIANCE:g} s"
    yield "slip_slope_drop", f"| settling | {d.settle * DT:g} s"
    yield "slip_slope_drop", f"| hold | {d.hold * DT:g} s |"
    yield "slip_slope_drop", f"| history | {history.KEPT_PERIODS} periods of {d.period:g} s |"
    yield "tie_rod", f"| threshold `tie_rod` | {DEFAULT.tie_rod:g} s |"
    yield "tie_rod", f"| drift | {t.nu:g} scatters |"
    yield "tie_rod", f"| scatter σ | {tie_rod.SIGMA['tie_rod']:g} N, {tie_rod.SIGMA['steering_torque']:g} N·m |"
    yield "tie_rod", f"| share of the modelled force | {100 * tie_rod.SHARE:g} % |"
    yield "tie_rod", f"| clip | {tie_rod.CLIP:g} scatters |"
    yield "tie_rod", f"| least speed | {tie_rod.V_MIN:g} m/s"
    yield "tie_rod", f"| lateral acceleration | below {tie_rod.A_Y_MAX:g} m/s² |"
    yield "joint_criteria", f"| threshold `joint_criteria` | {DEFAULT.joint_criteria:g} m/s |"
    yield "joint_criteria", f"| gate held | {joint_criteria.GATE_HOLD:g} s |"
    yield "joint_criteria", f"| warning held | {joint_criteria.HOLD:g} s |"
    yield "joint_criteria", f"faster than 61 km/h ({w.v_min:g} m/s)"
    yield "joint_criteria", f"exceeds {w.resistance:g} m/s² ({w.still:g} m/s² while"
    yield "joint_criteria", f"found lost for {w.proof:g} s below 50 km/h since the last {w.forget:g} s"
    yield "joint_cusum", f"| threshold `joint_cusum` | {DEFAULT.joint_cusum:g} |"
    yield "joint_cusum", f"| `g_up`, `g_down` | {j.g_up:g} m/s |"
    yield "joint_cusum", f"| `g_resistance` | {j.g_resistance:g} m/s |"
    yield "joint_cusum", f"| `var_low`, `var_high` | {j.var_low:g}, {j.var_high:.1f} (m/s²)² |"
    yield "joint_cusum", f"| `g_variance` | {j.g_variance:.1f} (m/s²)²·s |"
    yield "joint_cusum", f"| `loss_low`, `loss_high` | {j.loss_low:g}, {j.loss_high:g} |"
    yield "joint_cusum", f"| `third` | `{j.third}` |"
    yield "slip_slope", f"| `--mu-max` | {direct.MU_MAX:g} |"
    yield "slip_slope", f"smoothed alike over {direct.SMOOTHING:g} s"
    yield "slip_slope_filter", f"| `r` | {TUNING.r:g} s |".replace("e-0", "e-")
    yield "slip_slope_filter", f"| `zeta`, `h` | {TUNING.zeta:g}, {TUNING.h:g} s |"
    yield "slip_slope_filter", f"| `tau_settle`, `rest` | {TUNING.tau_settle:g} s, {TUNING.rest:g} |"
    yield "slip_slope_filter", f"| `sd_k_reset` | {TUNING.sd_k_reset:g} |"
    yield "slip_slope_filter", f"`sd_beta`, `sd_delta` | {TUNING.sd_k:g}, {TUNING.sd_beta:g}, {TUNING.sd_delta:g} |"
    yield "slip_slope_filter", f"| {TUNING.mu_min:g}, {TUNING.mu_max:g}, {TUNING.s_min:g}, {TUNING.s_max:g} |"
    yield "slip_slope_filter", f"| {TUNING.tau_window:g} s, {TUNING.told_k:g}, {TUNING.told_beta:g} |"
    yield "slip_slope_filter", f"| acceleration along, across | below {a.a_x_max:g}, {a.a_y_max:g} m/s² |"
    yield "slip_slope_filter", f"| yaw rate | below {a.yaw_rate_max:g} rad/s |"
    yield "slip_slope_filter", f"| wheel acceleration difference | below {a.a_w_delta_max:g} m/s² |"
    yield "slip_slope_filter", f"below {a.mu_rate_max:g} per second, and {watch.AFTER_JUMP:g} s after"
    yield "slip_slope_filter", f"| low-pass on slip and traction alike | {watch.TAU_SMOOTH:g} s |"
    yield "calibration", f"| window, block | {design.WINDOW_S:g} s, {design.BLOCK_S:g} s |"
    yield "calibration", f"above {design.V_MIN:g} m/s, below {design.A_Y_MAX:g} m/s² lateral"
    yield "calibration", f"m/s² lateral and {design.YAW_MAX:g} rad/s"
    yield "campaign_regression", f"| settling | {results.SETTLING_S:g} s |"
    yield "full_aquaplaning", f"| draws | {full_speed.DRAWS} |"
    yield "full_aquaplaning", f"| extrapolation | noted beyond {full_speed.EXTRAPOLATED:g} times"
    yield "reading", f"faster than {glitches.RIM_LIMIT:g} m/s² at the rim"
    yield "reading", f"repeats itself for {freezes._SPEED[0]:g} s |"
    yield "reading", f"repeats itself for {freezes._TORQUE[0]:g} s in which"
    yield "diagnosis", f"| `--level` | {Options().level:g} |"
    yield "diagnosis", f"| `--surrogates` | {Options().surrogates} |"
    yield "detectors", f"| brake pressure | above {braking.BRAKE_PRESSURE / 1e5:g} bar |"
    yield "detectors", f"| {braking.LIGHT / 1e5:g} bar above the released brake |"
    yield "detectors", f"| held after release | {braking.HOLD:g} s |"
    for k in TYRE_KEYS.values():
        yield "simulation", f"| `{k.name}` | {k.unit} | {k.default:g} |"
    for y in TYRES.values():
        yield (
            "simulation",
            f"| `{y.name}` | {1e3 * y.tread_depth:.1f} mm | {y.void_ratio:.2f} | {y.slip_slope_factor:.2f} | {y.mu_factor:.2f} |",
        )
    for name in RIVALS:
        yield "../validation/rivals", f"| `{name}` |"


@pytest.mark.parametrize(("name", "row"), list(rows()), ids=str)
def test_numbers_are_those_of_the_code(name, row):
    assert row in page(name)


def test_equation_of_the_resistance_names_its_departure():
    assert "(E5)" in page("resistance")
    assert "E5" in nominal_acceleration.__doc__

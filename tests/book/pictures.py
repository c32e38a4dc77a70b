"""Make the book's pictures again: `python -m tests.book.pictures [NAME ...] [--campaign CAMPAIGN.toml]`.

All are drawn by aqualog: figures of the thesis, and detectors' own statistics on the sample drive. Those of
`OF_CAMPAIGN` need the thesis' test programme, which is simulated if it is not given (some minutes). Needs the extras
`images` and `dev`, Chromium or Chrome, and Pillow for the smaller palette.
"""

import argparse
import io
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from aqualog.align.clock import estimate_clock
from aqualog.align.load import load_signals
from aqualog.config.scenario import load_scenario
from aqualog.config.vehicle import load_vehicle
from aqualog.core.notation import WHEELS
from aqualog.detect.stream import detect_drive
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from aqualog.physics import hydroplaning
from aqualog.report.theme import EVENT_SHADE, GRID, THRESHOLD, WATER, WHEEL_COLOURS

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "aqualog" / "docs" / "pictures"
SAMPLES = ROOT / "sample_logs"
WIDTH = 1000
COLOURS = 80
INK, MUTED = "#1f2933", "#8a94a0"
KMH = 3.6
WATER_LANE = (8.0, 16.0)  # of the sample drive [s]


def sample():
    """The sample drive with its features and tracks, and its vehicle."""
    car = load_vehicle(SAMPLES / "vehicle.toml")
    signals = load_signals([SAMPLES / "lane_drive.mf4"], vehicle=car)
    return (signals.array("on_water"), detect_drive(signals, car), np.arange(signals.frame.height) * signals.dt)


def panels(titles, *, height=210, log=()):
    fig = make_subplots(rows=len(titles), cols=1, shared_xaxes=True, vertical_spacing=0.07)
    fig.update_layout(
        width=WIDTH, height=height * len(titles) + 95, plot_bgcolor="white", paper_bgcolor="white",
        font={"size": 15, "color": INK, "family": "DejaVu Sans, Arial, sans-serif"},
        margin={"l": 80, "r": 20, "t": 20, "b": 75}, legend={"orientation": "h", "y": -70 / (height * len(titles)), "x": 0.0},
    )  # fmt: skip
    axes = {"gridcolor": GRID, "linecolor": MUTED, "ticks": "outside", "zeroline": False}
    fig.update_xaxes(**axes)
    fig.update_yaxes(**axes)
    for row, title in enumerate(titles, 1):
        fig.update_yaxes(title_text=title, row=row, col=1, type="log" if row in log else "linear")
    fig.update_xaxes(title_text="time [s]", row=len(titles), col=1)
    return fig


def line(fig, row, x, y, name, colour, *, dash="solid", width=1.8, **kw):
    fig.add_trace(go.Scatter(x=x, y=y, name=name, mode="lines", line={"color": colour, "dash": dash, "width": width}, **kw), row=row, col=1)  # fmt: skip


def level(fig, row, value, text, *, position="top right"):
    fig.add_hline(value, line={"color": THRESHOLD, "dash": "dash", "width": 1.4}, row=row, col=1, annotation_text=text,
                  annotation_position=position, annotation_font={"color": THRESHOLD, "size": 13})  # fmt: skip
    if fig.layout[f"yaxis{row}" if row > 1 else "yaxis"].type == "log":
        fig.layout.annotations[-1].y = np.log10(value)  # annotations count in decades there, lines do not


def shade(fig, t, bits, *, rows=None, colour=EVENT_SHADE):
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(bits, dtype=np.int8), [0]])))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        for row in rows or [None]:
            place = {} if row is None else {"row": row, "col": 1}
            fig.add_vrect(t[begin], t[min(end, t.size - 1)], fillcolor=colour, line_width=0, **place)


def lane(fig):
    for x, text in zip(WATER_LANE, ("front axle enters", "front axle leaves"), strict=True):
        fig.add_vline(x, line={"color": WATER, "dash": "dot", "width": 1.6}, annotation_text=text if text else "",
                      annotation_position="top right", annotation_font={"color": WATER, "size": 13}, row=1, col=1)  # fmt: skip


def track(result, detector, wheel=None):
    return next(x for x in result.tracks if x.detector == detector and x.wheel == wheel)


def spin_down():
    _, result, t = sample()
    f, found = result.features, track(result, "spin_down", "fr")
    fig = panels(["speed [m/s]", "a_wΔ [m/s²]", "sum [m/s]"])
    line(fig, 1, t, f["v_w_fr"], "front right wheel", WHEEL_COLOURS["fr"])
    line(fig, 1, t, f["v_x_hat"], "car", INK, dash="dash")
    line(fig, 2, t, f["a_w_delta_fr"], "wheel less car", WHEEL_COLOURS["fr"], showlegend=False)
    line(fig, 3, t, found.statistic, "sum beyond 3 m/s²", WHEEL_COLOURS["fr"], showlegend=False)
    level(fig, 3, found.threshold, "threshold 0.6 m/s")
    shade(fig, t, found.active)
    return fig.update_xaxes(range=(8.0, 16.5))


def minor_spin_down():
    _, result, t = sample()
    f, found = result.features, track(result, "minor_spin_down", "fr")
    fig = panels(["speed [m/s]", "variance [(m/s²)²]"], height=260, log=(2,))
    line(fig, 1, t, f["v_w_fr"], "front right wheel", WHEEL_COLOURS["fr"])
    line(fig, 1, t, f["v_w_rr"], "rear right wheel", WHEEL_COLOURS["rr"])
    line(fig, 1, t, f["v_x_hat"], "car", INK, dash="dash")
    line(fig, 2, t, np.maximum(f["variance_fr"], 1e-3), "front", WHEEL_COLOURS["fr"], showlegend=False)
    line(fig, 2, t, np.maximum(f["variance_rr"], 1e-3), "rear", WHEEL_COLOURS["rr"], showlegend=False)
    line(fig, 2, t, np.maximum(found.statistic, 1e-3), "front less rear", INK, dash="dot")
    level(fig, 2, found.threshold, "threshold of the difference 1.0")
    shade(fig, t, found.active)
    fig.update_yaxes(range=(-3, 3), row=2, col=1)
    return fig.update_xaxes(range=(6.0, 18.0))


def resistance():
    _, result, t = sample()
    f, found = result.features, track(result, "resistance")
    fig = panels(["measure [m/s²]", "sum [m/s]"], height=240)
    line(fig, 1, t, f["delta_a_x"], "resistance measure", "#E69F00", width=1.0)
    line(fig, 1, t, f["delta_a_x_offset"], "offset learnt on dry road", MUTED, width=2.4)
    line(fig, 2, t, found.statistic, "sum beyond 0.1 m/s²", "#E69F00", showlegend=False)
    level(fig, 2, found.threshold, "threshold 0.2 m/s")
    lane(fig)
    shade(fig, t, found.active)
    return fig.update_yaxes(range=(-0.5, 1.5), row=1, col=1)


def slip_slope_drop():
    _, result, t = sample()
    f, found = result.features, track(result, "slip_slope_drop", "rl")
    fig = panels(["slip slope [-]", "lost share [-]"], height=240)
    line(fig, 1, t, f["slip_slope_left"], "rear left wheel", WHEEL_COLOURS["rl"])
    line(fig, 1, t, f["slip_slope_right"], "rear right wheel", WHEEL_COLOURS["rr"])
    line(fig, 1, t, f["slip_slope_ref_left"], "dry slope", INK, dash="dash")
    for w in ("rl", "rr"):
        line(fig, 2, t, track(result, "slip_slope_drop", w).statistic, w, WHEEL_COLOURS[w], showlegend=False)
    level(fig, 2, found.threshold, "threshold 0.5")
    lane(fig)
    shade(fig, t, np.any([track(result, "slip_slope_drop", w).active for w in ("rl", "rr")], axis=0))
    fig.update_yaxes(range=(0, 37), row=1, col=1)
    return fig


def joint_criteria():
    on_water, result, t = sample()
    f = result.features
    rows = [("watered lane", on_water > 0.5, WATER)]
    names = ("spin-down", "minor spin-down", "spin-up", "slip-slope drop", "resistance")
    rows += [(f"{k} {n}", f[f"criterion_{k}"].to_numpy() > 0.5, "#E69F00") for k, n in enumerate(names, 1)]
    rows += [("gate", f["joint_gate"].to_numpy() > 0.5, MUTED), ("joint_criteria", track(result, "joint_criteria").active, THRESHOLD)]  # fmt: skip
    return _lanes(t, rows)


def evaluation():
    """Episodes of the simulated truth above what the detectors report."""
    scenario = load_scenario(SAMPLES / "scenario.toml")
    made = as_signals(simulate(scenario), vehicle=scenario.vehicle)
    on_water, result, t = sample()
    contact = np.min([made.array(f"true_contact_{w}") for w in WHEELS], axis=0)
    at = np.interp(t, np.arange(contact.size) * made.dt, contact)
    rows = [("truth: water", on_water > 0.5, WATER), ("truth: contact < 0.7", at < 0.7, WATER)]
    for name in ("spin_down", "minor_spin_down", "spin_up", "resistance", "slip_slope_drop", "joint_criteria", "joint_cusum"):  # fmt: skip
        bits = np.any([x.active for x in result.tracks if x.detector == name], axis=0)
        rows.append((name, bits, THRESHOLD if name.startswith("joint") else "#E69F00"))
    return _lanes(t, rows)


def _lanes(t, rows):
    fig = panels([""], height=34 * len(rows))
    for i, (_, bits, colour) in enumerate(reversed(rows)):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(bits, dtype=np.int8), [0]])))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            fig.add_shape(type="rect", x0=t[begin], x1=t[min(end, t.size - 1)], y0=i - 0.3, y1=i + 0.3, line_width=0, fillcolor=colour)  # fmt: skip
    names = [name for name, _, _ in reversed(rows)]
    fig.update_yaxes(tickvals=list(range(len(rows))), ticktext=names, range=(-0.6, len(rows) - 0.4), showgrid=False)
    fig.update_layout(margin={"l": 190, "r": 20, "t": 15, "b": 55}, showlegend=False)
    fig.add_trace(go.Scatter(x=[t[0]], y=[0], mode="markers", marker={"opacity": 0}))
    return fig.update_xaxes(range=(6.0, 20.0))


def joint_cusum():
    _, result, t = sample()
    f, found = result.features, track(result, "joint_cusum")
    fig = panels(["scaled sum [-]"], height=340)
    colours = {"spin_down": WHEEL_COLOURS["fr"], "minor_spin_down": WHEEL_COLOURS["fl"], "spin_up": WHEEL_COLOURS["rr"],
               "resistance": "#E69F00", "slip_slope_drop": WHEEL_COLOURS["rl"]}  # fmt: skip
    for name, colour in colours.items():
        fig.add_trace(go.Scatter(x=t, y=f[f"joint_term_{name}"], name=name.replace("_", " "), stackgroup="terms", mode="lines", line={"width": 0}, fillcolor=colour))  # fmt: skip
    line(fig, 1, t, found.statistic, "sum", INK, width=1.2)
    level(fig, 1, found.threshold, "threshold 1.15")
    return fig.update_xaxes(range=(6.0, 20.0))


def margin():
    _, result, t = sample()
    f = result.features
    fig = panels(["distance [km/h]", "warning [-]"], height=420)
    for name, colour in (("_low", MUTED), ("_q25", WATER), ("", INK), ("_q75", WATER), ("_high", MUTED)):
        line(fig, 1, t, 3.6 * f[f"aquaplaning_margin{name}"].to_numpy(), name.strip("_") or "median", colour, width=1.2)
    line(fig, 2, t, track(result, "margin").statistic, "below 30 km/h", INK, width=1.2)
    level(fig, 2, 0.25, "threshold 0.25")
    return fig.update_xaxes(range=(6.0, 20.0))


def reading():
    """The sample drive with faults put in, and what reading makes of it."""
    import polars as pl

    car = load_vehicle(SAMPLES / "vehicle.toml")
    whole = pl.read_parquet(SAMPLES / "lane_drive.parquet")
    t = whole["t"].cast(pl.Float64).to_numpy() if whole["t"].dtype.is_numeric() else np.arange(whole.height) * 0.01
    t = t - t[0]
    bad = {c: whole[c].to_numpy().copy() for c in whole.columns if c != "t"}
    frozen, spike, dropout = (t > 10.0) & (t < 14.5), np.abs(t - 4.0) < 0.03, (t > 18.0) & (t < 18.4)
    bad["omega_rl"][frozen] = bad["omega_rl"][np.flatnonzero(frozen)[0]]
    bad["yaw_rate"][spike] = 2.5
    bad["omega_fl"][dropout] = 0.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "faults.parquet"
        pl.DataFrame({"t": whole["t"], **bad}).write_parquet(path)
        read = load_signals([path], vehicle=car)
    at = np.arange(read.frame.height) * read.dt
    fig = panels(["omega_fl [rad/s]", "omega_rl [rad/s]", "yaw_rate [rad/s]"], height=180)
    for row, name in enumerate(("omega_fl", "omega_rl", "yaw_rate"), 1):
        line(fig, row, t, bad[name], "in the log", THRESHOLD, dash="dot", width=2.2, showlegend=row == 1)
        line(fig, row, at, read.array(name), "as read: gaps where samples were left out", INK, showlegend=row == 1)
    fig.update_yaxes(range=(84, 96), row=2, col=1)
    return fig


def alignment():
    """Two records of one speed, the second 0.35 s late on a clock of its own."""
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 240.0, 0.02)
    v = (
        22.0
        + 4.0 * np.sin(2 * np.pi * t / 37.0)
        + 1.5 * np.sin(2 * np.pi * t / 9.3 + 1.0)
        + 0.8 * np.sin(2 * np.pi * t / 4.1)
    )
    late = np.arange(0.0, 239.0, 0.1)
    gnss = np.interp(late, t, v) * 1.004 + rng.normal(0.0, 0.03, late.size)
    wheel = v + rng.normal(0.0, 0.02, t.size)
    fit = estimate_clock((t * 1e9).astype(np.int64), wheel, ((late + 0.35) * 1e9).astype(np.int64), gnss, max_offset_s=5.0, quantity="v_x")  # fmt: skip
    low, high = fit.offset_ci95
    fig = panels(["speed as stamped [m/s]", "aligned [m/s]"], height=220)
    for row, shift in ((1, 0.0), (2, fit.offset_s)):
        line(fig, row, t, wheel, "wheels", WHEEL_COLOURS["fl"], showlegend=row == 1)
        line(fig, row, late + 0.35 - shift, gnss / fit.scale, "GNSS", WHEEL_COLOURS["fr"], showlegend=row == 1)
    fig.add_annotation(text=f"offset {fit.offset_s:.3f} s (95 %: {low:.3f} to {high:.3f} s), made with 0.350 s", xref="paper", yref="paper", x=0.5, y=0.45, showarrow=False, font={"size": 15}, bgcolor="white")  # fmt: skip
    return fig.update_xaxes(range=(100.0, 112.0))


def water_law():
    """Speed of full aquaplaning over depth: the simulator's and published formulas."""
    from aqualog.model.tyre import TYRES

    h = np.linspace(0.3e-3, 4.0e-3, 150)
    fig = panels(["full aquaplaning [km/h]"], height=400)
    for name, colour in (("worn_summer", WHEEL_COLOURS["fr"]), ("new_summer", WHEEL_COLOURS["fl"])):
        v = TYRES[name].full_speed(h, np.full_like(h, 4000.0), p=1.9e5)
        line(fig, 1, 1e3 * h, np.where(v < 100.0, v * KMH, np.nan), f"aqualog, {name}", colour, width=2.6)
    line(fig, 1, 1e3 * h, hydroplaning.gallaway_speed(h, 1.9e5, tread_depth=1.6e-3, texture_depth=0.78e-3) * KMH, "Gallaway, 1.6 mm", MUTED, dash="dash")  # fmt: skip
    thin = h < 2.4e-3
    line(fig, 1, 1e3 * h[thin], hydroplaning.pavdrn_speed(h[thin]) * KMH, "PAVDRN, 1.65 bar", MUTED, dash="dot")
    line(fig, 1, 1e3 * h, hydroplaning.usf_speed(h, 1.9e5, 4000.0) * KMH, "USF", MUTED, dash="dashdot")
    line(
        fig,
        1,
        1e3 * h,
        np.full_like(h, float(hydroplaning.horne_speed(np.array(1.9e5)))) * KMH,
        "Horne (flooded)",
        MUTED,
    )
    return fig.update_xaxes(title_text="water depth [mm]")


def calibration():
    """Mass over torque gain from dry simulated drives, one, two, ... six of them together."""
    sys.path.insert(0, str(ROOT / "tests"))
    from aqualog.calibrate.run import calibrate
    from tests.calibrate import dry_drives  # type: ignore[import-not-found,unused-ignore]

    count = 6
    drives, true, gain = dry_drives.campaign(2001, count)
    believed = dry_drives.believed(true)
    rows = []
    for n in range(1, count + 1):
        found = calibrate(drives[:n], [f"drive {i + 1}" for i in range(n)], believed)
        p = next(x for x in found.parameters if x.name == "mass_per_gain")
        rows.append((n, p.value, *p.ci95))
    n, value, low, high = map(np.array, zip(*rows, strict=True))
    fig = panels(["mass over torque gain [kg]"], height=320)
    fig.add_trace(go.Scatter(x=n, y=value, mode="markers", name="estimate with its 95 % interval", marker={"color": WHEEL_COLOURS["fl"], "size": 10},
                  error_y={"type": "data", "symmetric": False, "array": high - value, "arrayminus": value - low, "thickness": 2, "width": 6}))  # fmt: skip
    fig.add_hline(
        true.mass * gain, line={"color": INK, "dash": "dash"}, annotation_text="true", annotation_position="top left"
    )
    return fig.update_xaxes(title_text="dry drives used", dtick=1)


def diagnosis():
    """The force balance of the loaded drive before and after the load is in the model."""
    from aqualog.diagnose.run import Options, diagnose

    car = load_vehicle(SAMPLES / "vehicle.toml")
    drive = load_signals([SAMPLES / "loaded_monday.parquet"], vehicle=car)
    found = diagnose([("loaded_monday", drive)], car, options=Options(surrogates=0, views=True))
    view = next(v for v in found.views if v.channel == "force_balance")
    fig = panels(["force balance: residual [m/s²]"], height=320)
    line(fig, 1, view.coordinates["t"], view.before, "with the vehicle file", MUTED, width=1.2)
    line(
        fig,
        1,
        view.coordinates["t"],
        view.after,
        f"with the cause found: {found.sentence}",
        WHEEL_COLOURS["fr"],
        width=1.2,
    )
    return fig


def full_aquaplaning(campaign):
    """The three speeds of one campaign, side by side."""
    document = json.loads(
        aqualog("bin-slipslope", str(campaign), "--by", "tyre,pressure,water-depth", "--json", capture=True)
    )
    rows = [
        r for r in document["full_aquaplaning"] if r["v_full_kmh"] is not None and r["vehicle"].endswith("sedan_rwd")
    ]
    ways = {"slip_slope": "an even contact ends (slip slopes)", "minor_spin_down": "first loss + 20 km/h", "spin_down": "half of the passes stop a wheel"}  # fmt: skip
    groups = sorted({_label(r) for r in rows if r["way"] == "spin_down"}, reverse=True)
    fig = panels([""], height=max(60 * len(groups), 240))
    for k, (way, colour) in enumerate(zip(ways, (WHEEL_COLOURS["fl"], "#E69F00", WHEEL_COLOURS["fr"]), strict=True)):
        some = [r for r in rows if r["way"] == way and _label(r) in groups]
        v = np.array([r["v_full_kmh"] for r in some])
        ends = np.array([[np.nan if x is None else x for x in r["v_full_ci95_kmh"] or (None, None)] for r in some]).reshape(-1, 2)  # fmt: skip
        fig.add_trace(go.Scatter(
            x=v, y=[groups.index(_label(r)) + 0.22 * (1 - k) for r in some], mode="markers", name=ways[way], marker={"color": colour, "size": 9},
            error_x={"type": "data", "symmetric": False, "array": np.nan_to_num(ends[:, 1] - v), "arrayminus": np.nan_to_num(v - ends[:, 0]), "thickness": 1.4, "width": 4},
        ))  # fmt: skip
    fig.update_yaxes(tickvals=list(range(len(groups))), ticktext=groups, showgrid=False)
    fig.update_layout(margin={"l": 290, "r": 20, "t": 15, "b": 60}, legend={"y": -0.16, "x": -0.3})
    return fig.update_xaxes(title_text="speed of full aquaplaning [km/h]", range=(70, 180))


def _label(row):
    return f"{row['tyre'].replace('_', ' ')}, {row['pressure_front_bar']:g} bar, {row['water_depth_mm']:g} mm"


OWN: dict[str, Callable[[], go.Figure]] = {
    f.__name__: f
    for f in (
        spin_down, minor_spin_down, resistance, slip_slope_drop, joint_criteria, joint_cusum, margin, reading, alignment,
        water_law, calibration, diagnosis, evaluation,
    )
}  # fmt: skip
OF_THESIS = {  # name: panels of figures, one below the other
    "spin_up": ("2.8", ("a", "c")),
    "tie_rod": ("2.22", ("a", "b")),
    "slip_slope_filter": ("3.6", ("a",)),
    "contact": ("2.2", ("a", "c")),
}
OF_CAMPAIGN = {"simulation": ("2.3", ("d",)), "slip_slope": ("2.16", ("a",)), "campaign_regression": ("2.17", ("a",))}


def aqualog(*arguments, capture=False):
    """Run a command of this checkout."""
    done = subprocess.run([sys.executable, "-m", "aqualog", *arguments], cwd=ROOT, check=False, capture_output=capture, text=True)  # fmt: skip
    if done.returncode not in (0, 3):
        raise SystemExit(f"aqualog {' '.join(arguments)} ended with {done.returncode}")
    return done.stdout


def of_thesis(number, letters, folder, campaign=None):
    """Panels of a figure as pictures, one below the other."""
    from PIL import Image

    more = ["--campaign", str(campaign)] if campaign else []
    aqualog("figures", number, "-o", str(folder), "--format", "png", "--force", "-q", *more, capture=True)
    stem = f"figure_{number.split('.')[0]}_{int(number.split('.')[1]):02d}"
    alone = folder / f"{stem}.png"
    images = [Image.open(alone if alone.exists() else folder / f"{stem}_{x}.png").convert("RGB") for x in letters]
    images = [i.resize((WIDTH, round(i.height * WIDTH / i.width)), Image.Resampling.LANCZOS) for i in images]
    whole = Image.new("RGB", (WIDTH, sum(i.height for i in images)), "white")
    top = 0
    for i in images:
        whole.paste(i, (0, top))
        top += i.height
    return whole


def drawn(fig):
    """A plotly figure as a picture."""
    from PIL import Image

    return Image.open(io.BytesIO(fig.to_image(format="png", width=WIDTH, height=fig.layout.height, scale=1))).convert("RGB")  # fmt: skip


def keep(name, image):
    """Write with a small palette."""
    from PIL import Image

    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / f"{name}.png"
    image.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(path, optimize=True)
    print(f"{path.relative_to(ROOT)} {path.stat().st_size / 1000:.0f} kB", flush=True)


def campaign_in(folder):
    """The thesis' programme, simulated and measured."""
    aqualog("simulate", "campaign", "thesis", "-o", str(folder / "thesis"))
    aqualog("batch", str(folder / "thesis" / "campaign.toml"))
    return folder / "thesis" / "campaign.toml"


def main():
    """Make those that are named, or all."""
    parser = argparse.ArgumentParser(prog="python -m tests.book.pictures", description=__doc__)
    known = [*OWN, *OF_THESIS, *OF_CAMPAIGN, "full_aquaplaning"]
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(known))
    parser.add_argument("--campaign", type=Path, help="campaign.toml of the thesis' programme, with its store")
    given = parser.parse_args()
    names = given.names or known
    if unknown := set(names) - set(known):
        parser.error(f"no picture {', '.join(sorted(unknown))}")
    with tempfile.TemporaryDirectory(prefix="aqualog-pictures-") as folder:
        campaign = given.campaign
        if not campaign and {*OF_CAMPAIGN, "full_aquaplaning"} & set(names):
            campaign = campaign_in(Path(folder))
        for name in names:
            if name in OWN:
                keep(name, drawn(OWN[name]()))
            elif name in OF_THESIS:
                keep(name, of_thesis(*OF_THESIS[name], Path(folder)))
            elif name in OF_CAMPAIGN:
                keep(name, of_thesis(*OF_CAMPAIGN[name], Path(folder), campaign))
            else:
                keep(name, drawn(full_aquaplaning(campaign)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

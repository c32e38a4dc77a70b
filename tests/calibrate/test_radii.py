"""Effective radii from made windows: exact whatever delay, slip and inertia there is."""

import numpy as np
import pytest

from aqualog.calibrate.radii import fit_radii, radii_spread

FREE, DRIVEN = 0.3165, 0.3182  # [m]


def blocks(rng, drivetrain, *, delay, n=8, noise=0.0):
    """Blocks of one drive as `radii_of_blocks` makes them."""
    out = []
    for _ in range(n):
        v = rng.uniform(12.0, 34.0, 20)
        a = rng.normal(0.1, 0.5, 20)
        force = 0.03 + a / 9.81 + rng.normal(0.0, 0.01, 20)
        slip = 0.03 * force + 0.05 * force**2 + 0.1 * force**3 + 2e-5 * a
        late = a / v
        v_over_free = FREE * (1.0 + delay * late + noise * rng.normal(size=20))
        ratio = FREE / DRIVEN * (1.0 + slip + noise * rng.normal(size=20))  # driven over free wheel speed
        v_over_driven = v_over_free / ratio
        if drivetrain == "rwd":
            out.append(np.column_stack([v_over_free, v_over_driven, ratio, force, late, a]))
        else:
            out.append(np.column_stack([v_over_driven, v_over_free, 1.0 / ratio, force, late, a]))
    return out


@pytest.mark.parametrize(("drivetrain", "limit"), [("rwd", 1e-9), ("fwd", 1e-6)])
def test_exact_without_noise(drivetrain, limit):
    """Each drive with a delay of its own; at 0.1 m/s^2 of mean acceleration they would move a radius by 1e-4."""
    rng = np.random.default_rng(3)
    drives = [blocks(rng, drivetrain, delay=d) for d in (0.03, -0.01, 0.015)]
    found = fit_radii(drives, drivetrain)
    with np.errstate(over="raise"):  # forces that no car has
        assert fit_radii([[b * [1, 1, 1, 1e120, 1, 1] for b in d] for d in drives], drivetrain) == pytest.approx(found)
    front, rear = (FREE, DRIVEN) if drivetrain == "rwd" else (DRIVEN, FREE)
    assert found.r_e_f == pytest.approx(front, rel=limit)
    assert found.r_e_r == pytest.approx(rear, rel=limit)
    assert found.r_e_ratio == pytest.approx(front / rear, rel=limit)


@pytest.mark.parametrize(
    ("count", "drivetrain"),
    [(1, "rwd"), (4, "fwd"), *(pytest.param(*x, marks=pytest.mark.nightly) for x in ((1, "fwd"), (4, "rwd")))],
)
def test_spread_is_that_of_the_estimates(drivetrain, count):
    rng = np.random.default_rng(4)
    found, said = [], []
    for _ in range(60):
        drives = [blocks(rng, drivetrain, delay=0.01, noise=1e-4) for _ in range(count)]
        found.append(fit_radii(drives, drivetrain))
        said.append([radii_spread(drives, drivetrain).sd[n] for n in ("r_e_f", "r_e_r", "r_e_ratio")])
    scatter, claimed = np.std(found, axis=0), np.sqrt(np.mean(np.square(said), axis=0))
    assert np.all(claimed > 0.75 * scatter)
    assert np.all(claimed < 1.4 * scatter)


def test_without_velocity_only_the_ratio():
    drives = [blocks(np.random.default_rng(5), "rwd", delay=0.0)]
    for b in drives[0]:
        b[:, :2] = np.nan
    found = fit_radii(drives, "rwd")
    assert np.isnan(found.r_e_f)
    assert np.isnan(found.r_e_r)
    assert found.r_e_ratio == pytest.approx(FREE / DRIVEN, rel=1e-9)

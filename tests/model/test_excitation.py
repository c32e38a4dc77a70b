"""Active excitation: what the thesis says of each waveform (C100-C103, E16-E18) and of the amplitudes (C110)."""

import numpy as np
import pytest

from aqualog.core.compiled import inlined
from aqualog.core.errors import ConfigError
from aqualog.model import excitation

TAU = 8.0
# middles of even cells: no sample on a corner, and the mean is the midpoint rule over one period
N = 240_000
PERIOD = (np.arange(N) + 0.5) / N * TAU


@pytest.mark.parametrize(("name", "rms"), [("triangle", 0.577), ("sine", 0.707), ("ramp", 0.745), ("step", 1.0)])
def test_rms_peak_and_mean(name, rms):
    f = excitation.waveform(name, PERIOD, period=TAU)
    assert np.sqrt(np.mean(f**2)) == pytest.approx(rms, abs=5e-4)
    assert np.mean(f) == pytest.approx(0.0, abs=1e-12)
    assert f.max() == pytest.approx(1.0, abs=1e-4)
    assert f.min() == pytest.approx(-1.0, abs=1e-4)


@pytest.mark.parametrize("name", excitation.WAVEFORMS)
@pytest.mark.parametrize("period", [0.5, 8.0, 64.0])
def test_period_and_half_wave_symmetry(name, period):
    t = np.random.default_rng(1).uniform(-3.0, 3.0, 500) * period
    f = excitation.waveform(name, t, period=period)
    assert excitation.waveform(name, t + period, period=period) == pytest.approx(f, abs=1e-9)
    assert excitation.waveform(name, t + period / 2, period=period) == pytest.approx(-f, abs=1e-9)
    # and no shorter period
    assert np.abs(excitation.waveform(name, t + period / 3, period=period) - f).max() > 0.5
    # the period is the only time: f depends on t / period alone
    assert excitation.waveform(name, t / period, period=1.0) == pytest.approx(f, abs=1e-9)


@pytest.mark.parametrize("name", excitation.WAVEFORMS)
def test_in_phase_with_the_sine(name):
    f = excitation.waveform(name, PERIOD, period=TAU)
    sine = np.sin(2 * np.pi * PERIOD / TAU)
    assert (np.sign(f) == np.sign(sine)).all()
    # largest correlation without any shift, up or down
    correlation = np.fft.irfft(np.fft.rfft(f) * np.conj(np.fft.rfft(sine)), N)
    assert np.argmax(correlation) * TAU / N == pytest.approx(0.0, abs=1e-3)


def test_triangle_by_its_corners():
    """E16: with a truncated modulo the first value would be 2."""
    t = np.array([-TAU / 4, 0.0, TAU / 8, TAU / 4, TAU / 2, 3 * TAU / 4, TAU])
    assert excitation.f_triangle(t, period=TAU) == pytest.approx([-1.0, 0.0, 0.5, 1.0, 0.0, -1.0, 0.0], abs=1e-12)
    slope = np.abs(np.diff(excitation.f_triangle(PERIOD, period=TAU))) / (TAU / N)
    assert np.median(slope) == pytest.approx(4.0 / TAU)
    assert slope.max() < 4.001 / TAU  # no jump


def test_sine_by_its_values():
    t = np.array([0.0, TAU / 12, TAU / 4, TAU / 2, 3 * TAU / 4])
    assert excitation.f_sine(t, period=TAU) == pytest.approx([0.0, 0.5, 1.0, 0.0, -1.0], abs=1e-12)


def test_ramp_sections_are_a_sixth_of_the_period():
    """E17: ramps from and to zero and plateaus of tau / 6 each."""
    f = excitation.f_ramp(PERIOD, period=TAU)
    assert np.mean(f == 1.0) == pytest.approx(1 / 6, abs=1e-4)
    assert np.mean(f == -1.0) == pytest.approx(1 / 6, abs=1e-4)
    assert excitation.f_ramp(np.array([0.0, TAU / 12, TAU / 6, TAU / 3, TAU / 2]), period=TAU) == pytest.approx(
        [0, 0.5, 1, 1, 0]
    )
    rising = PERIOD < TAU / 6
    assert np.diff(f[rising]) == pytest.approx(6.0 / N)


def test_step_and_its_printed_phase():
    """E18."""
    t = np.array([0.0, 0.1 * TAU, 0.49 * TAU, 0.5 * TAU, 0.51 * TAU, 0.99 * TAU])
    assert excitation.f_step(t, period=TAU).tolist() == [1.0, 1.0, 1.0, 0.0, -1.0, -1.0]
    assert excitation.f_step(t, period=TAU, printed_phase=True).tolist() == [-1.0, -1.0, -1.0, 0.0, 1.0, 1.0]


def test_a_waveform_that_does_not_exist():
    with pytest.raises(ConfigError, match="triangle"):
        excitation.waveform("square", PERIOD, period=TAU)


@pytest.mark.parametrize("name", excitation.WAVEFORMS)
def test_compiled_equals_numpy(name):
    function = inlined(excitation.WAVEFORMS[name])
    extra = (False,) if name == "step" else ()
    for t in np.random.default_rng(2).uniform(-20, 20, 50):
        assert function(t, TAU, *extra) == excitation.waveform(name, t, period=TAU)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.6, 1.0])
def test_sum_of_the_axle_forces_is_constant(nu):
    """C97: 3.26 and 3.27; nu is the REAR share (E19)."""
    F_exc = 250.0 * np.sin(PERIOD[::1000])
    F_f, F_r = excitation.axle_forces(np.full_like(F_exc, 1650.0), F_exc, nu=nu)
    assert F_f + F_r == pytest.approx(1650.0)
    assert F_f - (1 - nu) * 1650.0 == pytest.approx(F_exc)
    assert F_r - nu * 1650.0 == pytest.approx(-F_exc)


def test_nu_zero_is_front_drive():
    assert excitation.axle_forces(np.array([1000.0]), np.array([0.0]), nu=0.0) == (1000.0, 0.0)
    assert excitation.axle_forces(np.array([1000.0]), np.array([0.0]), nu=1.0) == (0.0, 1000.0)


def test_amplitude_kinds():
    F_0_f, F_0_r = np.array([700.0, -700.0]), np.array([300.0, -300.0])
    F_z_f, F_z_r = np.array([9000.0]), np.array([7000.0])
    args = (F_0_f, F_0_r, F_z_f, F_z_r)
    assert excitation.excitation_amplitude("force", 250.0, *args) == pytest.approx([250.0, 250.0])
    assert excitation.excitation_amplitude("mu", 0.03, *args) == pytest.approx(0.03 * 7000.0)
    assert excitation.excitation_amplitude("mu", 0.03, F_0_f, F_0_r, F_z_r, F_z_f) == pytest.approx(0.03 * 7000.0)
    assert excitation.excitation_amplitude("relative", 0.5, *args) == pytest.approx([150.0, 150.0])
    assert excitation.excitation_amplitude("relative", 0.5, F_0_r, F_0_f, F_z_f, F_z_r) == pytest.approx([150.0, 150.0])
    with pytest.raises(ConfigError, match="relative"):
        excitation.excitation_amplitude("share", 0.5, *args)


@pytest.mark.parametrize("name", excitation.WAVEFORMS)
@pytest.mark.parametrize("nu", [0.0, 0.2, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("F_sum", [1500.0, 300.0, -1200.0])
def test_relative_amplitude_keeps_the_sign_of_both_forces(name, nu, F_sum):
    """C110: "For relative amplitudes, always positive axle forces are guaranteed"."""
    F_0_f, F_0_r = excitation.axle_forces(np.full(PERIOD.size, F_sum), np.zeros(PERIOD.size), nu=nu)
    A = excitation.excitation_amplitude("relative", 1.0, F_0_f, F_0_r, np.array([8000.0]), np.array([8000.0]))
    F_f, F_r = excitation.axle_forces(F_0_f + F_0_r, A * excitation.waveform(name, PERIOD, period=TAU), nu=nu)
    assert (F_f * np.sign(F_sum) >= -1e-9).all()
    assert (F_r * np.sign(F_sum) >= -1e-9).all()
    if 0.0 < nu < 1.0:  # and no more than needed: the smaller force comes down to zero
        assert min(np.abs(F_f).min(), np.abs(F_r).min()) == pytest.approx(0.0, abs=1.0)


def test_mu_amplitude_may_turn_forces_negative():
    """C111: "but may lead to negative forces on the wheels"."""
    F_0_f, F_0_r = excitation.axle_forces(np.full(PERIOD.size, 500.0), np.zeros(PERIOD.size), nu=0.3)
    A = excitation.excitation_amplitude("mu", 0.07, F_0_f, F_0_r, np.array([8000.0]), np.array([8100.0]))
    _, F_r = excitation.axle_forces(F_0_f + F_0_r, A * excitation.f_sine(PERIOD, period=TAU), nu=0.3)
    assert pytest.approx(560.0) == A
    assert F_r.min() < 0.0


def test_compiled_amplitude_and_forces():
    amplitude, forces = inlined(excitation.excitation_force_amplitude), inlined(excitation.axle_forces)
    rng = np.random.default_rng(3)
    for kind, number in excitation.AMPLITUDE_KINDS.items():
        for _ in range(20):
            args = (float(rng.uniform(0, 1)), *(float(x) for x in rng.uniform(-2000, 9000, 4)))
            assert amplitude(number, *args) == excitation.excitation_amplitude(kind, *args)
            assert forces(args[1], args[2], args[0]) == excitation.axle_forces(args[1], args[2], nu=args[0])


@pytest.mark.parametrize("name", ["triangle", "sine", "ramp"])
def test_rate_of_the_force_is_the_steepest_part(name):
    t = np.linspace(0.0, 8.0, 80_001)
    steepest = np.abs(np.diff(250.0 * excitation.waveform(name, t, period=8.0))).max() / 1e-4
    assert excitation.force_rate(name, amplitude=250.0, period=8.0) == pytest.approx(steepest, rel=1e-3)


def test_a_step_has_no_rate():
    assert excitation.force_rate("step", amplitude=250.0, period=8.0) == np.inf
    with pytest.raises(ConfigError, match="square"):
        excitation.force_rate("square", amplitude=1.0, period=1.0)

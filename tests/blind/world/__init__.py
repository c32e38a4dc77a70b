"""A road, a driver and a car of their own, to hide effects in drives that the library's simulator has not made.

Nothing of `aqualog.model` or `aqualog.physics` is used: own tyre (Magic Formula), own integrator (Runge-Kutta 4),
pitch and roll as oscillators, own water, own driver, own sensors and noise. Only the vehicle record and the table of
signals are shared.
"""

"""A third simulator for blind tests, which shares neither code nor laws with the other two, nor with the library.

What is different:

| | library | `world` | `plain` | here |
|---|---|---|---|---|
| tyre | brush | Magic Formula | linear | TMeasy in generalised slip, quadratic over the load [1, ch. 3] |
| build-up | none or relaxation | relaxation | none | belt on a torsional spring to the rim, and bristles in the contact |
| body | plane, pitch by a lag | plane, pitch and roll as oscillators | point | heave, pitch, roll, four unsprung masses, anti-roll bars |
| driveline | torque at the wheel | torque at the wheel | steps | engine or motors, elastic shafts with backlash, open differential |
| rolling resistance | constant | constant | constant | rises with speed, polynomial of fourth order [2, sec. 1.3] |
| road | flat, lanes | curves, lanes | flat | unevenness of ISO 8608 [3], bank, rolling grade |
| wheel speed | noise, ring | noise, ring | noise | edges of a tone ring counted in windows of 10 ms, uneven teeth [4] |
| integrator | linearly implicit | Runge-Kutta 4 | Euler | Adams-Bashforth 2, Coulomb brakes by impulse |

The accelerometer rides on a pitching body and corrects a part of that. The CAN messages have rates and stamps of their own.
The torque is an estimate of the shaft's torque. The log is no table: groups of an MDF file have their own times.

With nothing hidden the vehicle file is what a calibration would find, with its errors: see `car.FILE_ERRORS`. A drive
differs from the file by `car.SPREAD` as days do, and the file says so in its table `spread`.

Blind by process: `make` writes cases whose truth is sealed, and `seal.open_truth` opens it after the verdict only.
Kinds marked `held_back` in `hidden.KINDS` are never used in development.

[1] Rill, Road Vehicle Dynamics, 2012. [2] Mitschke and Wallentowitz, Dynamik der Kraftfahrzeuge, 2004. [3] ISO 8608:2016.
[4] Gustafsson, Automatica 36 (2000), slip slope of tyres: 6.8e-4 a tooth. All numbers of cars are general knowledge.
"""

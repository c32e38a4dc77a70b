"""The simulator: half-car and four-wheel vehicle, sensors, and models as sets of terms."""

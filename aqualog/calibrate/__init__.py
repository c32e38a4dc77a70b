"""What detectors must know of a car, estimated from its dry drives."""

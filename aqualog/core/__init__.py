"""What every room stands on: errors, records, symbols, units, the vehicle, compiled code."""

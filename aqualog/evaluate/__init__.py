"""Detections against labels: recall, latency, false alarms, confusion, and thresholds proposed from them."""

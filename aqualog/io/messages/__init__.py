"""Recorded messages: MCAP, ROS 1 bags and ROS 2 recordings, as columns of numbers."""

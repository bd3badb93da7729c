"""Learned detectors, segmenters and trackers."""

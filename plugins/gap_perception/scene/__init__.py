"""Understands a calibrated RGB-D observation by explaining its points with the task's object models."""

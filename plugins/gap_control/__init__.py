"""Follows trajectories, stops, and reacts to contact, for the arm of any cell; a library that other plugins import."""

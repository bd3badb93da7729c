"""Clients of published grasp networks."""

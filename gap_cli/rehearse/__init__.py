"""Rehearsal: sample instances, roll the graph out in physics, judge each, and say what to revise."""

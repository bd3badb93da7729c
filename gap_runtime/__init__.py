"""What runs a graph of robot skills, on a robot or in a rehearsal."""

__version__ = "0.1.0"

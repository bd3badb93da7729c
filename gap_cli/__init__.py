"""GaP: from a sentence about a manipulation task to a rehearsed graph of robot skills."""

__version__ = "0.1.0"

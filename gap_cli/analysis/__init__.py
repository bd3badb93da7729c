"""What a graph refers to and what follows from it: signatures, value types, exits, and the context rules look at."""

"""Every rule about a graph, and its JSON Schema."""

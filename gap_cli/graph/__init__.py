"""The graph language: workflow v3, its builder, its rules, and the interpreter."""
